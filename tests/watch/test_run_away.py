"""Speeds and voltages that run away without swinging, and what settles however slowly."""

import numpy as np
import pytest

from orchestrator.coupling.events import ParameterChange
from orchestrator.watch.watch import judged
from tests.watch.seen import seen_of, units

EVENT, STOP = 1.0, 20.0


def since(t, event=EVENT):
    return np.maximum(t - event, 0.0)


def found(speed=None, voltage=None, events=(), stop=STOP, event=EVENT, **others):
    """Of two units that turn together; ``others`` is the speed of the second, if it has another one."""
    speed = speed or (lambda t: 1.0 + 0 * t)
    signals = {"a.omega": speed, "b.omega": others.get("b", speed), "a.v_re": voltage or (lambda t: 1.0 + 0 * t)}
    signals |= {"a.v_im": lambda t: 0 * t, "a.delta": lambda t: 0 * t, "b.delta": lambda t: 0 * t}
    happened = [ParameterChange(event, "a", "S_n", 99.0), *events]
    return judged(seen_of(signals, stop), units(a=100, b=100), happened)


@pytest.mark.parametrize(
    "y",
    [
        lambda t: 1 - 0.02 * since(t),
        lambda t: 1 - 1e-4 * since(t),
        lambda t: 1 + 1e-4 * since(t),
        lambda t: 1 - 1e-4 * np.expm1(0.2 * since(t)),
        lambda t: 1 - 0.01 * since(t) + 0.003 * (t > EVENT) * np.exp(-since(t)) * np.sin(4 * since(t)),
        lambda t: 1 - 0.6 * (1 - np.exp(-since(t) / 60)),
    ],
    ids=["fast", "slow", "up", "grows", "with a swing", "towards 0.4"],
)
def test_a_drift_without_end_is_told_with_its_value_and_rate(y):
    (finding,) = found(y)
    assert (finding.kind, finding.variable, finding.time, finding.until) == ("run_away", "omega", EVENT, None)
    end = y(np.array([STOP - 1, STOP]))
    assert finding.figures["value"] == pytest.approx(end[1])
    assert finding.figures["rate"] == pytest.approx(end[1] - end[0], rel=0.2)
    assert finding.message.endswith("so does 1 more")


def test_a_speed_that_comes_to_rest_far_away_is_told():
    (finding,) = found(lambda t: 1 - 0.2 * (1 - np.exp(-since(t) / 0.5)))
    assert finding.time == pytest.approx(EVENT + 0.5 * np.log(2), abs=0.01)
    assert finding.figures["value"] == pytest.approx(0.8)
    assert "it leaves 0.9 to 1.1 of its start" in finding.message
    (finding,) = found(lambda t: 1 + 0.2 * (t > 5) * (t < 7))
    assert "is 1 pu at t = 20 s" in finding.message


@pytest.mark.parametrize("late", [15.0, 19.8])
def test_a_drift_before_a_late_event_is_told(late):
    trip = ParameterChange(late, "a", "S_n", 98.0)
    (finding,) = found(lambda t: 1 - 1e-3 * since(t), events=[trip])  # it changes nothing noticeable
    assert (finding.time, finding.until) == (EVENT, None)
    (finding,) = found(lambda t: np.where(t <= late, 1 - 1e-3 * since(t), 1.0), events=[trip])
    assert (finding.time, finding.until) == (EVENT, late)


def test_a_unit_that_left_the_grid_may_do_what_it_likes():
    trip = ParameterChange(EVENT, "b", "connected", value=False)
    assert found(b=lambda t: 1 + 0.05 * since(t), events=[trip]) == []


def governed(t, depth=0.01, rest=0.004, slow=10.0):
    """A nadir, and what the droop leaves in the end."""
    s = since(t)
    return 1 - rest * (1 - np.exp(-s / 2)) - depth * s / 3 * np.exp(-s / slow * 3)


@pytest.mark.parametrize(
    "y",
    [
        governed,
        lambda t: governed(t, 0.03, 0.01, 20.0),
        lambda t: 1 - 0.01 * (1 - np.exp(-since(t) / 8)),
        lambda t: 1 - 0.005 * (1 - np.exp(-since(t) / 15)),
        lambda t: 1 - 1e-5 * since(t),
        lambda t: 1 + 0.15 * (t > 5) * (t < 5.5),
        lambda t: 1 - 0.01 * (1 - np.exp(-since(t) / 4) * np.cos(0.3 * since(t))),
        lambda t: np.where(t < 8, 1 - 5e-3 * since(t), 1 - 0.035 * np.exp(-(t - 8) / 4)),
    ],
)
def test_what_a_control_brings_to_rest_is_silent(y):
    assert found(y) == []


def test_a_short_run_says_nothing_of_a_frequency_that_still_falls():
    assert found(lambda t: 1 - 2e-3 * since(t), stop=EVENT + 8) == []


def test_a_voltage_that_collapses_is_told():
    (finding,) = found(voltage=lambda t: 1 - 1e-3 * np.expm1(0.25 * since(t)))
    assert (finding.kind, finding.component, finding.variable) == ("run_away", "a", "v_re")
    assert "the voltage runs away from t = 1 s on: |a.v| is" in finding.message
    assert found(voltage=lambda t: 1 - 0.1 * (1 - np.exp(-since(t) / 5))) == []
