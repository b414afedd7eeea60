"""Criteria of the codes: each reads a response and says whether what is asked is met.

A number of a code stands in the code's table. A number that no code gives is one of this module's constants, and the
finding says that it is this program's reading."""

import numpy as np

from orchestrator.core.arrays import Numbers
from orchestrator.core.units import whole_percent
from orchestrator.devices.binding.misfits import NO_LIMIT
from orchestrator.simulation.watch.limits import ABOVE, LASTS, told_of
from orchestrator.studies.certification.codes.bench_point import CAPACITANCE, PLANT
from orchestrator.studies.certification.codes.measured import MeasuredRow, over_a_period
from orchestrator.studies.certification.codes.row import Band, Bounded, Judge, RowFinding

# whose a criterion's number is: the code's, or a reading of ours
CODE = "code"
READING = "reading"
CURRENT = "current"  # name of the criterion that every row has, whatever its code asks

SETTLED = 0.02
"""Largest movement of a power or a voltage, peak to peak over the last half second of a hold, that counts as settled
[pu]."""

BACK = 0.05  # largest distance from the power before an event at which it counts as returned [pu]
MOVED = 0.01  # least change of a settled power that counts as a response of the droop [pu]
# largest movement of the frequency, peak to peak in a hold's last half second, that is settled [Hz]
CALM = 0.05

OPPOSED = 0.2
"""Least change of the power against a jump of 10° or more where the code gives no number [pu]: what MISO and ERCOT ask
for 10°."""

FIRST_SWING = 0.1  # time after a jump in which its first response is looked for [s]
# width of the median for a response's speed [s]: what is shorter than half of it is the filter's
SPIKE = 5e-3
SIDE = 0.01  # largest deviation of a settled frequency to the wrong side of rated [Hz]

# what is judged, as pictures call it
POWER_SHOWN = "Active power [pu]"
VOLTAGE_SHOWN = "Voltage [pu]"

LOOK = 0.5  # end of a hold in which it has to be settled [s]


def _finding(
    name: str,
    rule: str,
    origin: str,
    value: float,
    limit: float,
    text: str,
    *,
    unit: str = "pu",
    at_most: bool = True,
) -> RowFinding:
    """A comparison; a value that is no number is not accepted. ``unit``: of the value and of its limit."""
    good = bool(value <= limit) if at_most else bool(value >= limit)
    scale = abs(limit) or 1.0
    margin = (limit - value) / scale if at_most else (value - limit) / scale
    return RowFinding(
        name,
        rule,
        origin=origin,
        value=_number(value),
        limit=limit,
        margin=_number(margin),
        accepted=good,
        text=text,
        unit=unit,
    )


