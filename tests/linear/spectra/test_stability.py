"""The verdict over the whole spectrum: growth planted at every frequency, in systems of any size, and its cause."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import scipy.linalg

from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.linear.spectra import stability
from orchestrator.linear.spectra.modes import find_modes, oscillations
from orchestrator.linear.spectra.stability import Cause, Hidden, Stability, hidden, judge

STEP = 1e-4
PLANTED = {0.01: 0.002, 3.0: 0.5, 37.0: 104.0, 900.0: 0.3, 4_999.0: 20.0, 7_300.0: 11.0}
"""Frequency [Hz] and growth rate [1/s] of what is planted; the last lies beyond half the sampling frequency."""


def pair(hertz, rate):
    omega = 2 * np.pi * hertz
    return [[rate, omega], [-omega, rate]]


def crowd(planted, pairs=70):
    """A free angle, real poles and many damped oscillations, mixed by a coordinate change, with something planted."""
    rng = np.random.default_rng(5)
    hertz = np.geomspace(0.02, 800, pairs)
    blocks = [pair(f, -0.06 * 2 * np.pi * f) for f in hertz]
    A = scipy.linalg.block_diag(
        [[0.0]], *blocks, *([[-d]] for d in np.geomspace(0.05, 3e3, 40)), *planted
    )
    T = np.eye(len(A)) + 0.02 * rng.standard_normal(A.shape) / math.sqrt(len(A))
    return T @ A @ np.linalg.inv(T)


def model(A, step_size=None):
    names = tuple(f"device.x{k}" for k in range(len(A)))
    return LinearModel.from_matrix(
        A if step_size is None else scipy.linalg.expm(A * step_size), names, step_size
    )


@pytest.mark.parametrize("hertz", PLANTED)
def test_growth_is_found_at_any_frequency(hertz):
    verdict = judge(model(crowd([pair(hertz, PLANTED[hertz])]), STEP))
    assert verdict.stable is False
    assert verdict.largest_growth_rate == pytest.approx(PLANTED[hertz], rel=1e-4)
    assert verdict.growing == 1
    seen = abs(hertz - 1 / STEP) if hertz > 0.5 / STEP else hertz
    assert verdict.mode.frequency_hz == pytest.approx(seen, rel=1e-6)
    assert ("alias" in verdict.sentence()) == (seen > 0.25 / STEP)
    assert verdict.sentence().startswith("UNSTABLE")


@pytest.mark.parametrize("rate", [0.02, 5.0, 800.0])
def test_growth_without_oscillation_is_found(rate):
    verdict = judge(model(crowd([[[rate]]]), STEP))
    assert verdict.stable is False
    assert verdict.largest_growth_rate == pytest.approx(rate, rel=1e-4)
    assert "no oscillation" in verdict.sentence()


def test_several_growing_modes_are_counted_and_the_fastest_is_named():
    verdict = judge(model(crowd([pair(0.3, 0.1), pair(40.0, 30.0), [[0.5]]]), STEP))
    assert verdict.growing == 3
    assert verdict.mode.frequency_hz == pytest.approx(40.0, rel=1e-6)
    assert "3 modes grow" in verdict.sentence()


def test_a_stable_system_is_said_to_be_stable():
    verdict = judge(model(crowd([]), STEP))
    assert verdict.stable is True
    assert verdict.largest_growth_rate == pytest.approx(-0.06 * 2 * np.pi * 0.02, rel=1e-3)
    assert verdict.zeros == 1


@pytest.mark.parametrize(("stable", "doubted"), [(True, None), (False, False), (None, None)])
def test_what_does_not_fit_its_binding_is_never_stable_and_growth_stays_growth(stable, doubted):
    found = replace(judge(model(crowd([]), STEP)), stable=stable, reason="first")
    assert found.doubted([]) is found
    again = found.doubted(["a does not fit its binding: wrong base"])
    assert (again.stable, again.verdict == "not known") == (doubted, doubted is None)
    assert again.reason == ("a does not fit its binding: wrong base" if stable else "first")


def test_a_search_finds_all_that_grows_in_a_system_too_large_for_its_spectrum(monkeypatch):
    monkeypatch.setattr(stability, "WHOLE", 100)
    planted = [pair(hertz, rate) for hertz, rate in PLANTED.items()]
    A = crowd([*planted, [[0.02]], [[5.0]], [[800.0]]])
    verdict = judge(model(A, STEP))
    assert verdict.stable is False
    assert verdict.growing == len(PLANTED) + 3
    assert verdict.largest_growth_rate == pytest.approx(800.0, rel=1e-4)
    assert "rad/s were not searched" in verdict.sentence()


@pytest.mark.slow
def test_a_search_finds_nothing_in_a_stable_system_and_says_what_it_did_not_look_at(monkeypatch):
    monkeypatch.setattr(stability, "WHOLE", 100)
    verdict = judge(model(crowd([]), STEP))
    assert verdict.stable is True
    assert "too large for all 181 eigenvalues" in verdict.sentence()
    assert "|λ| below 0.0063 rad/s and above 3.14e+04 rad/s were not searched" in verdict.sentence()


@pytest.mark.parametrize(("rate", "stable"), [(2e-6, False), (-2e-6, True)])
def test_either_side_of_the_threshold(rate, stable):
    assert judge(model(np.array(pair(1.0, rate)))).stable is stable


@pytest.mark.parametrize(("size_of_it", "zeros"), [(0.9e-3, 1), (1.1e-3, 0)])
def test_a_free_angle_is_no_growth(size_of_it, zeros):
    verdict = judge(model(np.diag([size_of_it, -1.0])))
    assert verdict.zeros == zeros
    assert verdict.stable is bool(zeros)


BETWEEN = np.array([[1.0, -1.0], [-1.0, 1.0]])
TWO_MACHINES = np.block([[np.zeros((2, 2)), np.eye(2)], [-9.0 * BETWEEN, -BETWEEN]])
"""Angles and speeds of two machines that hold each other, while nothing holds both."""


@pytest.mark.parametrize("step_size", [None, STEP])
def test_a_clock_is_no_second_zero_but_a_frequency_that_nothing_holds_is(step_size):
    clock_and_angle = scipy.linalg.block_diag([[0.0]], [[0.0, 0.3], [0.0, -1.0]])
    one = judge(model(clock_and_angle, step_size))
    assert one.zeros == 1
    assert one.sentence().count("one eigenvalue is zero, taken for that of the free angle") == 1
    assert judge(model(TWO_MACHINES, step_size)).zeros == 2
    assert "nothing restores" in judge(model(TWO_MACHINES, step_size)).sentence()


@pytest.mark.parametrize("step_size", [None, STEP])
def test_what_nothing_moves_is_named_and_can_be_left_out(step_size):
    """An integrator that is driven drifts; a controller that is off does not, whether or not others read it."""
    A = scipy.linalg.block_diag(
        [[0.0]], [[0.0, 0.3], [0.0, -1.0]], [[0.0]], [[0.0, 0.0], [0.2, -2.0]]
    )
    found = model(A, step_size)
    assert found.unmoved == tuple(found.names[k] for k in (0, 3, 4))
    assert found.coupled.names == tuple(found.names[k] for k in (1, 2, 5))
    np.testing.assert_array_equal(found.coupled.A, found.A[np.ix_([1, 2, 5], [1, 2, 5])])
    assert judge(found).zeros == judge(found.coupled).zeros == 1


def test_the_system_or_the_coupling_is_named():
    growing, damped = np.array(pair(1.0, 0.2)), np.array(pair(1.0, -0.2))
    assert judge(model(growing, STEP), system=model(growing)).cause is Cause.SYSTEM
    verdict = judge(model(growing, STEP), system=model(damped))
    assert verdict.cause is Cause.COUPLING
    assert "the coupling (without a communication step: -0.2 1/s)" in verdict.sentence()
    assert (
        judge(model(np.array(pair(1.0, 50.0)), STEP), system=model(growing)).cause is Cause.COUPLING
    )
    assert judge(model(growing, STEP)).cause is Cause.UNKNOWN


def test_what_the_step_hides_is_said():
    verdict = judge(model(np.array(pair(1.0, -0.01)), STEP), system=model(np.array(pair(1.0, 0.3))))
    assert verdict.stable is False
    assert verdict.largest_growth_rate == pytest.approx(0.3)
    assert "hides it: nothing grows in the step map, at most -0.01 1/s" in verdict.sentence()
    assert verdict.hidden_by_step == STEP


def test_modes_outside_a_range_are_counted_and_real_poles_are_none():
    values = np.linalg.eigvals(
        scipy.linalg.block_diag(pair(0.05, -0.1), pair(1.0, -0.1), pair(5.0, -0.2), [[-3.0]])
    )
    found = hidden(values, 0.1, 2.0)
    assert found.count == 2
    assert found.least_damped.imag == pytest.approx(2 * np.pi * 5.0)
    assert (
        "2 oscillatory modes lie outside 0.1 to 2 Hz; the least damped of them: 5 Hz, 0.64 %"
        in found.sentence()
    )


def test_a_double_real_pole_split_by_rounding_is_no_oscillation():
    assert oscillations(
        np.array([-9740 + 21.6j, -9740 - 21.6j, -3.0, 0.5, -10 + 1j, -10 - 1j])
    ).tolist() == [
        False,
        False,
        False,
        False,
        True,
        False,
    ]


def test_the_range_does_not_touch_the_verdict():
    A = crowd([pair(37.0, 104.0)])
    assert all(mode.damping_ratio > 0 for mode in find_modes(model(A, STEP), 0.1, 2.0))
    assert judge(model(A, STEP)).stable is False


def test_a_double_zero_that_the_perturbation_splits_is_no_growth():
    """Without governors nothing restores the frequency; the step map's own pair is an error divided by the step."""
    split, exact = np.diag([2.6e-3, -2.6e-3, -1.0, -1.0]), TWO_MACHINES
    verdict = judge(model(split, STEP), system=model(exact))
    assert verdict.stable is True
    assert verdict.zeros == 2
    assert "2 eigenvalues are zero" in verdict.sentence()
    assert judge(model(split, STEP)).stable is False  # nothing says that it is an error
    assert (
        judge(model(np.diag([0.06, -1.0, -1.0, -1.0]), STEP), system=model(exact)).stable is False
    )


