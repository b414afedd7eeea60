"""Margins of a feedback loop: textbook loops, several loops at once, and what is no loop at all."""

import math
from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg

from orchestrator.core.errors import AnalysisError
from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.studies.pod_design.margins import loop_margins


def model(A):
    return LinearModel.from_matrix(
        np.array(A, dtype=float), tuple(f"x{k}" for k in range(len(A))), None
    )


def margins(matrix, gain):
    return loop_margins(model(matrix(gain / 2)), model(matrix(gain)))


def motor(gain):
    """L(s) = K/(s(s + 1)) around an integrator and a lag."""
    return [[0, 1], [-gain, -1]]


def test_a_motors_position_loop():
    """Crossover ω² = (√5 − 1)/2, phase margin 90° − arctan ω; least distance to −1 from a fine Nyquist curve."""
    w = math.sqrt((math.sqrt(5) - 1) / 2)
    found = margins(motor, 1.0)
    assert found.phase_deg == pytest.approx(90 - math.degrees(math.atan(w)), abs=1e-6)
    assert found.phase_hz == pytest.approx(w / (2 * math.pi), rel=1e-8)
    assert found.delay == pytest.approx(math.radians(found.phase_deg) / w, rel=1e-8)
    curve = 1j * np.linspace(0.1, 10, 200_001)
    assert found.peak == pytest.approx((1 / abs(1 + 1 / (curve * (curve + 1)))).max(), rel=1e-4)


@pytest.mark.parametrize("change", [{"step_size": 0.01}, {"names": ("a", "b")}])
def test_models_that_are_not_continuous_or_of_other_states_are_refused(change):
    full = replace(model(motor(1.0)), **change)
    with pytest.raises(ValueError, match="two continuous models with the same states"):
        loop_margins(model(motor(0.5)), full)


def test_a_crossing_at_the_end_of_the_range_counts():
    """L = K/s crosses over at ω = K, with 90°; here between the last two frequencies that are looked at."""
    found = margins(lambda k: [[-k]], 2 * math.pi * 498)
    assert found.phase_deg == pytest.approx(90, abs=1e-6)
    assert found.phase_hz == pytest.approx(498, rel=1e-8)


def test_of_two_loops_the_worse_one_counts():
    both = margins(lambda k: scipy.linalg.block_diag(motor(k), motor(5 * k)), 1.0)
    worse = margins(motor, 5.0)
    assert both.phase_deg == pytest.approx(worse.phase_deg, rel=1e-6)
    assert both.delay == pytest.approx(worse.delay, rel=1e-6)


def test_a_loop_that_is_too_weak_to_turn_unstable():
    """L = 0.5/(s + 1): the gain around it is below 1 everywhere."""
    found = margins(lambda k: [[-1 - k]], 0.5)
    assert (found.phase_deg, found.delay) == (None, None)
    assert found.peak == pytest.approx(1.0, abs=1e-3)


def test_positive_feedback_has_a_margin_too():
    """ẋ = −2x + y, ẏ = −2y + Kx, stable up to K = 4, is a loop of L = −K/(s + 2)²: worst at the lowest frequency."""
    found = margins(lambda k: [[-2, 1], [k, -2]], 3.0)
    assert found.phase_deg is None
    assert found.peak_hz == pytest.approx(0.01)
    assert found.peak == pytest.approx(1 / abs(1 - 3 / (0.02j * math.pi + 2) ** 2), rel=1e-9)


def test_without_a_loop_or_without_stability_there_are_no_margins():
    with pytest.raises(AnalysisError, match="the gain changes nothing"):
        margins(lambda k: [[-1, 0], [0, -2]], 1.0)
    with pytest.raises(AnalysisError, match="unstable with this gain"):
        margins(lambda k: [[k - 1]], 3.0)
