"""Converters of other kinds than ours: honest ones are not accused, and what winds up at its limit is named."""

import re

import pytest

from orchestrator.devices.acceptance.runner import check_fmu
from orchestrator.devices.sandbox.resource_limits import Limits
from tests.devices.acceptance.gallery.build import build
from tests.devices.acceptance.gallery.members import (
    binding,
    device,
    faults_of_other_kinds,
    other_kinds,
)

LIMITS = Limits(seconds=6.0)
FAULTY = {m.name: m for m in faults_of_other_kinds()}
ASKED = ("steady_state", "power_balance", "anti_windup")


@pytest.mark.slow
@pytest.mark.parametrize("name", [m.name for m in other_kinds()])
def test_an_honest_converter_of_another_kind_is_accepted(name, gallery):
    found = check_fmu(*gallery(name), LIMITS, run_for=0.5)
    assert found.failures == []
    assert found.trusted


@pytest.mark.parametrize("name", FAULTY)
def test_a_fault_of_another_kind_is_told_by_its_cause(name, gallery):
    found = check_fmu(*gallery(name), LIMITS, FAULTY[name].only[-3:], run_for=0.3)
    assert found.faults == [FAULTY[name].fault]


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("name", ["oscillator_that_winds_up", "winds_up_absorbing"])
def test_winding_up_is_seen_at_every_seed_and_grows_with_the_time_at_the_limit(name, seed, gallery):
    """Its integral part moves by as much in each second: three times the time leaves three times as much."""
    (failure,) = check_fmu(*gallery(name), LIMITS, ASKED, run_for=0.3, seed=seed).failures
    assert failure.fault == "winds up"
    assert 1.8 < failure.figures["long"] / failure.figures["short"] < 3.5


@pytest.mark.parametrize("name", ["matching", "virtual_oscillator", "virtual_machine"])
def test_the_same_with_its_anti_windup_leaves_as_much_after_a_short_time(name, gallery):
    (*_, found) = check_fmu(*gallery(name), LIMITS, ASKED, run_for=0.3).results
    assert found.verdict == "pass"
    assert found.figures["compared"] == 4


def test_what_was_not_judged_is_a_reason_not_to_accept(tmp_path):
    """It goes on to move for a minute after each dip: nothing failed, and nothing is known."""
    file = build(device("never_rests", "FOLLOWING", FAULT_Q_WINDS_UP=6.0), tmp_path)
    found = check_fmu(file, None, LIMITS, ("after_dips",), run_for=0.3)
    assert found.faults == []
    assert not found.trusted
    assert found.sentence.startswith("no check failed, and not to be accepted as it is: not judged")
    assert found.as_dict()["reasons"] == found.reasons


def test_a_range_of_the_frequency_that_its_binding_states_is_no_fault(tmp_path):
    file = build(device("states_it", "FOLLOWING", FAST_WITHIN=0.2), tmp_path)
    path = tmp_path / "states_it.toml"
    text = binding("rectangular", current='base = "100 MVA"')
    stated = re.sub(r"(\[rating\]\n)", r'\1frequency_range = "0.2 Hz"\n', text)
    asked = ("steady_state", "power_balance", "evenness")
    for content, faults in ((text, ["droop of one range"]), (stated, [])):
        path.write_text(content, encoding="utf-8")
        assert check_fmu(file, path, LIMITS, asked, run_for=0.3).faults == faults


def test_a_range_of_the_frequency_is_below_the_rated_one(tmp_path):
    file = build(device("all_of_it", "FOLLOWING"), tmp_path)
    path = tmp_path / "all_of_it.toml"
    text = binding("rectangular", current='base = "100 MVA"')
    stated = text.replace("[rating]", '[rating]\nfrequency_range = "60 Hz"')
    path.write_text(stated, encoding="utf-8")
    (*_, found) = check_fmu(file, path, LIMITS, ("binding",)).results
    assert found.verdict == "fail"
    assert "frequency_range = 60 Hz; it must be above 0 and below f_n" in found.evidence


def test_a_phasor_model_without_a_current_loop_is_told_as_such_and_not_failed(fmu_path):
    """Its current is a function of the voltage, and of whatever size; a device's is not, and must be limited."""
    (_, found) = check_fmu(fmu_path("gfor_phasor"), None, LIMITS, ("limits",), run_for=0.3).results
    assert found.verdict == "remark"
    assert "a phasor model without a current loop" in found.evidence
    assert found.figures["not_judged"].startswith("what limits its current")


def test_a_current_that_nothing_limits_is_told_in_these_words(gallery):
    (failure,) = check_fmu(*gallery("no_limit"), LIMITS, ("limits",), run_for=0.3).failures
    assert failure.fault == "no current limit"
    assert failure.evidence.startswith("nothing limits its current: ")
