"""The norm's criteria on modes, on systems small enough to see the answer."""

import numpy as np
import pytest

from orchestrator.linear.spectra.mode_tracking import ModeSet
from orchestrator.studies.certification.bus_frequency import bus_frequency
from orchestrator.studies.certification.criteria import (
    _partners,
    critical_mode,
    judged_modes,
    matched_modes,
    modal_test,
    neighbouring_modes,
    stability_fault,
)
from orchestrator.studies.certification.judgement import PointVerdict


def eigenvalue_test(having, lacking):
    return judged_modes(matched_modes(having, lacking))


def mode(frequency, ratio):
    return 2 * np.pi * frequency / np.sqrt(1 - ratio**2) * complex(-ratio, np.sqrt(1 - ratio**2))


def modes(*entries):
    """A set of modes, each of a frequency, a damping ratio and a state of its own."""
    states = sorted({name for *_, name in entries} | {"a", "b", "c", "d"})
    shapes = np.array(
        [[float(name == state) for state in states] for *_, name in entries], dtype=complex
    )
    values = np.array([mode(f, ratio) for f, ratio, _ in entries])
    return ModeSet(values, shapes, shapes, tuple(states))


def verdict(having, lacking):
    (found,) = eigenvalue_test(modes(having), modes(*lacking))
    return found


def test_enough_damping_is_accepted_whatever_was_before():
    assert verdict((0.5, 0.051, "a"), [(0.5, 0.2, "a")]).accepted
    assert verdict((0.5, 0.051, "a"), []).accepted


def test_a_mode_that_is_introduced_needs_five_percent():
    found = verdict((0.5, 0.049, "converter"), [(0.5, 0.049, "a")])
    assert not found.accepted
    assert found.before is None
    assert "introduces" in found.reason


def test_an_existing_mode_must_not_be_taken_below_five_percent():
    found = verdict((0.5, 0.049, "a"), [(0.9, 0.03, "b"), (0.55, 0.06, "a")])
    assert not found.accepted
    assert found.before == pytest.approx(mode(0.55, 0.06))
    assert "takes a mode from 6.00 % to 4.90 %" in found.reason


def test_a_mode_that_was_below_already_is_not_the_converters_doing():
    assert verdict((0.5, 0.02, "a"), [(0.55, 0.03, "a")]).accepted


def test_one_mode_that_was_below_already_excuses_one_only():
    """Two copies of a state's mode are both like the one that was; the likelier has it, the other is introduced."""
    r = np.sqrt([0.9, 0.1])
    shapes = np.array([[1, 0], r], complex)
    left = np.array([[1, 0], [1 / r[0] * 0.8, 0.2 / r[1]]], complex)
    having = ModeSet(np.array([mode(0.5, 0.02), mode(0.7, 0.01)]), shapes, left, ("a", "b"))
    lacking = modes((0.55, 0.03, "a"))
    found = {round(v.frequency_hz, 3): v for v in eigenvalue_test(having, lacking)}
    assert found[0.5].accepted
    assert found[0.5].before == pytest.approx(mode(0.55, 0.03))
    assert found[0.7].before is None
    assert not found[0.7].accepted
    assert "introduces" in found[0.7].reason


@pytest.mark.parametrize("turned", [0.02, -0.02])
def test_of_two_modes_that_it_was_about_as_like_the_one_that_excuses_nothing_counts(turned):
    """A mode halfway between two: a bad one before would excuse it, a good one does not."""
    angle = np.pi / 4 + turned
    shape = np.array([[np.cos(angle), np.sin(angle)]], complex)
    having = ModeSet(np.array([mode(0.5, 0.03)]), shape, shape, ("a", "b"))
    both = np.eye(2, dtype=complex)
    lacking = ModeSet(np.array([mode(0.45, 0.02), mode(0.6, 0.3)]), both, both, ("a", "b"))
    (found,) = eigenvalue_test(having, lacking)
    assert (found.before_percent, found.accepted) == (pytest.approx(30.0), False)
    assert found.doubt == "or 0.450 Hz, 2.00 %, as like"
    clear = ModeSet(having.eigenvalues, *(np.array([[0.96, 0.28]], complex),) * 2, ("a", "b"))
    (found,) = eigenvalue_test(clear, lacking)
    assert (found.before_percent, found.accepted, found.doubt) == (pytest.approx(2.0), True, "")


