"""When the event of a recording is: windows before, during and after it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from orchestrator.core.arrays import Complex, Numbers
from orchestrator.core.errors import InputError
from orchestrator.core.options import Option
from orchestrator.studies.validation.filled import Mask
from orchestrator.studies.validation.record import Recording

_LAG = 0.02  # time [s] over which a change of the voltage counts as abrupt: a period
_AS_USUAL = 2.0  # times the largest change in the first part, up to which a change is as before
_LEAST = 0.002  # smallest change of the voltage [pu] over that time which is an event
_LEAST_IN_QUIET = 5e-4  # the same, where nothing in the recording changes much more [pu]
_OF_LARGEST = 0.25  # part of the recording's largest change, from which on one is the event
_ABOVE = 4.0  # times the largest change in the first part, from which on it is an event
_FIRST = 0.1  # part of the recording that is looked at for what is usual before the event
_LONGEST_FIRST = 1.0  # [s]
_SHORTEST_FIRST = 0.2  # time [s] before an event within the first part that shows a steady state
_BACK = 0.5  # time [s] for which an event's slow begin is looked for before it is abrupt
_LATE = 0.15  # time [s] by which a slow begin is late at most where it stands out of the scatter
_STARTS = 5.0  # times the scatter before, from which on a deviation is the event's begin
_LEAST_STARTS = 5e-4  # smallest such deviation [pu]
_EXCURSION = 0.1  # deviation of the magnitude [pu] for which a dip or swell lasts
_LONGEST_EVENT = 3.0  # dips last no longer [s]; what comes later is another one
_SHORTEST = 0.1  # an event without a dip lasts so long [s], for its window
_SAME = 1e-9  # times that are less apart [s] are one
_SLOW = (0.1, 0.3)  # times [s] over which a signal bends in an event that is nowhere abrupt
_SMOOTHED = 0.25  # part of such a time over which means are taken first
_GROWS = 2  # lags that pass from a slow event's begin until its change is abrupt
_BENDS_BEFORE = 0.5  # time [s] before the earliest begin that shows a straight line
_WANDERS = 5.0  # times the change that counts as an event, to which an angle may wander before one
_CANDIDATES = 100  # begins that are compared, and three times as many samples
_LASTS = 0.3  # part of the largest change over the lag, from which on a change is still the event
_CORNERS = (0.04, 0.1)
"""Times [s] over which a signal bends at the begin and the end of a second change."""
_LEAST_CORNER = 5e-4  # smallest such bend [pu]
_CORNER_BESIDE_FIRST = 0.04
"""Part of the event's first bend that the corner of a second change has at least.

One as large as the first has it over 0.1 s if it lasts for up to 2.5 s."""
_STANDS_OUT = 3.0
"""Times the bends on both sides, from which on one is a corner: those beside a swing's largest are half of it."""


@dataclass(frozen=True)
class Windows:
    """Begin and end of an event, in seconds from the first sample; ``chosen``: whether the user gave them.

    ``first_end``: when its first change has ended, which a second, slower one may follow within the window; None if the
    window's end is meant. ``second``: when another event begins, with which the window after this one ends."""

    begin: float
    end: float
    length: float
    first_end: float | None = None
    chosen: bool = False
    seen: bool = True  # whether the voltage shows an event
    second: float | None = None

    @property
    def lasts(self) -> bool:
        """Return whether the event ends within the recording: a change in its last samples is none to judge."""
        return self.begin < self.end

    @property
    def until(self) -> float:
        """The time up to which what is seen is of this event [s]."""
        return self.length if self.second is None else self.second

    @property
    def parts(self) -> dict[str, tuple[float, float]]:
        return {
            "before": (0.0, self.begin),
            "during": (self.begin, self.end),
            "after": (self.end, self.until),
        }

    def part(self, name: str, times: Numbers) -> Mask:
        """Return which times are in a window: the event's first and last sample are in its own.

        The first one may hold a part of the event already, as where a recorder takes its sample in the transition."""
        early, late = times < self.begin - _SAME, times > self.end + _SAME
        own = times < self.until - _SAME if self.second is not None else True
        inside = {"before": early, "during": ~(early | late), "after": late & own}
        return np.asarray(inside[name])


