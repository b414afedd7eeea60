"""A model near its limit of the current is held in step with the plant, so that its causes are told apart."""

import numpy as np
import pytest

from orchestrator.studies.validation.causes import capped
from orchestrator.studies.validation.held_in_step import hold_in_step

STEP = 5e-4
SECONDS = 4.0
UNSTABLE = 3.0  # rate at which the device's angle runs away [1/s]


def run_away(off):
    """A current of fixed size whose angle runs away from the voltage's, beginning so far off [rad]."""
    angle = off

    def drive(voltage, late):
        nonlocal angle
        found = []
        for one in late:
            angle += STEP * UNSTABLE * (angle - np.angle(one))
            found.append(np.exp(1j * angle))
        return np.array(found)

    return drive


def held(off, **more):
    voltage = np.ones(round(SECONDS / STEP), complex)
    return hold_in_step(run_away(off), (voltage, voltage), np.ones(len(voltage), complex), STEP)


def test_an_angle_that_runs_away_faster_than_it_is_followed_is_lost_and_a_slower_one_is_kept(
    monkeypatch,
):
    """By hand: the difference grows at the device's rate less the gain."""
    module = "orchestrator.studies.validation.held_in_step._GAIN"
    for gain in (2.0, 5.0):
        monkeypatch.setattr(module, gain)
        current = held(1e-4).current
        early, late = (abs(np.angle(current[round(t / STEP)])) for t in (0.5, 1.5))
        assert np.log(late / early) == pytest.approx(UNSTABLE - gain, abs=0.1)


def test_a_device_that_feeds_the_measured_current_turns_nothing():
    run = held(0.0)
    assert not run.turn.any()
    assert run.current == pytest.approx(1.0)


def test_what_gives_way_is_counted_as_power(monkeypatch):
    """A device at a quarter of a turn pulls the voltage at the gain's speed; of a ramp a second's part counts."""
    count = round(SECONDS / STEP)
    ones = np.ones(count, complex)

    def ahead(voltage, late):
        return 1j * late

    run = hold_in_step(ahead, (ones, ones), ones, STEP)
    assert run.turn[-1] > 0.5
    behind = hold_in_step(lambda v, late: -1j * late, (ones, ones), ones, STEP)
    assert behind.turn == pytest.approx(-run.turn)


def test_a_limit_of_the_current_is_not_told_the_measured_angle():
    own, voltage = np.array([0.5, 2.0, 2j]), np.ones(3)
    (found,) = capped([own], [voltage], 1.0)
    assert found == pytest.approx([0.5, 1.0, 1j])