def test_partners_are_chosen_together():
    alike = np.array([[0.9, 0.8], [0.85, 0.1], [0.45, 0.4]])
    assert _partners(alike) == {0: 1, 1: 0}


@pytest.mark.parametrize(
    ("was", "same"), [(0.056, False), (0.079, False), (0.081, True), (1.87, True), (1.88, False)]
)
def test_a_judged_mode_is_compared_with_none_far_from_the_judged_range(was, same):
    having = modes((0.33, 0.04, "a"))
    (found,) = eigenvalue_test(having, modes((was, 0.03, "a")))
    assert (found.before is not None, found.accepted) == (same, same)
    beside = neighbouring_modes(matched_modes(modes((was, 0.03, "a")), having))
    assert all((m.before is not None) == same for m in beside)
    (low,) = neighbouring_modes(matched_modes(modes((0.056, 0.9, "a")), modes((0.06, 0.9, "a"))))
    assert low.before is not None


@pytest.mark.parametrize(
    ("state", "said"),
    [
        ("a", "0.308 Hz with 13.82 %, is at 0.209 Hz with 26.20 % with the converter"),
        ("converter", "0.308 Hz with 13.82 %, has no counterpart with the converter"),
    ],
)
def test_what_becomes_of_the_least_damped_mode_is_said(state, said):
    lacking = modes((0.3076, 0.1382, "a"), (0.05, 0.01, "b"), (0.9, 0.5, "c"))
    found = tuple(eigenvalue_test(modes((0.209, 0.262, state)), lacking))
    point = PointVerdict(0.3, found, None, None, (), base_critical=critical_mode(lacking))
    assert point.of_base_critical() == f"the least damped mode without the converter, {said}"


@pytest.mark.parametrize(
    ("frequency", "judged"), [(0.099, False), (0.1, True), (1.5, True), (1.501, False)]
)
def test_only_modes_from_a_tenth_to_one_and_a_half_hertz_are_judged(frequency, judged):
    assert bool(eigenvalue_test(modes((frequency, -0.1, "a")), modes((0.5, 0.1, "b")))) == judged


def test_growth_is_a_fault_at_any_frequency_unless_it_was_there_before():
    assert stability_fault(0.5, 1e-6)
    assert stability_fault(0.5, 0.4) is None
    assert stability_fault(1e-5, -0.1) is None


@pytest.mark.parametrize(
    ("growth", "faulty"), [(0.5e-3, False), (0.9e-3, False), (1.2e-3, True), (0.1, True)]
)
def test_what_counts_as_growth(growth, faulty):
    """The free angle's eigenvalue is zero to 1e-3; a system that doubles within ten minutes is not stable."""
    assert bool(stability_fault(growth, -0.1)) == faulty
    assert bool(stability_fault(0.5, growth)) != faulty


@pytest.mark.parametrize(("before", "existing"), [(0.049, True), (0.051, False)])
def test_whether_a_mode_was_below_already_is_decided_at_five_percent(before, existing):
    assert verdict((0.5, 0.03, "a"), [(0.55, before, "a")]).accepted == existing


@pytest.mark.parametrize(("ratio", "accepted"), [(0.0499, False), (0.0501, True)])
def test_a_mode_that_is_introduced_is_judged_at_five_percent(ratio, accepted):
    assert verdict((0.5, ratio, "converter"), []).accepted == accepted


def test_half_of_a_mode_makes_it_the_same():
    """Of a mode that the converter shares, the one it resembles by 0.55 is the same, and by 0.45 is none."""
    for alike, same in ((0.55, True), (0.45, False)):
        shape = np.array([[np.sqrt(alike), np.sqrt(1 - alike)]], complex)
        having = ModeSet(np.array([mode(0.5, 0.03)]), shape, shape, ("a", "b"))
        one = np.array([[1.0, 0.0]], complex)
        (found,) = eigenvalue_test(
            having, ModeSet(np.array([mode(0.5, 0.02)]), one, one, ("a", "b"))
        )
        assert (found.before is not None, found.accepted) == (same, same)


