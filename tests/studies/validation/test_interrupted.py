"""Ctrl-C while causes are looked for, or before a fit has values, and trials that do not run: nothing vanishes."""

import json
from dataclasses import replace

import pytest

import orchestrator as gfor_in_python
from orchestrator.core.errors import INTERRUPTED, ComponentError, ErrorKind, FmuFileError
from orchestrator.studies.validation.trials import TrialLog
from tests.studies.validation.recordings import phasor_plant, with_noise, written

MODEL, STEP = "gfor_phasor", "1 ms"


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    return written(with_noise(phasor_plant()), tmp_path_factory.mktemp("interrupted"))


class Interrupt:
    """A report that interrupts at the first sentence which begins so."""

    def __init__(self, begin):
        self.begin = begin

    def __call__(self, text):
        if text.startswith(self.begin):
            raise KeyboardInterrupt


def test_an_interrupted_search_keeps_the_causes_that_were_found(recording):
    report = Interrupt("sensitivity to droop")
    found = gfor_in_python.validate(MODEL, recording, explain=True, step=STEP, report=report)
    content = found.as_json()
    assert content["finished"] is False
    assert "pod_p.enabled" in [one["parameter"] for one in content["explanations"]]
    assert "Interrupted before all causes were tried." in found.html()
    assert content["events"][0]["windows"]


def test_an_interrupted_search_starts_no_fit(recording):
    report = Interrupt("trying")
    found = gfor_in_python.validate(
        MODEL, recording, explain=True, fit="pod_p.K", step=STEP, report=report
    )
    assert found.result.fit is None
    assert found.as_json()["explanations"] == []
    assert "No cause that was tried leaves less of the error." in found.html()


def test_a_fit_that_is_interrupted_before_it_has_values_leaves_the_figures(
    recording, gfor, monkeypatch
):
    from orchestrator.studies.validation import study  # noqa: PLC0415 - its fit is replaced

    def stopped(*given):
        raise KeyboardInterrupt

    monkeypatch.setattr(study, "fit_parameters", stopped)
    options = ("--fit", "pod_p.K", "--step", STEP)
    code, out, _ = gfor("validate", MODEL, str(recording), *options, "--json")
    content = json.loads(out)
    assert code == INTERRUPTED
    assert content["finished"] is False
    assert content["events"][0]["windows"]
    assert "fit" not in content
    code, out, _ = gfor("validate", MODEL, str(recording), *options)
    assert code == INTERRUPTED
    assert "Interrupted before a fit had any values" in out


def test_what_does_not_run_is_named_with_the_reason(recording):
    """Read as of one phase, the plant feeds more than the device takes."""
    found = gfor_in_python.validate(MODEL, recording, step=STEP).as_json()
    assert found["finished"] is True
    by_name = {one["tried"]: one for one in found["refused"]}
    refused = by_name["P and Q are of one phase"]
    assert refused["kind"] == "input"
    assert "P_0 = 2.7 pu, and the device takes -2.0 to 2.0" in refused["reason"]


def test_neither_an_interrupt_nor_a_defect_nor_a_broken_file_is_taken_for_a_refusal():
    log = TrialLog()
    for error in (KeyboardInterrupt(), ZeroDivisionError("ours"), FmuFileError("no file")):
        with pytest.raises(type(error)), log.trial("a value"):
            raise error
    assert log.refused == ()
    for status in ("fmi2Error", "fmi2Fatal"):
        with log.trial("a value"):
            raise ComponentError("device", "fmi2DoStep", status, "too large", 0.1)
    (refused,) = log.refused
    assert (refused.tried, refused.kind) == ("a value", ErrorKind.FMU)
    assert refused.matters
    assert not replace(refused, kind=ErrorKind.INPUT).matters
    assert "fmi2DoStep returned fmi2Error: too large" in refused.reason
