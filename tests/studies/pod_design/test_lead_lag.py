"""The design's equations against what they promise, and a mode followed through a known system."""

import cmath
import itertools
import math

import numpy as np
import pytest

from orchestrator.core.errors import AnalysisError
from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.linear.spectra.continuation import follow_along, pair_at, pairs_near
from orchestrator.linear.spectra.modes import damping_ratio
from orchestrator.studies.pod_design.lead_lag import (
    LeadLag,
    angle_deg,
    bounded,
    compensation_deg,
    lead_lag,
    local_non_compensated,
    predicted_mode,
    required_gain,
    sensitivity,
)

PHASES = [-179.9, -90.0, -1e-3, 0.0, 1e-3, 1.0, 90.0, 179.9, 180.0]
PHASES += np.random.default_rng(1).uniform(-179.9, 180.0, 40).tolist()
"""Of a sensitivity [degrees]: ends, places where a sign changes, and draws between them."""

CENTRES = [0.5, 3.655, 12.0]  # of lead/lag stages [rad/s]


@pytest.mark.parametrize("stages", [1, 2, 3])
def test_the_lead_lag_turns_the_sensitivity_to_180_degrees(stages):
    possible = [phase for phase in PHASES if abs(compensation_deg(phase)) / stages < 89]
    assert len(possible) > 20
    for phase, centre in itertools.product(possible, CENTRES):
        filters = lead_lag(phase, centre, stages)
        turned = cmath.rect(1.0, math.radians(phase)) * filters.response(1j * centre)
        assert abs(abs(angle_deg(turned)) - 180) < 1e-6, (phase, centre)


@pytest.mark.parametrize("centre", CENTRES)
def test_the_lead_lag_is_centred_and_leads_for_positive_angles(centre):
    for phase in PHASES:
        filters = lead_lag(phase, centre, 3)
        assert 1 / math.sqrt(filters.T_S1 * filters.T_S2) == pytest.approx(centre)
        assert (filters.T_S1 > filters.T_S2) == (0 <= phase < 180), phase
        assert filters.filtering_ratio == pytest.approx(filters.T_S2 / filters.T_S1)
        assert abs(filters.stage_angle_deg) * 3 == pytest.approx(
            abs(compensation_deg(phase)), abs=1e-6
        )


def test_the_papers_table_from_its_sensitivities():
    """Sensitivities of the two-area system at ΔK = 50, as computed here, give the paper's lead/lag (its POD table)."""
    for phase, (T_S1, T_S2) in {-145.8: (0.20, 0.37), -175.2: (0.26, 0.29)}.items():
        filters = lead_lag(phase, 3.655, 2)
        assert (round(filters.T_S1, 2), round(filters.T_S2, 2)) == (T_S1, T_S2)


def test_a_sensitivity_that_already_points_left_needs_no_compensation():
    assert lead_lag(180.0, 2.0, 2).filtering_ratio == pytest.approx(1.0)
    assert lead_lag(-90.0, 2.0, 0) == LeadLag(0.0, 0.0, 0)


def test_too_few_stages_are_refused_with_the_number_that_would_do():
    with pytest.raises(
        AnalysisError,
        match=r"each of 1 lead/lag stages .* by 110.0°.*ask for 2 stages with --stages",
    ):
        lead_lag(70.0, 3.0, 1)


@pytest.mark.parametrize(
    ("value", "degrees"), [(-1 + 0j, 180), (complex(-1, -0.0), 180), (1j, 90), (-1j, -90)]
)
def test_angles_lie_above_minus_180(value, degrees):
    assert angle_deg(value) == pytest.approx(degrees)


def test_gain_and_prediction():
    initial, S = complex(-0.4, 3.0), complex(-0.01, 0.0)
    target = predicted_mode(0.2, initial)
    assert target == pytest.approx(complex(-0.6, 3.0))
    assert required_gain(target, initial, abs(S)) == pytest.approx(20.0)
    assert initial + 20 * S == pytest.approx(target)
    assert [bounded(k, (200, 400)) for k in (18.7, 300, 500)] == [200, 300, 400]
    assert damping_ratio(complex(-0.6, 0.8)) == pytest.approx(0.6)
    assert damping_ratio(0j) == 0


def test_a_mode_that_does_not_move_cannot_be_designed_for():
    assert sensitivity(-1 + 3j, -0.5 + 3j, 50) == pytest.approx(-0.01)
    with pytest.raises(AnalysisError, match="no sensitivity to design with"):
        sensitivity(-0.5 + 3j, -0.5 + 3j, 50)


def test_the_compensation_is_taken_out_of_a_sensitivity():
    filters, mode = LeadLag(0.2, 0.4, 2), complex(-0.3, 3.0)
    bare = complex(-0.01, 0.004)
    assert local_non_compensated(bare * filters.response(mode), mode, filters) == pytest.approx(
        bare
    )


# -- following -------------------------------------------------------------------------------------


def crossing(p):
    """Two oscillations that pass through each other's frequency, in coordinates that hide them; p from −1 to 1."""
    T = np.array([[1.0, 0.3, 0, 0.2], [0, 2.0, 0.1, 0], [0.4, 0, 1.0, 0], [0, 0.1, 0, 50.0]])
    A = np.zeros((4, 4))
    for k, value in enumerate((complex(-0.5, 3 + p), complex(-0.2, 3 - p))):
        A[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = [
            [value.real, value.imag],
            [-value.imag, value.real],
        ]
    return LinearModel.from_matrix(T @ A @ np.linalg.inv(T), tuple("abcd"), None)


def test_a_mode_is_followed_through_the_frequency_of_another():
    start = pair_at(crossing(-1.0), complex(-0.5, 2.0))
    end = follow_along(start, crossing, -1.0, 1.0)
    assert end.eigenvalue == pytest.approx(complex(-0.5, 4.0))


def test_modes_of_one_matrix_are_not_associated():
    pairs = [p for p in pairs_near(crossing(0.3), 3j) if p.eigenvalue.imag > 0]
    table = np.array([[a.similarity(b) for b in pairs] for a in pairs])
    assert table == pytest.approx(np.eye(2), abs=1e-10)


def test_a_defective_mode_is_like_no_other():
    """Equal stages side by side have one eigenvector between them."""
    A = np.array([[-1.0, 1.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -5.0]])
    pairs = pairs_near(LinearModel.from_matrix(A, tuple("abc"), None), -1 + 0j)
    assert all(np.isfinite(a.similarity(b)) for a in pairs for b in pairs)


def test_a_mode_that_meets_another_is_not_guessed():
    """ẍ + 2p·ẋ + x = 0: at p = 1 the oscillation ends in a double real eigenvalue."""

    def damped(p):
        return LinearModel.from_matrix(np.array([[0.0, 1.0], [-1.0, -2 * p]]), ("x", "v"), None)

    start = pair_at(damped(0.1), 1j)
    assert follow_along(start, damped, 0.1, 0.9).eigenvalue == pytest.approx(
        complex(-0.9, math.sqrt(1 - 0.81))
    )
    with pytest.raises(
        AnalysisError, match=r"cannot be followed beyond .* merges with another mode"
    ):
        follow_along(start, damped, 0.1, 1.0)