TIMES = np.arange(0, 40, 0.005)


def ring(*parts):
    return sum(
        a * np.exp(mode(f, r).real * TIMES) * np.cos(mode(f, r).imag * TIMES) for a, f, r in parts
    )


def test_the_signals_modes_are_judged():
    good = modal_test(TIMES, ring((1, 0.4, 0.08), (0.5, 1.1, 0.06)), 0.5)
    assert good.accepted
    assert sorted(m.damping_percent for m in good.modes) == pytest.approx([6, 8], abs=0.01)
    bad = modal_test(TIMES, ring((1, 0.4, 0.08), (0.05, 1.1, 0.04)), 0.5)
    assert not bad.accepted
    assert "1.100 Hz has 4.00 %" in bad.reason


def test_what_lies_outside_the_range_or_is_negligible_is_not_judged():
    assert modal_test(TIMES, ring((1, 0.4, 0.08), (0.5, 2.0, 0.01)), 0.5).accepted
    assert modal_test(TIMES, ring((1, 0.4, 0.08), (0.004, 1.1, 0.03)), 0.5).accepted
    assert modal_test(TIMES, np.exp(-TIMES), 0.5).accepted
    # nothing was excited: nothing is shown
    assert not modal_test(TIMES, np.ones_like(TIMES), 0.5).accepted


@pytest.mark.parametrize(("amplitude", "accepted"), [(0.008, True), (0.013, False), (0.03, False)])
def test_a_component_above_a_hundredth_of_the_largest_is_judged(amplitude, accepted):
    assert modal_test(TIMES, ring((1, 0.4, 0.08), (amplitude, 1.1, 0.03)), 0.5).accepted == accepted


@pytest.mark.parametrize(("ratio", "accepted"), [(0.0495, False), (0.0505, True)])
def test_a_signals_mode_is_judged_at_five_percent(ratio, accepted):
    assert modal_test(TIMES, ring((1, 0.7, ratio)), 0.5).accepted == accepted


@pytest.mark.parametrize(
    ("frequency", "judged"), [(0.095, False), (0.105, True), (1.49, True), (1.51, False)]
)
def test_a_signals_mode_is_judged_from_a_tenth_to_one_and_a_half_hertz(frequency, judged):
    assert modal_test(TIMES, ring((1, 0.6, 0.08), (0.9, frequency, 0.02)), 0.5).accepted != judged


def test_the_bus_frequency_is_the_turn_of_the_angle_without_the_network_transient():
    drift, swing = 0.2, 0.01 * np.sin(2 * np.pi * 0.5 * TIMES)
    angle = 2 * np.pi * (drift * TIMES) + swing
    # a direct current, seen from the frame
    transient = 1e-3 * np.exp(-3 * TIMES) * np.exp(-2j * np.pi * 50 * TIMES)
    v = np.exp(1j * angle) + transient * np.exp(2j * np.pi * drift * TIMES)
    found = bus_frequency(TIMES, v.real, v.imag, 50.0)
    wanted = 50 + drift + np.gradient(swing, TIMES) / (2 * np.pi)
    # 0.5 mHz; unfiltered it would be 50 mHz
    decay_in_a_period = 1e-3 * (1 - np.exp(-3 * 0.02)) / (2 * np.pi * 0.02)
    assert np.abs(found - wanted)[10:-10].max() < decay_in_a_period
    assert np.abs(found - wanted)[1000:-10].max() < 1e-5


def test_a_verdict_that_is_not_known_is_no_fault_and_excuses_no_growth():
    known, unknown = (
        {"stable": stable, "sentence": "not known: x_q is off"} for stable in (True, None)
    )
    assert stability_fault(-0.1, -0.1, unknown, known) is None
    assert stability_fault(0.5, -0.1, unknown, known)
