"""Samples that a recorder filled with the last value, told from a simulation that rests."""

import numpy as np
import pytest

from orchestrator.studies.validation.filled import filled_samples

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
