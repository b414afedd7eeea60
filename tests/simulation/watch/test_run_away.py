"""Speeds and voltages that run away without swinging, and what settles however slowly."""

from types import SimpleNamespace

import numpy as np
import pytest

from orchestrator.simulation.watch import run_away, watch
from orchestrator.simulation.watch.finding import Finding
from orchestrator.simulation.watch.run_away import still_moving_away
from orchestrator.simulation.watch.settings import Settings
from orchestrator.simulation.watch.stretches import Stretch
from orchestrator.simulation.watch.watch import judge_run
from orchestrator.systems.coupling.events import ParameterChange
from tests.simulation.watch.seen import seen_of, units

EVENT, STOP = 1.0, 20.0


def since(t, event=EVENT):
    return np.maximum(t - event, 0.0)


def found(speed=None, voltage=None, events=(), stop=STOP, event=EVENT, **others):
    """Of two units that turn together; ``others`` is the speed of the second, if it has another one."""
    speed = speed or (lambda t: 1.0 + 0 * t)
    signals = {
        "a.omega": speed,
        "b.omega": others.get("b", speed),
        "a.v_re": voltage or (lambda t: 1.0 + 0 * t),
    }
    signals |= {"a.v_im": lambda t: 0 * t, "a.delta": lambda t: 0 * t, "b.delta": lambda t: 0 * t}
    happened = [ParameterChange(event, "a", "S_n", 99.0), *events]
    return judge_run(seen_of(signals, stop), units(a=100, b=100), happened)


@pytest.mark.parametrize(
    "y",
    [
        lambda t: 1 - 0.02 * since(t),
        lambda t: 1 - 1e-4 * since(t),
        lambda t: 1 + 1e-4 * since(t),
        lambda t: 1 - 1e-4 * np.expm1(0.2 * since(t)),
        lambda t: (
            1 - 0.01 * since(t) + 0.003 * (t > EVENT) * np.exp(-since(t)) * np.sin(4 * since(t))
        ),
        lambda t: 1 - 0.6 * (1 - np.exp(-since(t) / 60)),
    ],
    ids=["fast", "slow", "up", "grows", "with a swing", "towards 0.4"],
)
def test_a_drift_without_end_is_told_with_its_value_and_rate(y):
    (finding,) = found(y)
    assert (finding.kind, finding.variable, finding.time, finding.until) == (
        "run_away",
        "omega",
        EVENT,
        None,
    )
    end = y(np.array([STOP - 1, STOP]))
    assert finding.figures["value"] == pytest.approx(end[1])
    assert finding.figures["rate"] == pytest.approx(end[1] - end[0], rel=0.2)
    assert finding.message.endswith("so does 1 more")


def test_a_speed_that_comes_to_rest_far_away_is_told():
    (finding,) = found(lambda t: 1 - 0.2 * (1 - np.exp(-since(t) / 0.5)))
    assert finding.time == pytest.approx(EVENT + 0.5 * np.log(4 / 3), abs=0.01)
    assert finding.figures["value"] == pytest.approx(0.8)
    assert "it leaves 0.95 to 1.03 pu" in finding.message


def hump(t, begin, end, depth):
    """A speed that goes away and comes back, as half of a sine, and is 1 pu before and behind."""
    return 1 - depth * np.sin(np.pi * (np.clip(t, begin, end) - begin) / (end - begin))


def test_a_speed_that_comes_back_had_an_excursion_and_does_not_run_away():
    """0.902 pu and back at rest with 5e-8 pu/s was called unstable."""
    (finding,) = found(lambda t: hump(t, 1.0, 7.0, 0.098))
    assert (finding.kind, finding.variable) == ("excursion", "omega")
    crosses = 6.0 / np.pi * np.arcsin(0.05 / 0.098)
    assert finding.time == pytest.approx(1.0 + crosses, abs=0.01)
    assert finding.until == pytest.approx(7.0 - crosses, abs=0.01)
    assert finding.figures["value"] == pytest.approx(0.902, abs=1e-4)
    assert finding.figures["outside_s"] == pytest.approx(6.0 - 2 * crosses, abs=0.02)
    assert "as does 1 more" in finding.message
    assert finding.message.endswith("it is 1 pu at t = 20 s")


