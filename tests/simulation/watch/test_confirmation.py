"""Beats and harmonics of what decays, in responses of few periods, are no growth; growth is one."""

import numpy as np
import pytest

from orchestrator.simulation.watch.confirmation import Swing, doubt
from orchestrator.simulation.watch.oscillation import Oscillation, strongest_oscillation
from orchestrator.simulation.watch.seen import Seen
from orchestrator.simulation.watch.watch import judge_run
from orchestrator.systems.coupling.events import ParameterChange
from tests.simulation.watch.seen import seen_of, system

EVENT = 1.0


def found(course, lasts, event=EVENT):
    """``course`` of the time since the event."""
    y = lambda t: 0.9 + (t > event) * course(np.maximum(t - event, 0.0))  # noqa: E731
    return judge_run(
        seen_of({"a.y": y}, event + lasts),
        system("a"),
        [ParameterChange(event, "a", "offset", 1.0)],
    )


def beat(other, phases, size, square):
    """1 Hz and another frequency, both decaying, with the square of their sum, as a magnitude has it."""

    def course(t):
        one, two = (
            np.cos(2 * np.pi * f * t + p) for f, p in zip((1.0, other), phases, strict=True)
        )
        w = size * (np.exp(-0.2 * t) * one + np.exp(-0.5 * t) * two)
        return w + square * w * w

    return course


@pytest.mark.parametrize(
    "course",
    [
        beat(1.298, (3.1, 3.62), 0.048, 4.37),
        beat(1.566, (0.51, 0.3), 0.098, 5.77),
        beat(1.43, (4.67, 3.79), 0.053, 3.65),
    ],
)
def test_a_short_beat_is_not_judged(course):
    """The old rule called the first two growing and the last one sustained."""
    (finding,) = found(course, 2.5)
    assert (finding.kind, finding.component, finding.variable) == ("not_judged", "a", "y")
    assert "cannot tell that from a beat of oscillations that decay" in finding.message
    assert "let the run go on to t = " in finding.message


@pytest.mark.parametrize("seed", range(12))
def test_longer_beats_are_never_growth(seed):
    draw = np.random.default_rng(seed)
    course = beat(
        draw.uniform(1.15, 2.1),
        draw.uniform(0, 6.3, 2),
        draw.uniform(0.02, 0.1),
        draw.uniform(2, 6),
    )
    for lasts in (3.0, 4.0, 6.0):
        assert {f.kind for f in found(course, lasts)} <= {"not_judged"}


def test_the_remedy_of_the_remark_gives_an_answer():
    course = beat(1.298, (3.1, 3.62), 0.048, 4.37)
    (finding,) = found(course, 2.5)
    until = float(finding.message.rpartition("t = ")[2].removesuffix(" s"))
    assert found(course, until - EVENT) == []


@pytest.mark.parametrize(("periods", "kind"), [(4.0, "not_judged"), (6.0, "growing_oscillation")])
def test_a_growth_beside_a_decay_needs_its_periods(periods, kind):
    def course(t):
        decay = 0.03 * np.exp(-0.6 * t) * np.cos(2 * np.pi * 1.3 * t)
        return decay + 0.004 * np.exp(0.15 * t) * np.cos(2 * np.pi * 0.8 * t + 1)

    (finding,) = found(course, periods / 0.8)
    assert finding.kind == kind


def test_a_growth_that_goes_far_needs_no_periods():
    (finding,) = found(lambda t: 1e-3 * np.exp(1.6 * t) * np.sin(2 * np.pi * t), 3.5)
    assert finding.kind == "growing_oscillation"
    assert finding.figures["growth_rate"] == pytest.approx(1.6, rel=0.1)


@pytest.mark.parametrize(
    ("rate", "claimed", "why"),
    [
        (0.2, Oscillation(1.0, 0.2, 0.01), ""),
        (0.2, Oscillation(1.0, 0.09, 0.01), "over the whole response its rate is +0.2 1/s"),
        (0.2, Oscillation(1.0, 0.41, 0.01), "over the whole response its rate is +0.2 1/s"),
        (-0.2, Oscillation(1.0, 0.15, 0.01), "over the whole response its rate is -0.2 1/s"),
        (
            0.2,
            Oscillation(1.1, 0.2, 0.01),
            "the whole response does not show that oscillation as the strongest",
        ),
        (0.0, Oscillation(1.0, 0.0, 0.01), ""),
        (-0.2, Oscillation(1.0, 0.0, 0.01), "over the whole response it decays at -0.2 1/s"),
    ],
)
def test_what_the_end_shows_is_compared_with_the_whole_response(rate, claimed, why):
    t = np.arange(1601) * 5e-3
    y = 0.01 * np.exp(rate * t) * np.sin(2 * np.pi * t)
    late = t >= 2.0
    assert doubt(Swing("a.y", 0.01, 1.0, (t, y), t[late], y[late]), claimed) == why


