"""Events in the middle and shortly before the end: a growth or a limit cycle before them is not forgotten."""

import numpy as np
import pytest

from orchestrator.simulation.watch.watch import judge_run
from orchestrator.systems.coupling.events import ParameterChange
from tests.simulation.watch.seen import seen_of, system

PI = np.pi
EVENT = 1.0


def swing(rate, hertz=0.6, size=1e-3, since=EVENT):
    def y(t):
        after = np.maximum(t - since, 0.0)
        return (t > since) * size * np.exp(rate * after) * np.sin(2 * PI * hertz * after)

    return y


def both(*signals):
    return lambda t: 0.9 + sum(y(t) for y in signals)


def step(size, since, settling=0.05):
    """What an event adds by itself."""
    return lambda t: size * (t > since) * (1 - np.exp(-np.maximum(t - since, 0.0) / settling))


def events(*times, values=None):
    """Each sets another offset; the first is what the response answers to."""
    offsets = values or range(1, len(times) + 1)
    return [
        ParameterChange(time, "a", "offset", float(offset))
        for time, offset in zip(times, offsets, strict=True)
    ]


def found(y, happened, stop=15.0):
    return judge_run(seen_of({"a.y": y}, stop), system("a"), happened)


GROWING = both(step(0.05, EVENT), swing(0.12))


@pytest.mark.parametrize("late", [8.0, 11.0, 14.0, 14.8, 14.99])
def test_an_event_that_changes_nothing_noticeable_does_not_part_a_growth(late):
    for values in (
        [1.0, 1.0],
        [1.0, 2.0],
    ):  # the same value once more; another one that does nothing
        (finding,) = found(GROWING, events(EVENT, late, values=values))
        assert (finding.kind, finding.time, finding.until) == ("growing_oscillation", EVENT, None)
        assert finding.figures["growth_rate"] == pytest.approx(0.12, rel=0.05)
        assert finding.figures["frequency_hz"] == pytest.approx(0.6, rel=0.01)
        assert finding.figures["amplitude"] == pytest.approx(1e-3 * np.exp(0.12 * 14), rel=0.05)


def test_many_events_that_change_nothing_noticeable():
    """No stretch is as long as three periods."""
    (finding,) = found(GROWING, events(EVENT, *np.arange(1.7, 15.0, 0.7)))
    assert (finding.kind, finding.time) == ("growing_oscillation", EVENT)
    assert finding.figures["growth_rate"] == pytest.approx(0.12, rel=0.05)


@pytest.mark.parametrize("late", [12.0, 14.8])
def test_a_growth_that_ends_with_an_event_is_told_with_its_end(late):
    def y(t):
        return np.where(t <= late, GROWING(t), 0.9 + 0.02 * np.exp(-2 * np.maximum(t - late, 0.0)))

    (finding,) = found(y, events(EVENT, late))
    assert (finding.kind, finding.time, finding.until) == ("growing_oscillation", EVENT, late)
    assert finding.figures["growth_rate"] == pytest.approx(0.12, rel=0.05)
    assert f"at the next event at t = {late:.4g} s its amplitude" in finding.message


def test_a_limit_cycle_before_a_late_event_is_told():
    y = both(step(0.05, EVENT), swing(0.0, 1.3, 0.02))
    (finding,) = found(lambda t: y(t) + 0.1 * (t > 14.8), events(EVENT, 14.8))
    assert (finding.kind, finding.until) == ("sustained_oscillation", 14.8)
    assert "to the next event at t = 14.8 s a.y swings at 1.3 Hz" in finding.message


def test_the_first_stretch_in_which_it_grows_is_told_and_that_it_grows_again():
    y = both(step(0.05, EVENT), swing(-0.5), step(0.03, 6.0), swing(0.3, since=6.0))
    (finding,) = found(y, events(EVENT, 6.0))
    assert (finding.kind, finding.time) == ("growing_oscillation", 6.0)
    again = both(step(0.05, EVENT), swing(0.3), step(0.1, 8.0), swing(0.3, since=8.0))
    (finding,) = found(lambda t: again(t) - swing(0.3)(t) * (t > 8), events(EVENT, 8.0))
    assert finding.time == EVENT
    assert finding.message.endswith("the same again from t = 8 s")


def test_a_change_without_a_kink_that_ends_the_decay_is_no_growth_from_the_first_event():
    """As a stabiliser that is switched off at rest: nothing kinks, and what follows is another response."""
    y = both(step(0.05, EVENT), swing(-0.8, size=5e-3), swing(0.25, since=7.0))
    (finding,) = found(y, events(EVENT, 7.0))
    assert (finding.kind, finding.time) == ("growing_oscillation", 7.0)
    assert finding.figures["growth_rate"] == pytest.approx(0.25, rel=0.1)


def test_decays_that_events_excite_anew_are_silent():
    y = both(
        step(0.05, 1.0),
        swing(-0.3),
        step(0.05, 6.0),
        swing(-0.3, since=6.0),
        swing(-0.3, size=2e-3, since=11.0),
    )
    assert found(y, events(1.0, 6.0, 11.0), stop=16.0) == []
    for size in (1e-3, 3e-4):  # too small to be noticed at once beside the first
        y = both(step(0.05, 1.0), swing(-0.2, size=0.01), swing(-0.2, size=size, since=8.0))
        assert found(y, events(1.0, 8.0), stop=16.0) == []


def test_an_event_that_sets_what_holds_does_not_end_the_undisturbed_state():
    (finding,) = found(
        lambda t: 0.7 + 1e-9 * np.exp(9 * np.minimum(t, 1.5)), events(0.1, values=[0.0]), stop=1.5
    )
    assert finding.kind == "growth"
    assert finding.figures["growth_rate"] == pytest.approx(9.0, rel=0.05)


def test_a_limit_cycle_from_the_start_is_told_though_an_event_follows():
    def y(t):
        return 0.9 + 0.01 * np.sin(2 * PI * t)

    kinds = [finding.kind for finding in found(y, events(14.8))]
    assert kinds == ["undisturbed_motion", "sustained_oscillation"]