def test_a_speed_that_has_just_come_back_is_not_judged_and_one_that_goes_again_runs_away():
    (finding,) = found(lambda t: hump(t, 1.0, 7.0, 0.098), stop=6.5)
    assert finding.kind == "not_judged"
    assert "whether the frequency settles is not judged" in finding.message
    assert "is back from t =" in finding.message
    again = lambda t: hump(t, 1.0, 5.0, 0.098) - 0.05 * np.maximum(t - 7.0, 0)  # noqa: E731
    assert [f.kind for f in found(again, stop=8.5)] == ["run_away"]
    once_more = lambda t: hump(t, 1.0, 5.0, 0.098) - 0.04 * np.maximum(t - 7.0, 0)  # noqa: E731
    (finding,) = found(once_more, stop=8.0)
    assert finding.kind == "not_judged"
    assert "is 0.96 pu at t = 8 s and moves away again; let the run go on" in finding.message


@pytest.mark.parametrize(("trips_at", "kind"), [(4.0, "run_away"), (8.0, "excursion")])
def test_a_unit_that_left_the_grid_far_off_did_not_come_back(trips_at, kind):
    trip = ParameterChange(trips_at, "b", "connected", value=False)
    (finding,) = found(lambda t: 1 + 0 * t, b=lambda t: hump(t, 1.0, 7.0, 0.098), events=[trip])
    assert (finding.kind, finding.component) == (kind, "b")


def test_a_machine_that_runs_away_is_told_and_not_those_that_come_back():
    falls = lambda t: 1 + 0.05 * since(t)  # noqa: E731
    kinds = [f.kind for f in found(lambda t: hump(t, 1.0, 7.0, 0.098), b=falls, stop=8.0)]
    assert "excursion" not in kinds
    assert set(kinds) & {"run_away", "loss_of_synchronism"}


@pytest.mark.parametrize("late", [15.0, 19.8])
def test_a_drift_before_a_late_event_is_told(late):
    trip = ParameterChange(late, "a", "S_n", 98.0)
    # it changes nothing noticeable
    (finding,) = found(lambda t: 1 - 1e-3 * since(t), events=[trip])
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


@pytest.mark.parametrize("lasts", [1.5, 4.0, 8.0])
def test_a_frequency_that_still_falls_at_the_end_of_a_short_run_is_not_judged(lasts):
    (finding,) = found(lambda t: 1 - 4e-3 * since(t), stop=EVENT + lasts)
    assert (finding.kind, finding.variable, finding.until) == ("not_judged", "omega", None)
    assert "the mean of all speeds is" in finding.message
    assert finding.message.endswith("let the run go on to t = 11 s")
    assert finding.figures == {
        "value": pytest.approx(1 - 4e-3 * lasts),
        "rate": pytest.approx(-4e-3),
    }


def slowing(rest, time_constant):
    """An exponential way from 1 to a rest, without a sign of rest in a short run."""
    return lambda t: 1 + (rest - 1) * -np.expm1(-since(t) / time_constant)


@pytest.mark.parametrize("lasts", [1.5, 3.0, 5.0, 7.0, 8.0])
def test_a_longer_run_does_not_call_a_frequency_stable_that_slows_down_a_little(lasts):
    """A machine without a reserve at whose end the frequency leaves the band: 0.966 pu was called stable."""
    (finding,) = found(slowing(0.925, 8.0), stop=EVENT + lasts)
    assert (finding.kind, finding.variable) == ("not_judged", "omega")
    assert "slowing down as if to come to rest at 0.925 pu" in finding.message or lasts < 4
    assert found(slowing(0.925, 8.0), stop=STOP)[0].kind == "run_away"


@pytest.mark.parametrize(
    ("rest", "kinds"), [(0.945, ["not_judged"]), (0.955, []), (1.025, []), (1.033, ["not_judged"])]
)
def test_where_a_frequency_would_come_to_rest_is_compared_with_the_band_in_a_long_run(rest, kinds):
    """Ended before it leaves the band, after more than `LONG`."""
    stop = EVENT + 11.0
    assert [f.kind for f in found(slowing(rest, 5.0), stop=stop)] == kinds


def test_a_frequency_whose_rest_is_farther_off_than_its_way_is_not_judged():
    assert [f.kind for f in found(slowing(0.96, 5.0), stop=EVENT + 3)] == ["not_judged"]
    assert found(slowing(0.96, 5.0), stop=EVENT + 9) == []


