"""Modes of a measured and a simulated ring-down beside each other: what is the model's, and what is the look's."""

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from orchestrator.studies.validation.figures import compare_signals, modes_apart
from orchestrator.studies.validation.limits import (
    LimitTables,
    LimitVerdict,
    OpenCause,
    RingDownLimits,
    _of_ring_down,
    _verdict,
)
from orchestrator.studies.validation.record import Recording
from orchestrator.studies.validation.ring_gaps import ask_of_gaps, without_gaps
from orchestrator.studies.validation.windows import Windows
from orchestrator.studies.validation.words import open_sentence, sentence

INTERVAL = 0.02  # of a recorder that sends 50 samples a second [s]
LENGTH = 12.0  # [s]: three periods of the slowest swing, of which fewer decide nothing
EVENT = Windows(begin=1.0, end=1.1, length=LENGTH)
TIMES = INTERVAL * np.arange(round(LENGTH / INTERVAL) + 1)
LIMIT = 3.0  # of the example's limits on damping [points of percent]


def rings(*modes, late=0.0):
    """A sum of damped swings from the event on; each with frequency [Hz], damping [1] and amplitude [pu]."""
    since = np.maximum(TIMES - EVENT.begin - late, 0.0)
    found = np.zeros(len(TIMES))
    for frequency, damping, amplitude in modes:
        decay = 2 * np.pi * frequency * damping / np.sqrt(1 - damping**2)
        found += amplitude * np.exp(-decay * since) * np.sin(2 * np.pi * frequency * since)
    return 0.9 + found + 0j


def recorded(measured, good=None):
    """A recording whose voltage rests; ``good``: which of its samples are measured."""
    everywhere = np.ones(len(TIMES), dtype=bool) if good is None else good
    return Recording(
        label="rec",
        begin=0.0,
        interval=INTERVAL,
        voltage=np.ones(len(TIMES), dtype=complex),
        power=measured,
        good=everywhere,
        driven=everywhere,
        frame_hz=50.0,
        instantaneous=False,
        average=INTERVAL,
        channels={},
    )


def compared(measured, simulated, good=None):
    """The figures of P."""
    return compare_signals(recorded(measured, good), simulated, EVENT)["p"]


def apart(measured, simulated):
    """Frequency [%] and damping [points] by which the two are apart, and the doubts of both."""
    figures = compared(measured, simulated)
    return modes_apart(figures.modes), figures.modes_doubt


def criterion(measured, simulated):
    """The damping of the ring-down beside its limit."""
    comparison = SimpleNamespace(
        event=SimpleNamespace(recording=SimpleNamespace(label="rec")),
        signals={"p": compared(measured, simulated)},
    )
    limits = LimitTables(source="here", ring_down={"p": RingDownLimits(damping_points=LIMIT)})
    (found,) = _of_ring_down(limits, comparison)
    return found


def said(measured, simulated):
    """What is said about the limits of the ring-down."""
    return open_sentence([criterion(measured, simulated)], [])


def scattering(values, size, seed):
    return values + size * np.random.default_rng(seed).standard_normal(len(values))


BOTH = ((0.76, 0.23, 0.04), (0.31, 0.31, 0.04))
"""Two well damped swings beside each other, as a converter's power shows them."""


@pytest.mark.parametrize("seed", range(5))
def test_a_right_model_rings_as_the_plant_does_whatever_its_noise(seed):
    """The simulated signal has less noise, and would have another order by itself."""
    plant, model = scattering(rings(*BOTH), 4e-4, seed), scattering(rings(*BOTH), 1e-4, 100 + seed)
    (frequency, damping), _ = apart(plant, model)
    assert abs(frequency) < 2
    assert abs(damping) < LIMIT


@pytest.mark.parametrize("seed", range(10))
def test_in_large_noise_no_ring_down_is_called_wrong(seed):
    found, doubts = apart(
        scattering(rings(*BOTH), 2e-2, seed), scattering(rings(*BOTH), 5e-3, 50 + seed)
    )
    if found is not None:
        verdict = _verdict(abs(found[1]), doubts[1], LIMIT, grows=False)
        assert verdict is not LimitVerdict.NOT_MET


@pytest.mark.parametrize("seed", range(5))
def test_a_model_with_less_damping_is_called_wrong(seed):
    plant = scattering(rings((0.76, 0.15, 0.04)), 2e-4, seed)
    found, doubts = apart(plant, scattering(rings((0.76, 0.08, 0.04)), 1e-4, 50 + seed))
    assert found[1] == pytest.approx(-7, abs=0.5)
    assert _verdict(abs(found[1]), doubts[1], LIMIT, grows=False) is LimitVerdict.NOT_MET