def _number(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


_RESONATES = (
    f"the voltage reaches {{v:.3g}} pu: the converter feeds a resonance of the source with the bench's capacitance of "
    f"{CAPACITANCE:g} pu, where it is not passive (`gfor fmu nyquist --scr 10` tells where)"
)


def holds_together() -> Judge:
    """Neither a loss of synchronism, nor growth, nor a lasting oscillation, as `gfor run` watches for them, nor a trip.

    What the watch could not tell is said; whether the response settles is a criterion of its own."""

    def judge(row: MeasuredRow) -> RowFinding:
        faults = row.faults
        text = "; ".join(faults or ["nothing was found", *row.undecided])
        if faults and row.resonance is not None:
            text = f"{_RESONATES.format(v=row.resonance)}; {text}"
        return RowFinding(
            "stable",
            "no loss of synchronism, growth, lasting oscillation or trip",
            origin=READING,
            value=float(len(faults)),
            limit=0.0,
            margin=None,
            accepted=not faults,
            text=text,
        )

    return judge


def carries() -> Judge:
    """The current stays below what the converter's binding declares; where it declares none, what any limit gives."""

    def judge(row: MeasuredRow) -> RowFinding:
        rule = f"for no more than {1e3 * LASTS:g} ms is the current over a period above its limit"
        told = told_of(row.findings, PLANT)
        if told:
            return _finding(
                CURRENT, rule, READING, told["mean"], ABOVE * told["declared"], str(told["message"])
            )
        size = np.hypot(row.p, row.signals["q"]) / np.maximum(row.signals["v"], 1e-3)
        mean = over_a_period(size, row.times, row.f_n)[row.within(row.event(0), np.inf)]
        lasts = min(len(mean), round(LASTS / float(row.times[1] - row.times[0])))
        held = float(np.lib.stride_tricks.sliding_window_view(mean, lasts).min(axis=1).max())
        text = f"{held:.3g} pu of its rating"
        if row.current_limit is None:
            return _finding(CURRENT, rule, READING, held, NO_LIMIT, text)
        text += f"; its binding declares {row.current_limit:g} pu"
        return _finding(CURRENT, rule, READING, held, ABOVE * row.current_limit, text)

    return judge


def settles(events: tuple[int, ...] = (), name: str = "settles") -> Judge:
    """Power and voltage stand still at the end of the hold after each event."""

    def judge(row: MeasuredRow) -> RowFinding:
        worst, at = 0.0, row.times[0]
        for time in _chosen(row, events):
            end = row.until(time)
            part = row.within(max(end - LOOK, time + LOOK), end)
            for signal in (row.mean_p, row.mean_v):
                moved = float(np.ptp(signal[part])) if part.stop > part.start else 0.0
                if not moved <= worst:
                    worst, at = moved, time
        text = f"{worst:.3g} pu at the end of the hold after {at:g} s"
        rule = f"P and v move by at most {SETTLED:g} pu in the last {LOOK:g} s of each hold"
        return _finding(name, rule, READING, worst, SETTLED, text)

    return judge


def returns(
    name: str = "returns",
    within: float | None = None,
    tolerance: float = BACK,
    *,
    of_code: bool = False,
    events: tuple[int, ...] = (),
) -> Judge:
    """The power comes back to what it was before the first event.

    ``within``: Time after the event in which it has to be back for good [s]; None for the end of its hold.
    ``tolerance``: Largest distance [pu of the rating].
    ``events``: Numbers of the events; all of them where empty."""

    def judge(row: MeasuredRow) -> RowFinding:
        asked, worst, at = row.before(row.event(0)), 0.0, row.times[0]
        for time in _chosen(row, events):
            end = row.until(time)
            begin = end - LOOK if within is None else time + within
            part = row.mean_p[row.within(begin, end)]
            away = float(np.abs(part - asked).max()) if len(part) else 0.0
            if not away <= worst:
                worst, at = away, time
        when = "at the end of each hold" if within is None else f"{within:g} s after the event"
        text = f"{worst:.3g} pu away after the event at {at:g} s"
        rule = f"P is back within {tolerance:g} pu {when}"
        return _finding(name, rule, CODE if of_code else READING, worst, tolerance, text)

    def bands(row: MeasuredRow) -> list[Band]:
        asked = row.before(row.event(0))
        ends = [(time, row.until(time)) for time in _chosen(row, events)]
        spans = [(end - LOOK if within is None else time + within, end) for time, end in ends]
        return [
            _power_band(name, *span, asked - tolerance, asked + tolerance)
            for span in spans
            if span[0] < span[1]
        ]

    return Bounded(judge, bands)


def opposes_jump(event: int, sign: int, least: float, *, of_code: bool = True) -> Judge:
    """The power, averaged over a period, moves against the jump by at least so much.

    ``sign``: +1 where the power has to rise: the source's angle falls."""

    def judge(row: MeasuredRow) -> RowFinding:
        time = row.event(event)
        change = sign * (row.mean_p[row.within(time, time + FIRST_SWING)] - row.before(time))
        peak = float(change.max(initial=-np.inf))
        rule = f"the power {'rises' if sign > 0 else 'falls'} by at least {least:g} pu (mean over a period)"
        origin = CODE if of_code else READING
        return _finding(
            f"opposes the jump at {time:g} s",
            rule,
            origin,
            peak,
            least,
            f"{peak:.3f} pu",
            at_most=False,
        )

    def bands(row: MeasuredRow) -> list[Band]:
        time = row.event(event)
        name = "reached in the first swing after each jump"
        return [_beyond(name, time, time + FIRST_SWING, row.before(time) + sign * least, sign)]

    return Bounded(judge, bands)


def responds_within(event: int, sign: int, longest: float, share: float = 0.9) -> Judge:
    """The power reaches a share of its first change in a time. A median takes the filter's spikes away.

    ``sign``: +1 where the power has to rise.
    ``share``: Of the largest change in the first swing."""

    def judge(row: MeasuredRow) -> RowFinding:
        time = row.event(event)
        part = row.within(time, time + FIRST_SWING)
        change = sign * (_without_spikes(row)[part] - row.before(time))
        peak = float(change.max(initial=-np.inf))
        reached = np.flatnonzero(change >= share * peak)
        taken = (
            float(row.times[part][reached[0]] - time) if peak > 0 and len(reached) else float("nan")
        )
        text = (
            f"{1e3 * taken:.1f} ms"
            if np.isfinite(taken)
            else "it does not respond against the jump"
        )
        rule = f"{whole_percent(share)} of the first change within {1e3 * longest:g} ms"
        return _finding(f"speed at {time:g} s", rule, CODE, taken, longest, text, unit="s")

    return judge


def follows_droop(event: int, sign: int) -> Judge:
    """The settled power after a ramp lies on the side that a droop asks for."""

    def judge(row: MeasuredRow) -> RowFinding:
        time = row.event(event)
        end = row.until(time)
        change = sign * (
            float(np.mean(row.mean_p[row.within(end - LOOK, end)])) - row.before(row.event(0))
        )
        rule = f"the settled power is {'higher' if sign > 0 else 'lower'} than at the start by {MOVED:g} pu or more"
        return _finding(
            f"droop after {time:g} s",
            rule,
            READING,
            change,
            MOVED,
            f"{change:.3f} pu",
            at_most=False,
        )

    def bands(row: MeasuredRow) -> list[Band]:
        end, level = row.until(row.event(event)), row.before(row.event(0)) + sign * MOVED
        return [_beyond("the droop's side at the end of each hold", end - LOOK, end, level, sign)]

    return Bounded(judge, bands)


def stays_within(low: float, high: float, longest: float) -> Judge:
    """The voltage is not outside of two bounds for longer than a time [pu, pu, s]."""

    def judge(row: MeasuredRow) -> RowFinding:
        v = row.mean_v
        outside = np.logical_not((v >= low) & (v <= high))
        taken = _longest(outside) * float(row.times[1] - row.times[0])
        text = f"{taken:.3f} s; {float(np.nanmin(v)):.3f} to {float(np.nanmax(v)):.3f} pu"
        rule = f"v is outside of {low:g} to {high:g} pu for at most {longest:g} s"
        return _finding("voltage", rule, CODE, taken, longest, text, unit="s")

    def bands(row: MeasuredRow) -> list[Band]:
        ends = row.times[[0, -1]]
        return [
            Band(
                "voltage",
                VOLTAGE_SHOWN,
                lambda r: r.mean_v,
                ends,
                np.full(2, low),
                np.full(2, high),
            )
        ]

    return Bounded(judge, bands)


def frequency_settles() -> Judge:
    def judge(row: MeasuredRow) -> RowFinding:
        end = float(row.times[-1])
        part = row.frequency[row.within(end - LOOK, end - 0.05)]
        moved = float(np.ptp(part))
        rule = f"the frequency moves by at most {CALM:g} Hz in the last {LOOK:g} s"
        return _finding(
            "frequency settles",
            rule,
            READING,
            moved,
            CALM,
            f"{moved:.3g} Hz, at {float(np.mean(part)):.3f} Hz",
            unit="Hz",
        )

    return judge


def frequency_against_power() -> Judge:
    """The final frequency is below rated where the plant gives more than before, above where it gives less."""

    def judge(row: MeasuredRow) -> RowFinding:
        end = float(row.times[-1])
        last = row.within(end - LOOK, end - 0.05)
        more = float(np.mean(row.mean_p[last])) - row.before(row.event(0))
        away = float(np.mean(row.frequency[last])) - row.f_n
        rule = (
            f"the final frequency lies by at most {SIDE:g} Hz on the side to which the power moved"
        )
        return _finding(
            "frequency against power",
            rule,
            READING,
            float(np.sign(more)) * away,
            SIDE,
            f"{away:+.3f} Hz at {more:+.3f} pu",
            unit="Hz",
        )

    return judge


def meets_load() -> Judge:
    """After the loss of the last machine both plants together feed what the source fed before them, in one second."""

    def judge(row: MeasuredRow) -> RowFinding:
        time = row.event(0)
        both = row.signals["p"] + row.signals["duplicate.p"]
        wanted = float(np.mean((both + row.signals["source.p"])[row.within(time - 0.5, time)]))
        part = row.within(float(row.times[-1]) - LOOK, float(row.times[-1]))
        v_squared = float(np.mean(row.signals["v"][part] ** 2))
        away = abs(float(np.mean(both[part])) - wanted * v_squared)
        rule = f"the plants feed the load within {SETTLED:g} pu at the end, at the voltage of then"
        return _finding("meets the load", rule, READING, away, SETTLED, f"{away:.3g} pu away")

    return judge


def inertia(event: int, rate: float, lasts: float, least: float) -> Judge:
    """The inertia constant from the energy that the plant gives during a ramp of the frequency.

    H = f_n·ΔE/(2·|rate|·lasts), where ΔE is the energy beyond that of the power before [pu·s].

    ``rate``, ``lasts``: Of the ramp [Hz/s, s]; the power has to rise where the rate is negative.
    ``least``: Least inertia constant [s]."""

    def judge(row: MeasuredRow) -> RowFinding:
        time = row.event(event)
        part = row.within(time, time + lasts + 1e-6)
        change = (row.p[part] - row.before(time)) * (-np.sign(rate))
        energy = float(np.sum(0.5 * (change[1:] + change[:-1])) * (row.times[1] - row.times[0]))
        H = energy * row.f_n / (2 * abs(rate) * lasts)
        rule = f"H = f_n·ΔE/(2·{abs(rate):g} Hz/s·{lasts:g} s) is at least {least:g} s"
        name = f"inertia at {time:g} s"
        return _finding(name, rule, CODE, H, least, f"{H:.2f} s", unit="s", at_most=False)

    return judge


def _beyond(name: str, begin: float, end: float, level: float, sign: int) -> Band:
    """Where the power has to be above a level, or below it where the sign is −1."""
    return _power_band(name, begin, end, level if sign > 0 else None, None if sign > 0 else level)


def _power_band(name: str, begin: float, end: float, low: float | None, high: float | None) -> Band:
    lowest, highest = (None if level is None else np.full(2, level) for level in (low, high))
    return Band(name, POWER_SHOWN, lambda row: row.mean_p, np.array([begin, end]), lowest, highest)


def _chosen(row: MeasuredRow, events: tuple[int, ...]) -> tuple[float, ...]:
    return tuple(row.event(k) for k in events) if events else row.events


def _without_spikes(row: MeasuredRow) -> Numbers:
    """Active power of the plant, as its median over `SPIKE` around each instant [pu]."""
    half = max(1, round(SPIKE / 2 / float(row.times[1] - row.times[0])))
    padded = np.pad(row.p, half, mode="edge")
    return np.asarray(
        np.median(np.lib.stride_tricks.sliding_window_view(padded, 2 * half + 1), axis=1)
    )


def _longest(mask: np.ndarray) -> int:
    best = count = 0
    for value in mask.tolist():
        count = count + 1 if value else 0
        best = max(best, count)
    return best
