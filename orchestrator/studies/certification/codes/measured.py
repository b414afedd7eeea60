"""Signals of one row, and what criteria read from them."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from orchestrator.core.arrays import Numbers
from orchestrator.core.errors import InputError
from orchestrator.simulation.watch.finding import NOT_JUDGED, UNSTABLE
from orchestrator.studies.certification.bus_frequency import bus_frequency

NOTHING = 5e-3
"""Apparent power below which a plant feeds in nothing [pu]."""

ALIVE = 0.1
"""Voltage from which on a plant could feed in [pu]."""

GONE = 0.1
"""How long a plant has to feed in nothing, in all, to be a trip [s]. On the rows of ERCOT ours, with four kinds of
limits, is below 0.31 pu for less, a grid-following converter below 0.49 pu, and a source behind a reactance, which
slips there, below 0.09 pu."""

STEADY = 0.1
"""Distance of the frequency from its rated value [Hz] beyond which `NO_CURRENT` stands for `NOTHING`: a droop may have
taken the power back to 0, as 4 % does for 1 Hz of 50 Hz at half power."""

NO_CURRENT = 1e-6  # apparent power [pu]

INSIDE = 1.5
"""Reactance behind which the voltage of a plant is looked for [pu]. From 0.75 to 2 pu the same of 92 rows of four
converters slip as by their own angles; with less, a slip whose current is limited is not seen at a strong grid."""

HOLD = 1.0  # shortest hold in whose end that voltage is looked at [s]
LATEST = 0.05  # how long that end is [s]

# what counts as a slip [rad]: on the rows of ERCOT ours moves by 0.10 turns at most
HALF_TURN = np.pi
FED_IN = 0.05  # active power before the first event from which on a trip can be told [pu]

RESONANCE = 3.0
"""Voltage at the connection point [pu] that no row's source and current together give: 1.3 pu of the source, and the
most current, 1.3 pu, in the reactance of SCR 1.25, 0.8 pu."""

_IN_WORDS = {
    "loss_of_synchronism": "it slips",
    "growth": "it grows",
    "growing_oscillation": "it swings ever more",
    "sustained_oscillation": "it swings for ever",
    "run_away": "it runs away",
    "not_finite": "it gives no numbers",
}


@dataclass(frozen=True)
class MeasuredRow:
    """The response of one row. Powers are in pu of the plant's rating."""

    times: Numbers  # [s], shape (n,), evenly spaced
    signals: Mapping[str, Numbers]  # by the bench's names, each of shape (n,)
    f_n: float
    events: tuple[float, ...]  # when something changed [s]
    # of the watch over the run, in the form of `Finding.as_json`
    findings: tuple[Mapping[str, Any], ...] = ()
    declared: Mapping[str, float] = field(default_factory=dict)
    # what the plant's binding declares [pu]; None where it declares none
    current_limit: float | None = None
    # of the source against one that turns at the rated frequency [rad], shape (n,); None where there is no source.
    source_angle: Numbers | None = None

    @property
    def p(self) -> Numbers:
        """Active power of the plant [pu]."""
        return self.signals["p"]

    @cached_property
    def mean_p(self) -> Numbers:
        """Active power of the plant, averaged over the period before each instant [pu]."""
        return over_a_period(self.p, self.times, self.f_n)

    @cached_property
    def mean_v(self) -> Numbers:
        """Voltage magnitude at the connection point, averaged over the period before each instant [pu]."""
        return over_a_period(self.signals["v"], self.times, self.f_n)

    @cached_property
    def frequency(self) -> Numbers:
        """Frequency at the connection point [Hz]."""
        return bus_frequency(self.times, self.signals["v_re"], self.signals["v_im"], self.f_n)

    def within(self, begin: float, end: float) -> slice:
        """The rows from a time on, up to and without another [s]."""
        first, last = np.searchsorted(self.times, (begin - 1e-9, end - 1e-9))
        return slice(int(first), int(last))

    def before(self, time: float) -> float:
        """Active power just before an event [pu]: the mean over half a second, or what there is."""
        return float(np.mean(self.p[self.within(max(0.0, time - 0.5), time)]))

    def event(self, number: int) -> float:
        """When the event of that number happens [s]; the last one is −1.

        Raises an `InputError` if there is none."""
        if not -len(self.events) <= number < len(self.events):
            raise InputError(
                f"a criterion asks for event {number}, and there are {len(self.events)}, numbered from 0"
            )
        return self.events[number]

    def until(self, time: float) -> float:
        """When the next change after a time comes, or the end of the run [s]."""
        return min(
            (event for event in self.events if event > time + 1e-9), default=float(self.times[-1])
        )

    @property
    def faults(self) -> list[str]:
        watched = [str(f["message"]) for f in self.findings if f["kind"] in UNSTABLE]
        odd = [] if self.finite else ["the response is not finite"]
        gone = self.tripped
        slips = [] if self.turned is None or watched else [_turned(self.turned)]
        return odd + watched + slips + ([] if gone is None else [_trip_text(gone)])

    @property
    def resonance(self) -> float | None:
        """The highest voltage [pu], where it is beyond `RESONANCE`; None where it is not, or without a source."""
        if self.source_angle is None or "v" not in self.signals:
            return None
        highest = float(np.max(self.signals["v"]))
        return highest if RESONANCE < highest < np.inf else None

    @property
    def undecided(self) -> list[str]:
        return [str(f["message"]) for f in self.findings if f["kind"] == NOT_JUDGED]

    @property
    def finite(self) -> bool:
        return all(bool(np.isfinite(values).all()) for values in self.signals.values())

    @property
    def _begun(self) -> bool:
        return bool(self.events) and float(self.times[-1]) >= self.events[0]

    @cached_property
    def tripped(self) -> float | None:
        """When the plant stops feeding in, at a bus that has a voltage [s]; None where it does not.

        It has stopped where its apparent power is below `NOTHING` for `GONE` in all, also in many short parts. Of a
        plant that feeds in less than `FED_IN` before the first event this cannot be told, nor of one that leaves a
        small current while its power may be 0 by a droop."""
        if "q" not in self.signals or not self._begun or abs(self.before(self.events[0])) < FED_IN:
            return None
        steady = np.full(self.times.shape, True)
        if {"v_re", "v_im"} <= set(self.signals) and self.finite:
            steady = np.abs(self.frequency - self.f_n) < STEADY
        least = np.where(steady, NOTHING, NO_CURRENT)
        silent = (np.hypot(self.p, self.signals["q"]) < least) & (self.signals["v"] > ALIVE)
        if np.sum(silent) < round(GONE / float(self.times[1] - self.times[0])):
            return None
        edges = np.flatnonzero(np.diff(np.concatenate([[0], silent.astype(int), [0]])))
        return float(self.times[edges[::2][np.argmax(edges[1::2] - edges[::2])]])

    @cached_property
    def turned(self) -> float | None:
        """When the plant is found half a turn or more from where it stood against the source [s]; None where it is not.

        The voltage v + jX·i inside of the plant, with `INSIDE` for X, is looked at in the end of each hold, and from
        one such end to the next: there it may be `HALF_TURN` beyond where it stood at both, as while it swings. Before
        the first event it may be so far from where it stands at it. An X that is larger than the plant's own counts
        the same turns, also those of a limited current: the voltage then encloses the origin all the more."""
        needed = {"p", "q", "v_re", "v_im"}
        if (
            self.source_angle is None
            or not needed <= set(self.signals)
            or not self.finite
            or not self._begun
        ):
            return None
        v = self.signals["v_re"] + 1j * self.signals["v_im"]
        power = self.p + 1j * self.signals["q"]
        inside = (v + 1j * INSIDE * np.conj(power / np.where(np.abs(v) < 1e-6, 1e-6, v))) * np.exp(
            -1j * self.source_angle
        )
        parts = [over_a_period(part, self.times, self.f_n) for part in (inside.real, inside.imag)]
        angle = np.unwrap(np.angle(parts[0] + 1j * parts[1]))
        start = max(0, int(np.searchsorted(self.times, self.events[0])) - 2)
        first = before = float(angle[start])
        if np.abs(angle[: start + 1] - first).max() > HALF_TURN:
            return 0.0
        looked = start
        for begin in self.events:
            end = self.until(begin)
            if end - begin < HOLD or end > self.times[-1] + 1e-9:
                continue
            last = self.within(end - LATEST, end)
            settled = float(np.median(angle[last]))
            if abs(settled - first) > HALF_TURN:
                return begin
            part = angle[looked : last.stop]
            beyond = np.abs(part - np.clip(part, min(before, settled), max(before, settled)))
            if beyond.max() > HALF_TURN:
                worst = float(self.times[looked + int(np.argmax(beyond))])
                return max(event for event in (0.0, *self.events) if event <= worst + 1e-9)
            looked, before = last.stop, settled
        return None

    @property
    def broken(self) -> str:
        """Why criteria beside that of holding together have no meaning, in words; empty where they have."""
        first = min(
            (f for f in self.findings if f["kind"] in UNSTABLE),
            key=lambda f: float(f["time"]),
            default=None,
        )
        if first is not None:
            return f"{_IN_WORDS.get(first['kind'], 'the run fails')} from t = {float(first['time']):g} s on"
        if not self.finite:
            return "the response is not finite"
        if self.turned is not None:
            return _turned(self.turned)
        return "" if self.tripped is None else _trip_text(self.tripped)


def _turned(time: float) -> str:
    return f"it slips after t = {time:g} s: the voltage behind its current is half a turn or more from where it was"


def _trip_text(time: float) -> str:
    return f"it feeds in nothing from t = {time:g} s on, as after a trip"


def over_a_period(values: Numbers, times: Numbers, f_n: float) -> Numbers:
    """Mean over the period of the grid before each instant; at the start over what there is."""
    count = max(1, round(1 / f_n / (times[1] - times[0])))
    sums = np.concatenate([[0.0], np.cumsum(values)])
    here = np.arange(1, len(values) + 1)
    first = np.maximum(here - count, 0)
    return np.asarray((sums[here] - sums[first]) / (here - first))
