"""What the watch says of a signal without connection, and whole turns off the grid."""

from types import SimpleNamespace

import numpy as np
import pytest

from orchestrator.simulation.watch import watch
from orchestrator.simulation.watch.finding import Finding
from orchestrator.simulation.watch.seen import MOST_LOOKS, Seen, look_every
from orchestrator.simulation.watch.synchronism import _forget_turns_off_the_grid
from orchestrator.simulation.watch.undisturbed import Unrest
from orchestrator.simulation.watch.watch import _not_finite


def test_one_look_that_is_no_number_is_told_with_its_time():
    seen = Seen(0.5 * np.arange(4), {"a.b.x": np.array([0.0, 1.0, np.nan, 2.0])}, {}, {}, {}, {})
    (found,) = _not_finite(seen)
    assert (found.time, found.component, found.variable) == (1.0, "a", "b.x")
    assert "(nan) at t = 1 s, and so in 1 of 4 looks" in found.message


def test_turns_off_the_grid_are_taken_away_from_the_moment_of_its_return():
    angles = np.array([[0.0, 0.0, 0.1, 0.1, 0.1], [0.2, 7.0, 13.0, 13.0, 13.2]])
    on = np.array([[True] * 5, [True, False, False, True, True]])
    _forget_turns_off_the_grid(angles, on)
    assert angles[1] == pytest.approx([0.2, 7.0, 13.0, 13.0 - 4 * np.pi, 13.2 - 4 * np.pi])


class PartsError(Exception):
    """The stretches in which something that runs away is looked for."""


@pytest.mark.parametrize(
    ("events", "begins"), [([0.5], [0.0, 0.5]), ([0.0, 0.5], [0.0, 0.5]), ([], [0.0])]
)
def test_what_runs_away_is_looked_for_from_the_start_on(events, begins, monkeypatch):
    def stop(seen, system, settings, parts, **_):
        raise PartsError([part.begin for part in parts])

    for name in ("undisturbed_motion", "lost_synchronism", "above_declared", "active_limits"):
        monkeypatch.setattr(watch, name, lambda *_: ())
    monkeypatch.setattr(watch, "resting_signals", lambda *_: ())
    monkeypatch.setattr(
        watch, "stretches", lambda seen, names, times: [watch.Stretch(t, 2.0) for t in times]
    )
    monkeypatch.setattr(
        watch, "Settings", lambda *_: SimpleNamespace(effective_times=lambda: events)
    )
    monkeypatch.setattr(watch, "run_away", stop)
    with pytest.raises(PartsError) as found:
        watch.judge_run(SimpleNamespace(times=np.arange(3.0)), None, ())
    assert found.value.args == (begins,)


def test_a_long_run_is_not_looked_at_more_often_than_can_be_kept():
    assert look_every(1e-3, 1, 10.0) == 5
    assert look_every(1e-3, 4, 10.0) == 4
    assert look_every(1e-3, 1, 1e4) == 1e7 / MOST_LOOKS


@pytest.mark.parametrize(
    ("hertz", "explained"), [(1.0, True), (2.004, True), (1.5, False), (0.02, False), (0.4, False)]
)
def test_a_forcing_explains_its_frequency_and_multiples_alone(hertz, explained):
    swings = Finding(
        "sustained_oscillation", 0.0, "a", "x", "swings", None, {"frequency_hz": hertz}
    )
    assert Unrest(0.0, 9.0, "a.x", "forcing", 1.0).explains(swings) is explained
