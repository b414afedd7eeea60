"""Samples that a recorder filled with the last value, told from a simulation that rests."""

import numpy as np
import pytest
import xarray as xr

from orchestrator.studies.validation.clipped import clipped_run
from orchestrator.studies.validation.filled import filled_samples, held_alone
from orchestrator.studies.validation.questions import QuestionKind
from orchestrator.studies.validation.record import PortBases, read_recording
from orchestrator.studies.validation.words import sentence

TIMES = np.arange(600) * 0.01


def after_a_fault(scatter):
    """A magnitude [pu] that rests until 1 s, with what moves it before, and swings after it."""
    random = np.random.default_rng(3)
    swing = 0.1 * np.sin(9.0 * (TIMES - 1.0)) * (TIMES > 1.0)
    return 0.98 + scatter * random.standard_normal(len(TIMES)) + swing


@pytest.mark.parametrize("scatter", [0.0, 1e-16, 3e-15])
def test_a_simulation_at_rest_was_not_filled(scatter):
    magnitude = after_a_fault(scatter)
    magnitude[72:101] = magnitude[72]  # rest to the last bit
    assert not filled_samples([magnitude, 0.5 * magnitude]).any()


@pytest.mark.parametrize("scatter", [1e-6, 1e-3])
def test_a_gap_of_a_recorder_that_moves_was_filled(scatter):
    magnitude = after_a_fault(scatter)
    magnitude[72:101] = magnitude[72]
    assert np.flatnonzero(filled_samples([magnitude, 0.5 * magnitude])).tolist() == [
        *range(73, 101)
    ]


EVERY = 20  # ms: of a PMU that sends 50 phasors a second
PMU_TIMES = np.arange(0.0, 6.0, EVERY / 1000)


def swing(scatter=4e-4):
    """P [pu] that rests until 1 s and swings then."""
    since = np.maximum(PMU_TIMES - 1.0, 0.0)
    random = np.random.default_rng(5)
    ringing = 0.1 * np.exp(-0.3 * since) * np.sin(4.0 * since)
    return 0.9 + ringing + scatter * random.standard_normal(len(PMU_TIMES))


@pytest.mark.parametrize("at", ["event", "slope", "peak"])
def test_p_that_is_held_alone_was_filled(at):
    p = swing()
    first = {"event": 51, "slope": 55, "peak": int(p.argmax()) + 1}[at]
    p[first : first + 15] = p[first - 1]
    assert np.flatnonzero(held_alone(p)).tolist() == [*range(first, first + 15)]


@pytest.mark.parametrize("scatter", [0.0, 4e-4])
def test_p_at_the_end_of_the_range_was_not_filled(scatter):
    for sign in (1, -1):
        p = sign * np.minimum(swing(scatter), 0.97)
        assert len(p[p == sign * 0.97]) > 5
        assert not held_alone(p).any()
        assert scatter == 0 or clipped_run(p) is not None


@pytest.mark.parametrize("resolution", [1e-3, 5e-3, 2e-2])
def test_a_quiet_and_coarse_p_was_not_filled(resolution):
    for scatter in (0.0, 1e-4, 2e-3):
        assert not held_alone(np.round(swing(scatter) / resolution) * resolution).any()


def test_a_recording_says_whose_samples_are_held_and_does_not_compare_them():
    p = swing()
    p[60:75] = p[59]
    random = np.random.default_rng(6)
    columns = {
        "v_pu": (1.0 - 0.02 * (PMU_TIMES > 1) + 1e-4 * random.standard_normal(len(p)), "pu"),
        "angle_deg": (0.01 * random.standard_normal(len(p)), "deg"),
        "p_mw": (100 * p, "MW"),
        "q_mvar": (0.1 * random.standard_normal(len(p)), "Mvar"),
    }
    named = {name: ("time", values, {"units": unit}) for name, (values, unit) in columns.items()}
    dataset = xr.Dataset(named, {"time": PMU_TIMES})
    found = read_recording(dataset, "rec", PortBases(rating=100.0, rated_hz=50.0))
    assert np.flatnonzero(~found.good).tolist() == [*range(60, 75)]
    assert found.driven.all()
    asked = {one.kind: one for one in found.questions}
    assert asked.keys() == {QuestionKind.FILLED, QuestionKind.UNMEASURED}
    assert asked[QuestionKind.FILLED].figures["columns"] == ["p_mw"]
    assert asked[QuestionKind.UNMEASURED].keeps_open
    assert "15 samples of 'p_mw' stand still" in sentence(asked[QuestionKind.FILLED])
