"""P and Q that a recorder holds, told from a plant that rests and from a coarse resolution."""

import numpy as np
import pytest

from orchestrator.studies.validation.held_power import held_power

TIMES = np.arange(2000) * 0.005


def ring_down(noise=5e-4):
    random = np.random.default_rng(4)
    after = TIMES - 1
    swing = 0.1 * np.exp(-0.3 * after) * np.sin(3.7 * after) * (after > 0)
    return 0.78 + swing + noise * random.standard_normal(len(TIMES))


def stored_where_it_changed(values, band):
    last, stored = values[0], []
    for value in values:
        if abs(value - last) > band:
            last = value
        stored.append(last)
    return np.array(stored)


@pytest.mark.parametrize("samples", [12, 50])
def test_p_stored_every_so_often_is_held(samples):
    found = held_power(TIMES, np.repeat(ring_down()[::samples], samples))
    assert found.count == pytest.approx(len(TIMES) / samples, abs=2)
    assert [found.usual, found.longest] == pytest.approx(2 * [(samples - 1) * 0.005])


def test_p_stored_where_it_changed_is_held():
    found = held_power(TIMES, stored_where_it_changed(ring_down(), 0.01))
    assert found.count >= 10
    assert found.longest > found.usual


@pytest.mark.parametrize("resolution", [1e-3, 8e-3, 2e-2])
def test_a_coarse_resolution_holds_nothing(resolution):
    for noise in (0.0, 5e-4, 5e-3):
        values = np.round(ring_down(noise) / resolution) * resolution
        assert held_power(TIMES, values) is None


def test_a_plant_at_rest_is_not_held():
    """Between its setpoint's steps, of which there are few, and before and after a swing."""
    steps = 0.5 + 0.1 * np.floor(TIMES / 2.5)
    assert held_power(TIMES, steps) is None
    swing = np.where((TIMES > 1) & (TIMES < 4), ring_down(), 0.78)
    assert held_power(TIMES, swing) is None
    assert held_power(TIMES, ring_down()) is None


@pytest.mark.parametrize(("samples", "is_held"), [(15, True), (8, False)])
def test_a_hold_is_asked_about_from_the_delay_on_that_clocks_are(samples, is_held):
    """Samples 1 ms apart: a power is late by half a hold in the mean."""
    times = np.linspace(TIMES[0], TIMES[-1], 5 * len(TIMES))
    dense = np.interp(times, TIMES, ring_down())
    found = held_power(times, np.repeat(dense[::samples], samples)[: len(times)])
    assert (found is not None) is is_held