@pytest.mark.parametrize(
    ("acts", "until", "share", "told"),
    [
        ("governor.valve", None, 100, True),
        ("governor.valve", 5.0, 100, False),
        ("exciter.amplifier", None, 100, False),
        ("governor.valve", None, 20, False),
    ],
)
def test_a_governor_at_its_limit_leaves_nothing_that_stops_a_frequency(acts, until, share, told):
    """It slows down towards 0.98 pu, within the band, by the loads alone."""
    y = slowing(0.98, 3.0)
    seen = seen_of({"a.omega": y, "b.omega": y}, 8.0)
    system = units(a=share, b=50)
    settings = Settings(system, [], seen.times)
    limits = [Finding("active_limit", 2.0, "a", acts, "", until)]
    remarks = still_moving_away(seen, system, settings, Stretch(EVENT, 8.0, last=True), limits)
    assert ["with a at the limit of the governor" in f.message for f in remarks] == [True] * told


def test_swings_of_units_against_each_other_hide_no_falling_frequency():
    swing = lambda t: 0.01 * np.sin(6 * since(t)) * np.exp(-0.1 * since(t))  # noqa: E731
    falling = lambda t: 1 - 2e-3 * since(t)  # noqa: E731
    found_here = found(
        lambda t: falling(t) + swing(t), b=lambda t: falling(t) - swing(t), stop=EVENT + 8
    )
    assert [f.kind for f in found_here] == ["not_judged"]
    assert "whether the frequency settles" in found_here[0].message


@pytest.mark.parametrize(
    "y",
    [
        lambda t: 1 - 0.015 * -np.expm1(-since(t) / 2),
        lambda t: 1 - 4e-4 * since(t),
        lambda t: 1 - 0.012 * since(t) * np.exp(-since(t) / 3),
    ],
    ids=["slows down", "within 200 mHz", "comes back"],
)
@pytest.mark.parametrize("lasts", [4.0, 8.0])
def test_a_frequency_that_settles_is_silent_in_a_short_run(y, lasts):
    assert found(y, stop=EVENT + lasts) == []


def test_a_frequency_below_what_grid_codes_allow_is_told_in_a_short_run():
    """0.907 pu and falling, two seconds after the event: this was called stable."""
    (finding,) = found(lambda t: 1 - 0.0465 * since(t), stop=EVENT + 2)
    assert (finding.kind, finding.variable) == ("run_away", "omega")
    assert finding.time == pytest.approx(EVENT + 0.05 / 0.0465, abs=0.01)
    assert finding.figures["value"] == pytest.approx(0.907)
    assert "it leaves 0.95 to 1.03 pu" in finding.message


@pytest.mark.parametrize(
    ("level", "told"), [(0.945, True), (0.955, False), (1.025, False), (1.035, True)]
)
def test_the_band_of_grid_codes_on_both_sides(level, told):
    kinds = [
        f.kind for f in found(lambda t: 1 + (level - 1) * -np.expm1(-since(t) / 0.5), stop=9.0)
    ]
    assert kinds == (["run_away"] if told else [])


def test_a_short_excursion_of_a_rotor_is_silent():
    assert found(lambda t: 1 + 0.04 * (t > EVENT) * np.exp(-since(t) / 0.8), stop=9.0) == []


def test_a_voltage_that_collapses_is_told():
    (finding,) = found(voltage=lambda t: 1 - 1e-3 * np.expm1(0.25 * since(t)))
    assert (finding.kind, finding.component, finding.variable) == ("run_away", "a", "v_re")
    assert "the voltage runs away from t = 1 s on: |a.v| is" in finding.message
    assert found(voltage=lambda t: 1 - 0.1 * (1 - np.exp(-since(t) / 5))) == []


def test_a_short_end_of_a_long_run_is_not_judged(monkeypatch):
    monkeypatch.setattr(run_away, "_speeds", lambda *_: iter([None]))
    assert still_moving_away(None, None, None, Stretch(19.9, 20.0)) == []


class PartsError(Exception):
    """The stretches in which something that runs away is looked for."""


@pytest.mark.parametrize(
    ("events", "begins"), [([0.5], [0.0, 0.5]), ([0.0, 0.5], [0.0, 0.5]), ([], [0.0])]
)
def test_what_runs_away_is_looked_for_from_the_start_on(events, begins, monkeypatch):
    def stop(seen, system, settings, parts, **_):
        raise PartsError([part.begin for part in parts])

    for name in (
        "undisturbed_motion",
        "lost_synchronism",
        "above_declared",
        "active_limits",
        "own_trips",
        "stalls",
        "interruptions",
    ):
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