def find_windows(recording: Recording) -> Windows:
    """By the first abrupt change of the voltage, or of the power where the voltage has none.

    If none stands out from the first part, the event may lie within it, or be slow."""
    first = _first(recording)
    for still in (_without_slope(recording.voltage, first), recording.power):
        found = _event(recording, still, first)
        if found is not None and found.lasts:
            return found
    shortest = max(5, round(_SHORTEST_FIRST / recording.interval))
    for still in (_without_slope(recording.voltage, shortest), recording.power):
        found = _early_event(recording, still, shortest, first)
        if found is not None and found.lasts:
            return found
    for still in (_without_slope(recording.voltage, first), recording.power):
        found = _slow_event(recording, still, first)
        if found is not None and found.lasts:
            return found
    third = recording.length / 3
    return Windows(third, 2 * third, recording.length, seen=False)


def given_windows(recording: Recording, begin: float, end: float) -> Windows:
    """Windows that the user gives, in the recording's own clock [s]."""
    low, high = begin - recording.begin, end - recording.begin
    if not 0 < low < high < recording.length:
        last = recording.begin + recording.length
        raise InputError(
            Option.EVENT
            + f" {begin:g}:{end:g}: {recording.label} lasts from {recording.begin:g} to "
            f"{last:g} s; give begin and end of the event within it"
        )
    return Windows(low, high, recording.length, chosen=True)


def _first(recording: Recording) -> int:
    """Samples of the first part, which is taken to be before any event."""
    return max(5, round(min(_LONGEST_FIRST, _FIRST * recording.length) / recording.interval))


def _lag(recording: Recording) -> int:
    return max(1, round(_LAG / recording.interval))


def _event(recording: Recording, still: Complex, first: int) -> Windows | None:
    lag = _lag(recording)
    if len(still) < first + 2 * lag:
        return None
    change = _changes(still, lag)
    usual = float(change[: max(1, first - lag)].max())
    threshold = max(_ABOVE * usual, _least_change(change))
    abrupt = np.flatnonzero(change > threshold)
    back = round(_BACK / recording.interval)
    kink = _kink(still, lag, first)
    wanders = _scatter(still[: max(first, (kink or 0) - back)]) > usual
    if kink is not None and wanders and not _began_before(change, kink - lag, threshold):
        return _windows_from(recording, still, kink)
    if not len(abrupt):
        return None
    earliest = max(0, int(abrupt[0]) + lag - back)
    return _windows_of(recording, still, earliest, int(abrupt[0]) + lag, usual)


def _kink(still: Complex, lag: int, first: int) -> int | None:
    """The last sample before a signal leaves abruptly the line on which it was; None where it never does.

    An angle that wanders with its grid's frequency moves by more in a period than a load's step moves it, but keeps
    its line."""
    off = np.zeros(len(still) - lag)
    off[lag:] = np.abs(still[2 * lag :] - 2 * still[lag:-lag] + still[: -2 * lag])
    usual = float(off[: max(1, first - lag)].max())
    seen = np.flatnonzero(off > max(_ABOVE * usual, _least_change(off)))
    if not len(seen):
        return None
    at = int(seen[0])
    as_before = np.flatnonzero(off[: at + 1] <= max(_AS_USUAL * usual, _LASTS * off[at]))
    return int(as_before[-1]) + lag if len(as_before) else None


def _began_before(change: Numbers, kink: int, threshold: float) -> bool:
    """Return whether changes that end before a kink are too large for a wandering angle: a slow event began there."""
    return float(change[: max(kink, 0)].max(initial=0.0)) > _WANDERS * threshold


def _least_change(change: Numbers) -> float:
    """The smallest change over the lag that is an event: a small one is, where none is much larger.

    Without that, the event of a switched load would begin where the swing after it is fastest."""
    return float(np.clip(_OF_LARGEST * change.max(), _LEAST_IN_QUIET, _LEAST))


def _early_event(recording: Recording, still: Complex, shortest: int, first: int) -> Windows | None:
    """An event after at least ``shortest`` and at most ``first`` samples.

    Its change is beyond all that ended by a lag before it began: a swing or ramp grows too slowly for that."""
    lag = _lag(recording)
    if len(still) < first + 2 * lag:
        return None
    change = np.abs(still[lag : first + 2 * lag] - still[: first + lag])
    before = np.maximum.accumulate(change)[: -2 * lag]
    late = change[2 * lag :]
    abrupt = np.flatnonzero(late > np.maximum(_ABOVE * before, _LEAST))
    begins = abrupt[abrupt + 2 * lag >= shortest]
    if not len(begins):
        return None
    steady = int(begins[0]) + lag  # samples that took part in the changes before
    return _windows_of(recording, still, steady, steady + 2 * lag, float(before[begins[0]]))


