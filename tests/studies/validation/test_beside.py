"""Two models of one plant beside one recording: the phasor model and the EMT model."""

import json
from dataclasses import replace

import orchestrator as gfor_in_python
from orchestrator.studies.validation.beside import models_apart
from orchestrator.studies.validation.limits import EXAMPLE
from orchestrator.studies.validation.page import _model
from orchestrator.studies.validation.view import Validation, parts
from orchestrator.studies.validation.words import difference_sentence
from tests.studies.validation.recordings import phasor_plant, run, table, with_noise, written

ON = {"pod_p.enabled": True}


def test_the_phasor_and_the_emt_model_come_out_of_one_command(gfor, tmp_path):
    path = written(with_noise(table(run())), tmp_path)
    options = ("--set", "pod_p.enabled=true", "--beside", "gfor", "--limits", str(EXAMPLE))
    folder = tmp_path / "out"
    more = ("--out", str(folder), "--json")
    code, out, _ = gfor("validate", "gfor_phasor", str(path), *options, *more)
    assert code == 0
    page = (folder / "validation.html").read_text(encoding="utf-8")
    assert page.count('data-label="gfor"') == page.count('data-label="gfor_phasor"') == 2
    content = json.loads(out)
    assert content["verdict"] == "met"
    assert {one["device"] for one in content["criteria"]} == {"gfor_phasor", "gfor"}
    beside = content["beside"]
    assert beside["device"] == "gfor"
    rows = {(one["window"], one["signal"]): one for one in beside["apart"]}
    assert len(rows) == 6
    assert rows["after", "p"]["apart_max_pu"] < 0.01
    assert all(
        abs(one["apart_rms_pu"]) <= one["first_rms_pu"] + one["second_rms_pu"]
        for one in beside["apart"]
    )


def test_models_that_differ_more_from_each_other_than_from_the_record_are_told():
    # the plant's gain lies between those of its two models
    recording = with_noise(phasor_plant()).set_index("time")
    first, second = (
        gfor_in_python.validate(
            "gfor_phasor", recording, values=ON | {"pod_p.K": gain}, step="1 ms"
        ).result
        for gain in (60.0, 180.0)
    )
    apart = models_apart(first.comparisons[0], second.comparisons[0])
    places = [one for one in apart if one.more_than_from_record]
    assert ("after", "p") in {(one.window, one.signal) for one in places}
    assert "differ from each other more than from the record" in difference_sentence(places)
    assert not any(one.more_than_from_record for one in models_apart(*2 * first.comparisons))


def test_the_first_line_names_the_model_with_the_larger_error():
    recording = with_noise(phasor_plant()).set_index("time")
    of_gains = {
        gain: gfor_in_python.validate(
            "gfor_phasor", recording, values=ON | {"pod_p.K": gain}, step="1 ms"
        )
        for gain in (120.0, 180.0)
    }
    right, wrong = (found.result for found in of_gains.values())
    named = [replace(one.device, name="wrong") for one in wrong.comparisons]
    others = [replace(one, device=of) for one, of in zip(wrong.comparisons, named, strict=True)]
    said = [
        one
        for one in parts(Validation(replace(right, others=others)))
        if "largest error" in str(one)
    ]
    (first,) = map(str, said)
    assert first.startswith("wrong: the largest error")
    assert f"{wrong.comparisons[0].largest_error[2].max_error:.3g} pu" in first
    both = _model(replace(right, request=replace(right.request, beside=named[0])))
    assert "wrong and the values that it was given" in both
    assert both.index("120.0") < both.index("180.0")