@pytest.mark.parametrize(
    ("hertz", "rated", "is_said"),
    [(60.03, 60.0, True), (50.37, 50.0, True), (60.0, 50.0, False), (60.0, None, False)],
)
def test_what_swings_with_the_rated_frequency_is_called_no_swing_of_machines(hertz, rated, is_said):
    """Pages said "60 Hz, 0.00 %" in their first lines as if it were one."""
    mode = complex(-0.01, 2 * np.pi * hertz)
    said = Hidden((0.1, 2.0), 7, mode, rated_hz=rated).sentence()
    assert f"the least damped of them: {hertz:g} Hz, 0.00 %" in said
    assert ("direct currents of the network die away: no swing of machines" in said) == is_said
    swings = Hidden((0.1, 2.0), 7, mode, (mode,), rated_hz=rated)
    assert "direct currents" not in swings.sentence()


@pytest.mark.parametrize(
    ("real", "hertz", "rated", "is_said"),
    [(-0.01, 60.03, 60.0, True), (-0.01, 1.2, 60.0, False), (-0.01, 60.0, None, False)],
)
def test_a_verdict_says_what_dies_away_last_before_its_figures(real, hertz, rated, is_said):
    """A planner read "-0.0036 1/s (60 Hz; grid.load_31.i_im)" as a swing that is hardly damped."""
    mode = SimpleNamespace(
        eigenvalue=complex(real, 2 * np.pi * hertz), participation=(("grid.load_31.i_im", 0.49),)
    )
    said = Stability(True, mode, eigenvalues=621, rated_hz=rated).sentence()
    figures = f"the largest real part of all 621 eigenvalues is -0.01 1/s ({hertz:.4g} Hz; "
    words = "direct currents of the network die away last, no swing of machines: " * is_said
    assert said == f"stable: {words}{figures}grid.load_31.i_im 0.49)"


def test_electromechanical_modes_outside_of_the_range_are_named_with_a_range_that_shows_them():
    swings = (complex(-1.6, 2 * np.pi * 2.098), complex(-0.2, 2 * np.pi * 0.052))
    found = Hidden((0.1, 2.0), 7, complex(-1.0, 500.0), swings)
    assert found.sentence().endswith(
        "electromechanical: 2.098 Hz, 12.05 %; 0.052 Hz, 52.21 %: show them by --range 0.052:3"
    )
    assert [m["frequency_hz"] for m in found.as_json()["electromechanical"]] == pytest.approx(
        [2.098, 0.052]
    )