@pytest.mark.parametrize("seed", range(3))
def test_a_sample_that_is_off_at_the_end_changes_nothing(seed):
    """A recorder's filter holds less there."""
    plant, model = scattering(rings(*BOTH), 4e-4, seed), scattering(rings(*BOTH), 1e-4, 100 + seed)
    model[-2:] -= 0.01
    (frequency, damping), _ = apart(plant, model)
    assert abs(frequency) < 2
    assert abs(damping) < LIMIT


def test_two_modes_that_leave_the_damping_open_are_named_of_both():
    """Noise that is an eighth of each swing leaves in doubt which of the two a look takes."""
    text = said(scattering(rings(*BOTH), 5e-3, 1), scattering(rings(*BOTH), 1.25e-3, 10))
    of_plant, of_model = text.partition("ring-down p: the plant has ")[2].split(", the model ")
    for named in (of_plant, of_model):
        found = [float(hertz) for hertz in re.findall(r"([0-9.]+) Hz", named)]
        assert found == pytest.approx([0.31, 0.76], rel=0.05)


def test_a_single_mode_whose_damping_is_open_is_not_named_again():
    one = (0.5, 0.3, 0.01)
    text = said(scattering(rings(one), 5e-3, 1), scattering(rings(one), 1.25e-3, 10))
    assert "ring-down p damping" in text
    assert "the plant has" not in text


ALIKE = ((0.76, 0.10, 0.04), (0.31, 0.12, 0.036))
"""Two modes of nearly equal size, in the order of their size."""
WRONG_FIRST = ((0.76, 0.05, 0.04), ALIKE[1])
WRONG_SECOND = (ALIKE[0], (0.31, 0.04, 0.036))


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    ("model", "hertz", "points"), [(WRONG_FIRST, 0.76, 5), (WRONG_SECOND, 0.31, 8)]
)
def test_of_two_modes_alike_the_one_that_is_off_counts(model, hertz, points, seed):
    plant = scattering(rings(*ALIKE), 4e-4, seed)
    found = criterion(plant, scattering(rings(*model), 1e-4, 100 + seed))
    assert found.verdict is LimitVerdict.NOT_MET
    assert found.value == pytest.approx(points, abs=0.7)
    assert found.as_json()["mode_hz"] == pytest.approx(hertz, rel=0.03)
    assert found.shown_name.endswith(f"at {found.mode_hz:.3g} Hz")


@pytest.mark.parametrize("seed", range(3))
def test_of_two_modes_alike_both_are_in_json_each_beside_the_models(seed):
    plant = scattering(rings(*ALIKE), 4e-4, seed)
    figures = compared(plant, scattering(rings(*WRONG_SECOND), 1e-4, 100 + seed))
    shown = figures.as_json()["ring_down"]["compared_modes"]
    pairs = {
        round(one["measured"]["frequency_hz"], 1): (
            one["measured"]["damping_percent"],
            one["simulated"]["damping_percent"],
        )
        for one in shown
    }
    assert pairs == {
        0.8: pytest.approx((10, 10), abs=0.5),
        0.3: pytest.approx((12, 4), abs=0.7),
    }


@pytest.mark.parametrize("noise", [4e-4, 2e-3])
@pytest.mark.parametrize("seed", range(5))
def test_two_modes_alike_of_a_right_model_are_met(seed, noise):
    plant = scattering(rings(*ALIKE), noise, seed)
    found = criterion(plant, scattering(rings(*ALIKE), noise / 4, 100 + seed))
    assert found.verdict is LimitVerdict.MET


@pytest.mark.parametrize("seed", range(3))
def test_a_mode_that_the_model_lacks_is_told(seed):
    """Its other mode is right, and decides nothing by itself."""
    plant = scattering(rings(*ALIKE), 4e-4, seed)
    text = said(plant, scattering(rings(ALIKE[0]), 1e-4, 100 + seed))
    assert re.search(r"ring-down p damping at 0\.31\d* Hz \(the plant rings with a mode", text)


DAMPED = (0.76, 0.20, 0.03)
"""A load step's swing, of which a recording of a few seconds holds little."""


@pytest.mark.parametrize("seed", range(8))
def test_a_difference_that_is_noise_sets_no_modes_apart(seed):
    """The noise of an identification is many times as large."""
    plant = scattering(rings(DAMPED), 1.5e-3, seed)
    model = plant + 5e-4 * np.random.default_rng(100 + seed).standard_normal(len(TIMES))
    (frequency, damping), doubts = apart(plant, model)
    assert abs(frequency) < 0.5
    assert abs(damping) < 0.5
    assert doubts[1] < 1
    assert criterion(plant, model).verdict is LimitVerdict.MET


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("points", [-3, -2, 2, 3])
def test_a_small_shift_of_the_damping_is_in_the_difference(seed, points):
    frequency, damping, amplitude = DAMPED
    model = rings((frequency, damping + points / 100, amplitude))
    plant = scattering(rings(DAMPED), 2e-4, seed)
    found, doubts = apart(plant, scattering(model, 1e-4, 100 + seed))
    assert found[1] == pytest.approx(points, abs=0.3)
    assert found[0] == pytest.approx(0, abs=0.5)
    assert doubts[1] < 0.5


