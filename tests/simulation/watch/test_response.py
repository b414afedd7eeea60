"""The end of a response: growing, sustained, irregular, and all that decays however slowly."""

import numpy as np
import pytest

from orchestrator.simulation.watch.confirmation import KnownModes
from orchestrator.simulation.watch.response import unsettled_response
from orchestrator.simulation.watch.seen import MOST_LOOKS, Seen, look_every
from orchestrator.simulation.watch.stretches import Stretch
from orchestrator.simulation.watch.watch import _not_finite
from tests.simulation.watch.seen import seen_of, system

PI = np.pi
EVENT, STOP = 1.0, 21.0


def response(rate, hertz, size=0.02, settling=0.05):
    """A swing on top of a step that settles with 2 s, from the event on."""

    def y(t):
        since = np.maximum(t - EVENT, 0.0)
        return 0.9 + (t > EVENT) * (
            settling * (1 - np.exp(-since / 2))
            + size * np.exp(rate * since) * np.sin(2 * PI * hertz * since)
        )

    return y


def found(stop=STOP, **signals):
    named = {f"{name}.y": y for name, y in signals.items()}
    return unsettled_response(
        seen_of(named, stop),
        system(*signals),
        Stretch(EVENT, stop, last=True),
        ("a",),
        KnownModes(),
    )


@pytest.mark.parametrize("hertz", [0.3, 1.1, 37.3, 60.0, 200.0, 433.0])
@pytest.mark.parametrize("rate", [0.05, 0.2])
def test_growth(rate, hertz):
    """200 Hz is the looks' own frequency: only what happens between them shows it."""
    (finding,) = found(a=response(rate, hertz, 1e-3))
    assert finding.kind == "growing_oscillation"
    assert (finding.component, finding.time) == ("a", EVENT)
    assert finding.figures["growth_rate"] == pytest.approx(rate, rel=0.1)
    assert finding.figures["frequency_hz"] == pytest.approx(hertz, rel=0.02)
    assert finding.figures["amplitude"] == pytest.approx(
        1e-3 * np.exp(rate * (STOP - EVENT)), rel=0.2
    )


@pytest.mark.parametrize("hertz", [0.3, 1.1, 37.3, 60.0, 200.0, 433.0])
def test_a_constant_amplitude_is_told_from_a_slow_decay(hertz):
    (finding,) = found(a=response(0.0, hertz))
    assert finding.kind == "sustained_oscillation"
    assert finding.figures["frequency_hz"] == pytest.approx(hertz, rel=0.02)
    assert finding.figures["amplitude"] == pytest.approx(0.02, rel=0.15)
    for rate in (-0.02, -0.05, -0.3, -2.0):
        assert found(a=response(rate, hertz)) == []


@pytest.mark.parametrize("rate", [0.0, 0.3])
@pytest.mark.parametrize("ripple", [44.0, 60.0])
def test_a_small_ripple_does_not_hide_the_frequency_of_a_large_swing(rate, ripple):
    large, small = response(rate, 5.2, 2e-3), response(rate, ripple, 2e-4, settling=0.0)
    (finding,) = found(a=lambda t: large(t) + small(t) - 0.9)
    assert finding.kind == ("growing_oscillation" if rate else "sustained_oscillation")
    assert finding.figures["frequency_hz"] == pytest.approx(5.2, rel=0.01)
    assert finding.figures["growth_rate"] == pytest.approx(rate, abs=0.02)


def test_a_limit_cycle_has_a_beginning():
    """ẋ = growth that saturates: x² is logistic."""

    def y(t):
        since = np.maximum(t - EVENT, 0.0)
        return 0.1 / np.sqrt(1 + 1e4 * np.exp(-3 * since)) * np.sin(2 * PI * 0.8 * since)

    (finding,) = found(a=y)
    assert finding.kind == "sustained_oscillation"
    assert finding.time == pytest.approx(EVENT + np.log(1e4) / 3, abs=1.0)
    assert "from t = " in finding.message


def test_a_swing_without_a_frequency_does_not_settle():
    noise = np.random.default_rng(1)

    def y(t):
        coarse = np.arange(0.0, t[-1] + 0.1, 0.05)
        return 0.02 * np.interp(t, coarse, noise.standard_normal(len(coarse))) * (t > EVENT)

    (finding,) = found(a=y)
    assert finding.kind == "sustained_oscillation"
    assert "at no single frequency" in finding.message


def test_units_are_named_rather_than_the_grid_and_each_thing_once():
    (finding,) = found(a=response(0.1, 0.5, 1e-3), grid=response(0.1, 0.5, 5e-3))
    assert finding.component == "a"


def test_what_is_beside_the_point_is_not_told():
    assert found(a=response(0.1, 0.5, 1e-9)) == []  # too small for anybody
    assert found(a=response(-1.0, 0.02)) == []  # slow, and no period of it
    assert found(a=lambda t: 0.01 * np.maximum(t - EVENT, 0)) == []
    assert found(a=lambda t: 0.3 * (t > EVENT) * (1 - np.exp(-(t - EVENT) / 30))) == []
    assert found(stop=1.2, a=response(0.5, 9.0)) == []  # too short to say


def test_one_look_that_is_no_number_is_told_with_its_time():
    seen = Seen(0.5 * np.arange(4), {"a.b.x": np.array([0.0, 1.0, np.nan, 2.0])}, {}, {}, {}, {})
    (found,) = _not_finite(seen)
    assert (found.time, found.component, found.variable) == (1.0, "a", "b.x")
    assert "(nan) at t = 1 s, and so in 1 of 4 looks" in found.message


def test_a_long_run_is_not_looked_at_more_often_than_can_be_kept():
    assert look_every(1e-3, 1, 10.0) == 5
    assert look_every(1e-3, 4, 10.0) == 4
    assert look_every(1e-3, 1, 1e4) == 1e7 / MOST_LOOKS