def _slow_event(recording: Recording, still: Complex, first: int) -> Windows | None:
    """An event that is nowhere abrupt, as a voltage that sinks for seconds or the begin of a swing."""
    for time in _SLOW:
        lag = max(1, round(time / recording.interval))
        bends = _bends(still, lag)
        if first <= 2 * lag + 1:
            continue
        usual = float(bends[2 * lag : first].max())
        seen = np.flatnonzero(bends[first:] > max(_ABOVE * usual, _LEAST))
        if len(seen):
            stop = first + int(seen[0])
            begin = _bend(recording, still, (max(1, stop - 2 * lag), stop - 1), stop)
            if begin < first:  # what swings before as well is no event
                continue
            return _windows_from(recording, still, begin)
    return None


def _bends(still: Complex, lag: int) -> Numbers:
    """How far each sample is off the line through those one lag and two lags before; means over a part of it."""
    width = max(1, round(_SMOOTHED * lag))
    total = np.concatenate([[0.0], np.cumsum(still)])
    means = (total[width:] - total[:-width]) / width
    found = np.zeros(len(still))
    off = means[2 * lag :] - 2 * means[lag:-lag] + means[: -2 * lag]
    found[2 * lag + width - 1 :] = np.abs(off)
    return found


def _bend(recording: Recording, still: Complex, within: tuple[int, int], stop: int) -> int:
    """The sample within two at which a signal leaves its straight line along a parabola, by least squares."""
    low, high = within
    begin = max(0, low - round(_BENDS_BEFORE / recording.interval))
    thin = max(1, (stop - begin) // (3 * _CANDIDATES))
    rows = np.arange(begin, stop + 1, thin)
    values = np.column_stack([still[rows].real, still[rows].imag])
    line = np.vander(rows - begin, 2)
    best = (np.inf, high)
    for at in range(low, high + 1, max(1, (high - low) // _CANDIDATES)):
        since = np.clip(rows - at, 0, None)
        columns = np.column_stack([line, since, since**2])
        rest = values - columns @ np.linalg.lstsq(columns, values, rcond=None)[0]
        best = min(best, (float(np.sum(rest**2)), at))
    return best[1]


def _changes(still: Complex, lag: int) -> Numbers:
    return np.abs(still[lag:] - still[:-lag])


def _windows_of(
    recording: Recording, still: Complex, earliest: int, stop: int, usual: float
) -> Windows:
    """Begin between two samples, and the end [s]; ``usual``: the largest change over the lag before the event."""
    lag, interval = _lag(recording), recording.interval
    change = _changes(still, lag)
    begin = _begin(still, earliest, stop)
    if _scatter(still[: max(earliest, 3)]) > usual:
        begin = max(begin, _abrupt_begin(change, stop, lag, usual))
    if stop - begin > _GROWS * lag:
        is_seen = begin > max(earliest, 1)  # else it is further back
        low = begin - round((_LATE if is_seen else _BACK) / interval)
        low = max(low, min(begin, _first(recording)), 1)  # the first part is before any event
        begin = _bend(recording, still, (low, begin if is_seen else stop - 1), stop)
    return _windows_from(recording, still, begin)


def _windows_from(recording: Recording, still: Complex, begin: int) -> Windows:
    """The windows of an event that begins at a sample."""
    lag, interval, last = _lag(recording), recording.interval, len(still) - 2
    change, after_dip = _changes(still, lag), _after_dip(still, begin, interval)
    first_end = after_dip or _end_of_change(change, begin, lag, interval)
    second = None if after_dip else _second_change(still, begin, interval)
    end = first_end
    if second is not None:
        end = max(end, _end_of_change(change, second, lag, interval))
    return Windows(
        interval * begin,
        interval * min(end, last),
        recording.length,
        first_end=interval * min(first_end, last),
    )


def _without_slope(signal: Complex, first: int) -> Complex:
    """The signal with the rotation of its first part taken out, as a frequency off its rated value gives it."""
    angle = np.unwrap(np.angle(signal[:first]))
    slope = np.polyfit(np.arange(first), angle, 1)[0] if np.abs(signal[:first]).min() > 0.1 else 0.0
    turns = slope if abs(slope) > 1e-9 else 0.0
    return np.asarray(signal * np.exp(-1j * turns * np.arange(len(signal))))


def _scatter(before: Complex) -> float:
    return float(np.abs(before - before.mean()).std())


def _begin(still: Complex, earliest: int, stop: int) -> int:
    """The last sample that is as before, walking back from an abrupt change."""
    before = still[: max(earliest, 3)]
    rest = before[-min(len(before), 200) :].mean()
    least = max(_STARTS * _scatter(before), _LEAST_STARTS)
    for k in range(stop, earliest, -1):
        if abs(still[k] - rest) <= least:
            return k
    return max(earliest, 1)


def _abrupt_begin(change: Numbers, stop: int, lag: int, usual: float) -> int:
    """The last sample up to which the signal changes as before, where it changes abruptly soon after; else the first.

    Of a signal that wanders by more than it changes in a lag, as an angle does: it is nowhere where it was on average.
    Without that, a slow begin is told by where the signal was."""
    most = max(_AS_USUAL * usual, _LASTS * float(change[stop - lag]))
    as_before = np.flatnonzero(change[: stop - lag + 1] <= most) + lag
    last = int(as_before[-1]) if len(as_before) else 0
    return last if stop - last <= _GROWS * lag else 0


def _after_dip(still: Complex, begin: int, interval: float) -> int | None:
    """The first sample after a dip or swell; None where the magnitude has none."""
    magnitude = np.abs(still)
    usual = float(magnitude[: begin + 1].mean())
    within = slice(begin + 1, begin + 1 + round(_LONGEST_EVENT / interval))
    away = np.flatnonzero(np.abs(magnitude[within] - usual) > _EXCURSION)
    return begin + 2 + int(away[-1]) if len(away) else None


def _end_of_change(change: Numbers, begin: int, lag: int, interval: float) -> int:
    """The sample at which a change that begins at one has ended; what lasts for a second and longer is a swing."""
    near = change[begin : begin + round(_LONGEST_EVENT / interval)]
    lasting = np.flatnonzero(near > _LASTS * near.max(initial=0.0))
    last = int(lasting[-1]) + lag if len(lasting) else 0
    return begin + max(last if last * interval < 1.0 else 0, round(_SHORTEST / interval), 1)


def _second_change(still: Complex, begin: int, interval: float) -> int | None:
    """The sample of the last corner in the course of a signal, or of its magnitude, up to the longest event's end.

    A ramp or a slow return that follows an event's first change begins and ends with a corner. A swing has none: its
    bends grow and fall with it. The corner stands out from the bends on both its sides, and is no afterthought beside
    the first change."""
    found = [
        corner
        for time in _CORNERS
        for signal in (still, np.abs(still).astype(complex))
        for corner in _corners(signal, begin, max(1, round(time / interval)), interval)
    ]
    return max(found, default=None)


def _corners(signal: Complex, begin: int, lag: int, interval: float) -> list[int]:
    """The corners of a signal after the bend with which its event begins, which lasts for two lags and a mean."""
    width = max(1, round(_SMOOTHED * lag))
    bends = _bends(signal, lag)
    usual = float(bends[2 * lag : begin].max(initial=0.0))
    first = float(bends[begin : begin + 2 * lag + width].max(initial=0.0))
    least = max(_ABOVE * usual, _LEAST_CORNER, _CORNER_BESIDE_FIRST * first)
    aside, far = lag + lag // 2 + width, 4 * lag + width
    begins = begin + 2 * lag + width
    ends = min(begin + round(_LONGEST_EVENT / interval) + lag, len(bends) - far)
    found = []
    above = begins + far + np.flatnonzero(bends[begins + far : max(ends, 0)] > least)
    peak = (bends[above] >= bends[above - 1]) & (bends[above] >= bends[above + 1])
    for at in above[peak]:
        near = bends[at - lag : at + lag + 1]
        beside = max(bends[at - far : at - aside].max(), bends[at + aside : at + far].max())
        if bends[at] == near.max() and bends[at] > _STANDS_OUT * beside:
            found.append(int(at) - lag - width // 2)
    return found
