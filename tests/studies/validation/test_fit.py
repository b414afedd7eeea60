"""Parameters that made a recording are found again, and what it cannot tell is named."""

import json

import pytest

import orchestrator as gfor_in_python
from tests.studies.validation.recordings import run, table, with_noise, written

ON = {"pod_p.enabled": True}


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    clean = table(run("pod_p", gfor__pod_p__K=120.0))
    return written(with_noise(clean), tmp_path_factory.mktemp("fit"))


def test_a_gain_is_found_within_its_interval(gfor, recording):
    options = ("--set", "pod_p.enabled=true", "--fit", "pod_p.K", "--json")
    code, out, _ = gfor("validate", "gfor", str(recording), *options)
    assert code == 0
    (found,) = json.loads(out)["fit"]
    assert found["parameter"] == "pod_p.K"
    assert found["identifiable"]
    assert found["low"] < 120 < found["high"]
    assert found["value"] == pytest.approx(120, rel=0.05)
    assert found["high"] - found["low"] < 30


def test_a_switched_off_controller_is_seen_and_its_gain_with_it(recording):
    found = gfor_in_python.validate("gfor", recording, fit="pod_p.enabled, pod_p.K").fitted()
    by_name = found.set_index("parameter")
    assert bool(by_name.loc["pod_p.enabled", "value"]) is True
    assert by_name.loc["pod_p.K", "value"] == pytest.approx(120, rel=0.05)


def test_what_moves_nothing_is_named_before_the_fit_and_left(recording):
    found = gfor_in_python.validate("gfor", recording, values=ON, fit="pod_q.K, pod_p.K").fitted()
    by_name = found.set_index("parameter")
    assert not by_name.loc["pod_q.K", "identifiable"]
    assert by_name.loc["pod_q.K", "why_not"] == "no effect"
    assert by_name.loc["pod_q.K", "value"] == by_name.loc["pod_q.K", "start"]
    assert by_name.loc["pod_p.K", "identifiable"]


def test_names_and_bounds_that_do_not_fit_are_refused(gfor, recording):
    code, _, err = gfor("validate", "gfor", str(recording), "--fit", "pod_p.KK")
    assert code == 2
    assert "pod_p.K" in err
    options = ("--fit", "pod_p.K", "--bounds", "pod_p.K=-5:10")
    code, _, err = gfor("validate", "gfor", str(recording), *options)
    assert code == 2
    assert "0 to 100000" in err.replace("1e+05", "100000")