@pytest.mark.parametrize("seed", range(4))
def test_half_the_damping_is_called_wrong(seed):
    frequency, damping, amplitude = DAMPED
    model = scattering(rings((frequency, damping / 2, amplitude)), 1e-4, 100 + seed)
    found = criterion(scattering(rings(DAMPED), 2e-4, seed), model)
    assert found.verdict is LimitVerdict.NOT_MET
    assert found.value == pytest.approx(10, abs=1)


BESIDE_A_SLOW_ONE = ((0.76, 0.22, 0.016), (0.36, 0.30, 0.012))
"""A load step's swing beside a slow one, which noise hides from a look at each signal by itself."""


@pytest.mark.parametrize("seed", range(4))
def test_modes_that_one_look_misses_are_met_where_the_difference_is_noise(seed):
    plant = scattering(rings(*BESIDE_A_SLOW_ONE), 1e-3, seed)
    found = criterion(plant, scattering(plant, 3e-4, 100 + seed))
    assert found.verdict is LimitVerdict.MET
    assert found.value < 1


def bridged(values, begin, length):
    """The values with a gap that a straight line bridges, and which of them are measured."""
    good = (begin >= TIMES) | (begin + length < TIMES)
    return np.interp(TIMES, TIMES[good], values[good].real) + 0j, good


@pytest.mark.parametrize("length", [0.1, 0.25, 0.5])
@pytest.mark.parametrize("begin", [1.3, 3.4])
@pytest.mark.parametrize(("hertz", "damping"), [(0.6, 0.08), (1.2, 0.05)])
def test_samples_in_a_gap_are_left_out_of_a_ring_down(hertz, damping, begin, length):
    """Bridged by a straight line, 0.25 s made 66 % of 5 %, at 1.2 Hz."""
    measured, good = bridged(scattering(rings((hertz, damping, 0.05)), 2e-4, seed=1), begin, length)
    (found, own) = compared(measured, rings((hertz, damping + 0.03, 0.05)), good).modes
    assert found.damping_percent == pytest.approx(100 * damping, abs=0.2)
    assert own.damping_percent == pytest.approx(100 * damping + 3, abs=0.2)
    (asked,) = ask_of_gaps(recorded(measured, good), EVENT)
    low, high = asked.figures["begin"], asked.figures["end"]
    assert high <= begin + 2 * INTERVAL or low >= begin + length - INTERVAL
    assert f"{low:.4g} to {high:.4g} s" in sentence(asked)


def test_single_samples_that_are_missing_leave_a_ring_down_whole():
    good = np.random.default_rng(2).random(len(TIMES)) > 0.05
    measured = scattering(rings((0.6, 0.08, 0.05)), 2e-4, seed=1)
    filled = np.interp(TIMES, TIMES[good], measured[good].real) + 0j
    found, _ = compared(filled, rings((0.6, 0.08, 0.05)), good).modes
    assert found.damping_percent == pytest.approx(8.0, abs=0.1)
    assert list(ask_of_gaps(recorded(filled, good), EVENT)) == []


def test_a_gap_before_the_event_and_one_after_a_second_leave_a_ring_down_whole():
    before, late = bridged(rings((0.6, 0.08, 0.05)), 0.5, 0.25)[1], (TIMES <= 6) | (TIMES > 6.5)
    until = replace(EVENT, second=5.5)
    assert without_gaps(recorded(rings(), before), EVENT) == EVENT
    assert without_gaps(recorded(rings(), late), until) == until


@pytest.mark.parametrize("points", [0, 8])
def test_a_swing_of_few_periods_is_doubted_and_decides_nothing(points):
    """Ten seconds and a half hold two periods."""
    plant = scattering(rings((0.2, 0.10, 0.04)), 2e-4, seed=1)
    model = scattering(rings((0.2, 0.10 + points / 100, 0.04)), 1e-4, seed=2)
    found = criterion(plant, model)
    assert (found.verdict, found.why_open) == (LimitVerdict.OPEN, OpenCause.FEW_PERIODS)
    assert "0.2 Hz: the ring-down has 2.1 periods of it" in said(plant, model)
    assert any(one.doubts for one in compared(plant, model).modes)


@pytest.mark.parametrize("late", [0.0, 0.06])
def test_a_delay_is_told_of_shapes_that_fit_and_of_no_others(late):
    def delay(measured, simulated, windows=EVENT):
        return compare_signals(recorded(measured), simulated, windows)["p"].delay

    one = (0.76, 0.10, 0.04)
    plant = scattering(rings(one, late=late), 2e-4, seed=1)
    assert delay(plant, rings(one)) == pytest.approx(late, abs=0.5 * INTERVAL)
    assert delay(plant, rings((0.4, 0.10, 0.04))) is None
    assert delay(plant, rings(one), replace(EVENT, seen=False)) is None