def fast(rate, ripple=0.0, size=0.1):
    """50 Hz and a neighbour, too fast for the looks and decaying too slowly to be seen as a decay at once."""

    def course(t):
        beat = 1 + ripple * np.sin(2 * np.pi * 9 * t)
        return size * np.exp(rate * t) * beat * np.sin(2 * np.pi * 51.3 * t)

    return course


def seen_by_looks(course, lasts):
    """Without the extremes between the looks, as of a signal that is only recorded."""
    y = lambda t: 0.9 + (t > EVENT) * course(np.maximum(t - EVENT, 0.0))  # noqa: E731
    seen = seen_of({"a.y": y}, EVENT + lasts)
    only = Seen(seen.times, seen.values, {}, {}, {}, {})
    return judge_run(only, system("a"), [ParameterChange(EVENT, "a", "offset", 1.0)])


@pytest.mark.parametrize(("rate", "lasts"), [(-0.27, 4.0), (-0.1, 2.2), (-0.03, 8.0)])
@pytest.mark.parametrize("ripple", [0.0, 0.2])
def test_a_swing_at_no_single_frequency_that_decays_is_no_verdict(rate, lasts, ripple):
    """It was UNSTABLE by some lengths of the run, and absent by longer ones."""
    (finding,) = seen_by_looks(fast(rate, ripple), lasts)
    assert (finding.kind, finding.variable) == ("not_judged", "y")
    assert f"it decays at {finding_rate(finding):+.3g} 1/s, to the end" in finding.message
    assert finding_rate(finding) == pytest.approx(rate, rel=0.15)
    assert finding.message.endswith(f"let the run go on to t = {EVENT + 1.5 * lasts:.3g} s")


def finding_rate(finding):
    return float(finding.message.partition("decays at ")[2].partition(" ")[0])


@pytest.mark.parametrize("rate", [0.0, 0.05])
def test_a_swing_at_no_single_frequency_that_lasts_is_told(rate):
    (finding,) = seen_by_looks(fast(rate, 0.2), 4.0)
    assert (finding.kind, finding.figures.keys()) == ("sustained_oscillation", {"amplitude"})


@pytest.mark.parametrize("seed", range(6))
def test_chance_makes_no_decay_of_an_irregular_swing_that_lasts(seed):
    coarse = np.random.default_rng(seed).standard_normal(400)
    (finding,) = found(lambda t: 0.02 * np.interp(t, 0.05 * np.arange(400), coarse), 15.0)
    assert finding.kind == "sustained_oscillation"


@pytest.mark.parametrize(("lasts", "kinds"), [(40.0, {"sustained_oscillation"}), (6.0, set())])
def test_a_slow_irregular_swing_is_told_by_how_often_it_passes_its_middle(lasts, kinds):
    """About once in a second: often enough in 40 s, and not in 6 s."""
    coarse = np.random.default_rng(3).standard_normal(200)
    told = found(lambda t: 0.02 * np.interp(t, 0.5 * np.arange(200), coarse), lasts)
    assert {f.kind for f in told} & {"sustained_oscillation"} == kinds


@pytest.mark.parametrize(
    ("early", "late", "why"), [(-0.05, 0.25, "in one half of its end it decays"), (0.3, 0.1, "")]
)
def test_one_half_that_decays_is_enough_for_a_doubt(early, late, why):
    """The rate changes in the middle of the end; over the whole of it the strongest oscillation grows either way."""
    t = np.arange(0, 24, 5e-3)
    y = 0.01 * np.exp(np.where(t < 15, early, late) * (t - 15)) * np.sin(2 * np.pi * t)
    end = t >= 6
    seen = strongest_oscillation(t[end], y[end])
    assert seen.rate > 0
    assert doubt(Swing("a.y", 0.01, 1.0, (t, y), t[end], y[end]), seen) == why
