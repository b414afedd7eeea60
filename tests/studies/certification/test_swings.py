"""The norm's time-domain criterion on signals whose answer is known."""

import numpy as np
import pytest

from orchestrator.studies.certification.swings import extrema, slow_part, swing_test

TIMES = np.arange(0, 61, 0.005)
EVENT = 1.0


def damped(ratio, frequency=0.5, sign=1.0, times=TIMES):
    """A swing around a step, as a well-kept textbook draws it."""
    omega, after = 2 * np.pi * frequency, np.clip(times - EVENT, 0, None)
    return 0.9 + sign * 0.02 * (
        1 - np.exp(-ratio * omega * after) * np.cos(omega * np.sqrt(1 - ratio**2) * after)
    )


def ratio_after_four_periods(ratio):
    return np.exp(-8 * np.pi * ratio / np.sqrt(1 - ratio**2))


@pytest.mark.parametrize("ratio", [-0.01, 0.0, 0.02, 0.05, 0.0545, 0.0556, 0.08, 0.12])
@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("frequency", [0.2, 0.5, 1.4])
def test_the_ratio_is_that_of_four_periods_and_its_limit_lies_at_five_and_a_half_percent(
    ratio, sign, frequency
):
    test = swing_test(TIMES, damped(ratio, frequency, sign), EVENT)
    assert test.ratio == pytest.approx(ratio_after_four_periods(ratio), rel=0.01)
    assert test.accepted == (ratio > 0.0551)


def test_the_distances_can_be_checked_by_hand():
    """Straight pieces: maxima 10 at 2 s, 8 at 6 s, minimum 1 at 3 s; the line is at 9.5 there."""
    corners = [
        (0, 0.0),
        (1, 0.0),
        (1.5, -1.0),
        (2, 10.0),
        (3, 1.0),
        (6, 8.0),
        (8, 2.0),
        (9, 6.0),
        (40, 5.0),
    ]
    times = np.linspace(0, 40, 40001)
    test = swing_test(times, np.interp(times, *zip(*corners, strict=True)), EVENT)
    assert (test.dropped.time, test.dropped.value, test.dropped.is_maximum) == (
        pytest.approx(1.5),
        -1.0,
        False,
    )
    first, second = test.swings
    assert (first.before.value, first.minimum.value, first.after.value) == pytest.approx(
        (10.0, 1.0, 8.0), abs=1e-3
    )
    assert first.line == pytest.approx(9.5, abs=1e-3)
    assert first.depth == pytest.approx(8.5, abs=2e-3)
    # the line falls from 8 at 6 s to 6 at 9 s
    assert second.depth == pytest.approx(8 - 2 * 2 / 3 - 2, abs=3e-3)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_first_extremum_is_left_out(sign):
    signal = damped(0.1, sign=sign)
    points = extrema(TIMES, signal, EVENT)
    test, other = (
        swing_test(TIMES, signal, EVENT),
        swing_test(TIMES, signal, EVENT, drop_first=False),
    )
    assert test.dropped == points[0]
    assert points[0].is_maximum == (sign > 0)
    assert other.dropped is None
    kept = [p for p in points[1:] if p.is_maximum]
    assert test.swings[0].before == kept[0]
    if sign > 0:
        assert other.swings[0].before == points[0]


def test_a_slow_trend_does_not_count_as_a_swing():
    trend = 0.05 * (1 - np.exp(-(TIMES - EVENT).clip(0) / 15))
    test = swing_test(TIMES, damped(0.06) + trend, EVENT)
    assert test.accepted
    assert test.ratio == pytest.approx(ratio_after_four_periods(0.06), rel=0.05)


def test_what_died_out_before_the_fifth_swing_is_accepted():
    test = swing_test(TIMES, damped(0.3), EVENT)
    assert test.accepted
    assert test.ratio == 0.0
    assert "died out" in test.reason


def test_a_record_that_ends_too_early_is_not_accepted():
    short = TIMES[TIMES < 6]
    test = swing_test(short, damped(0.02, times=short), EVENT)
    assert not test.accepted
    assert test.ratio is None
    assert "record ends" in test.reason


def test_a_signal_that_is_not_finite_is_not_accepted():
    signal = damped(0.2)
    signal[-1] = np.nan
    assert not swing_test(TIMES, signal, EVENT).accepted


def test_a_signal_that_does_not_move_is_accepted():
    assert swing_test(TIMES, np.full_like(TIMES, 0.9), EVENT).accepted


@pytest.mark.parametrize("frequency", [0.2, 0.5, 1.5])
def test_a_ripple_above_the_judged_modes_is_taken_out_and_the_modes_stay(frequency):
    clean = damped(0.03, frequency)
    rippled = clean + 1e-3 * np.sin(2 * np.pi * 46 * TIMES)
    slow = slow_part(TIMES, rippled)
    assert np.abs(slow - slow_part(TIMES, clean))[200:-200].max() < 1e-8
    assert np.abs(slow - clean)[600:-600].max() < 3e-5  # of 0.04 from crest to trough
    test, wanted = swing_test(TIMES, slow, EVENT), swing_test(TIMES, clean, EVENT)
    assert test.ratio == pytest.approx(wanted.ratio, rel=0.01)
    assert swing_test(TIMES, rippled, EVENT).ratio != pytest.approx(wanted.ratio, rel=0.01)


def corners(*points):
    """Straight pieces between corners (time, value) as a signal over 40 s."""
    times = np.linspace(0, 40, 40001)
    return times, np.interp(times, *zip(*points, strict=True))


@pytest.mark.parametrize(("part", "counts"), [(0.8e-3, False), (1.2e-3, True)])
def test_a_turn_counts_from_a_thousandth_of_the_range(part, counts):
    """The range is 10; the signal turns back by a part of it near the end."""
    small = 10 * part
    times, signal = corners(
        (0, 0.0), (1, 0.0), (2, 10.0), (3, 5.0), (20, 6.0), (21, 6.0 - small), (40, 6.5)
    )
    late = [p for p in extrema(times, signal, EVENT) if p.time > 15]
    assert len(late) == (2 if counts else 0)


@pytest.mark.parametrize(("quiet", "accepted"), [(9.8, False), (10.2, True)])
def test_what_stood_still_for_ten_seconds_has_died_out(quiet, accepted):
    """That long is a period of the slowest mode that is judged."""
    end = 40 - quiet
    times, signal = corners(
        (0, 0.0), (1, 0.0), (2, 10.0), (3, 5.0), (end - 1, 7.0), (end, 6.0), (40, 6.5)
    )
    assert swing_test(times, signal, EVENT).accepted == accepted


@pytest.mark.parametrize(("frequency", "kept"), [(1.5, 1.0), (2.0, 1.0), (5.0, 0.5), (10.0, 0.0)])
def test_what_is_taken_out_begins_above_the_judged_modes(frequency, kept):
    """Forth and back, the filter halves what lies at 5 Hz."""
    signal = np.sin(2 * np.pi * frequency * TIMES)
    middle = slice(2000, -2000)
    size = np.abs(slow_part(TIMES, signal)[middle]).max()
    assert size == pytest.approx(kept, abs=0.01)
