"""All criteria at one reactance, from the two systems' modes and responses."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from orchestrator.core.arrays import Numbers
from orchestrator.linear.spectra.modes import damping_ratio
from orchestrator.simulation.watch.finding import NOT_JUDGED, UNSTABLE
from orchestrator.simulation.watch.limits import told_of
from orchestrator.studies.certification import criteria
from orchestrator.studies.certification.margins import CriterionMargin
from orchestrator.studies.certification.point import CONVERTER, FREQUENCY, POWER, PointResult
from orchestrator.studies.certification.request import row_of
from orchestrator.studies.certification.swings import (
    LARGEST_RATIO,
    SLOWEST_PERIOD,
    SwingTest,
    slow_part,
    swing_test,
)

# time after the event [s] from which the signal counts as a free response and is decomposed into
# modes
SETTLING = 0.5
RATED_POWER = 1350.0  # active power of the converter in the norm's study [MW]
_SAME_POWER = 0.01  # largest relative difference of the power at the start
_LEAST_MOVEMENT = 1e-6  # least movement of an active damping controller's output [pu]
# A mode gets a remark if the converter lowers its damping by more than this [percentage points]
LOWERED = 2.0


@dataclass(frozen=True)
class TimeVerdict:
    """The time-domain criterion on one response: either of its two ways is enough."""

    signal: str
    swings: SwingTest
    other_reading: SwingTest
    modal: criteria.ModalTest

    @property
    def accepted(self) -> bool:
        return self.swings.accepted or self.modal.accepted

    @property
    def margin(self) -> float | None:
        """The better of the two ways, since either is enough; None where the better one has no figure."""
        ratio, least = (
            self.swings.ratio,
            min((m.damping_percent for m in self.modal.modes), default=None),
        )
        ways = [
            (self.swings.accepted, None if ratio is None else 1 - abs(ratio) / LARGEST_RATIO),
            (
                self.modal.accepted,
                None if least is None else least / (100 * criteria.LEAST_DAMPING) - 1,
            ),
        ]
        if any(accepted and margin is None for accepted, margin in ways):
            return None
        return max(
            (m for accepted, m in ways if m is not None and accepted == self.accepted), default=None
        )


@dataclass(frozen=True)
class PointVerdict:
    X_L: float
    modes: tuple[criteria.ModeVerdict, ...]
    time: TimeVerdict | None
    # the time-domain criterion on the system without the converter, for comparison only
    base_time: TimeVerdict | None
    faults: tuple[str, ...]  # why the point is not accepted; empty where it is
    neighbours: tuple[criteria.ModeVerdict, ...] = ()
    unknown: str = ""  # why the point could not be judged at all; empty where it was
    # the least damped judged mode without the converter [rad/s]; None where there is none.
    base_critical: complex | None = None
    # what the active damping controllers change; None where none is
    pod: criteria.PodEffect | None = None

    @property
    def name(self) -> str:
        return row_of(self.X_L)

    @property
    def is_judged(self) -> bool:
        return not self.unknown

    @property
    def accepted(self) -> bool:
        return self.is_judged and not self.faults

    @property
    def eigenvalues_accepted(self) -> bool:
        return bool(self.modes) and all(m.accepted for m in self.modes)

    @property
    def lowered(self) -> tuple[criteria.ModeVerdict, ...]:
        """Modes, judged or listed, whose damping is more than two points lower than without the converter."""
        every = (*self.modes, *self.neighbours)
        return tuple(
            m
            for m in every
            if (b := m.before_percent) is not None and b - m.damping_percent > LOWERED
        )

    def margins(self) -> list[CriterionMargin]:
        """Every mode that the norm asks 5 % of, the response, and whatever else the point is not accepted for."""
        place = f"X_L = {self.X_L:g} pu"
        found = [
            CriterionMargin(
                place, f"damping at {m.frequency_hz:.3f} Hz", margin, m.accepted, m.reason
            )
            for m in self.modes
            if (margin := damping_ratio(m.eigenvalue) / criteria.LEAST_DAMPING - 1) >= 0
            or not m.accepted
        ]  # a mode below 5 % that is accepted was below without the converter
        if self.time is not None:
            reasons = f"{self.time.swings.reason}; {self.time.modal.reason}"
            found.append(
                CriterionMargin(place, "response", self.time.margin, self.time.accepted, reasons)
            )
        if self.faults and all(margin.accepted for margin in found):
            found.append(CriterionMargin(place, "stable", None, False, "; ".join(self.faults)))
        return found

    def of_base_critical(self) -> str:
        """The effect of the converter on the least damped mode, in words; empty if there was no such mode."""
        if self.base_critical is None:
            return ""
        was = f"the least damped mode without the converter, {_hertz_and_percent(self.base_critical)},"
        found = [m for m in (*self.modes, *self.neighbours) if m.before == self.base_critical]
        if not found:
            return f"{was} has no counterpart with the converter"
        return f"{was} is at {_hertz_and_percent(found[0].eigenvalue)} with the converter"


def _hertz_and_percent(value: complex) -> str:
    return f"{value.imag / (2 * np.pi):.3f} Hz with {100 * damping_ratio(value):.2f} %"


def watched(pod: str) -> str:
    """SG1's active power; the frequency at bus 2 where a POD-P is active."""
    return FREQUENCY if "p" in pod.removeprefix("none") else POWER


def judge(
    having: PointResult,
    lacking: PointResult,
    pod: str,
    event_time: float,
    known: Sequence[criteria.ModeVerdict] | None = None,
) -> PointVerdict:
    """All criteria at one reactance, from the system with and without the converter.

    ``known``: Which mode is which without the converter; None where the modes' shapes are to tell it."""
    if lacking.failure:
        unknown = f"the study failed without the converter: {lacking.failure}"
        return PointVerdict(having.X_L, (), None, None, (), unknown=unknown)
    faults = _wrong(having, pod, event_time)
    if having.failure:
        faults = [f"the study failed with the converter: {having.failure}"]
    modes: tuple[criteria.ModeVerdict, ...] = ()
    beside: tuple[criteria.ModeVerdict, ...] = ()
    critical, unknown = (
        None if lacking.modes is None else criteria.critical_mode(lacking.modes),
        not_judged(having.findings),
    )
    if having.stability and having.stability["stable"] is None:
        unknown = f"nothing shows that the system with the converter is stable: {having.stability['sentence']}"
    if having.modes is not None and lacking.modes is not None:
        matched = list(
            criteria.matched_modes(having.modes, lacking.modes, having.components)
            if known is None
            else known
        )
        modes, beside = (
            tuple(criteria.judged_modes(matched)),
            tuple(criteria.neighbouring_modes(matched)),
        )
        faults += [f"{m.frequency_hz:.3f} Hz: {m.reason}" for m in modes if not m.accepted]
        fault = criteria.stability_fault(
            having.growth, lacking.growth, having.stability, lacking.stability
        )
        faults += [fault] if fault else []
    if not having.failure and not modes:
        faults.append(
            "no mode from 0.1 to 1.5 Hz was found, so that the eigenvalue criterion judged nothing"
        )
    signal = watched(pod)
    time, base = (judge_response(point, signal, event_time) for point in (having, lacking))
    if time is not None and not time.accepted:
        faults.append(
            f"response of {signal}: {time.swings.reason}; and by its modes: {time.modal.reason}"
        )
    if time is None and not having.failure:
        faults.append(f"there is no response of {signal}")
    return PointVerdict(
        having.X_L,
        modes,
        time=time,
        base_time=base,
        faults=tuple(faults),
        neighbours=beside,
        unknown="" if faults else unknown,
        base_critical=critical,
    )


def _wrong(having: PointResult, pod: str, event_time: float) -> list[str]:
    wrong = []
    power = float("nan") if having.power is None else having.power
    if not abs(power - RATED_POWER) <= _SAME_POWER * RATED_POWER:
        wrong.append(
            f"the converter feeds in {power:.4g} MW at the start and not {RATED_POWER:g} MW, so that it is "
            "not the norm's study; check whether it is connected, its rating, and what the binding makes of "
            "its current"
        )
    for name, values in having.signals.items():
        if not np.isfinite(values).all():
            at = having.times[int(np.argmax(~np.isfinite(values)))]
            wrong.append(f"{name} is not finite from t = {at:g} s on")
    told = told_of(having.findings, CONVERTER)
    if told:
        wrong.append(str(told["message"]))
    wrong += motion_faults(having.times, having.signals, event_time, having.findings)
    return wrong + [text for letter in "pq" if (text := _idle(having, pod, letter))]


def _idle(having: PointResult, pod: str, letter: str) -> str | None:
    name = f"{CONVERTER}.delta_{letter}_pod"
    values = having.signals.get(name)
    if values is None:
        return None
    moved = float(np.ptp(values))
    moves, named = moved > _LEAST_MOVEMENT, letter in pod.removeprefix("none")
    if named and not moves:
        little = (
            f"moves by {moved:.2g} pu, less than {_LEAST_MOVEMENT:g} pu"
            if moved
            else f"stays at {values[0]:g}"
        )
        return f"POD-{letter.upper()} is said to be active, and {name} {little}: it does nothing"
    if moves and not named:
        return f"POD-{letter.upper()} is said to be off, and {name} moves: it is active"
    return None


def judge_response(point: PointResult, signal: str, event_time: float) -> TimeVerdict | None:
    if signal not in point.signals or point.failure:
        return None
    times, y = point.times, slow_part(point.times, point.signals[signal])
    with_first = swing_test(times, y, event_time, drop_first=False)
    modal = criteria.modal_test(times, y, event_time + SETTLING)
    return TimeVerdict(signal, swing_test(times, y, event_time), with_first, modal)


LARGEST_DEVIATION = 2.5
"""Largest accepted deviation of the frequency at bus 2 from its start [Hz]; the study moves it by about 0.1 Hz."""

LATE_SWING = 0.5
"""Largest accepted swing in the last third of the record, as a part of the swing in the first 10 s after the event.

A mode of 0.1 Hz with 5 % of damping, the slowest and least damped that the norm accepts, keeps 0.29 in 61 s.
"""


def motion_faults(
    times: Numbers,
    signals: Mapping[str, Numbers],
    event_time: float,
    findings: Sequence[Mapping[str, Any]] = (),
) -> Iterator[str]:
    """Loss of synchronism, or no rest: a converter that slips or never stops swinging is not accepted."""
    yield from (str(finding["message"]) for finding in findings if finding["kind"] in UNSTABLE)
    frequency = signals.get(FREQUENCY)
    if frequency is not None and len(times) > 1:
        far = np.abs(frequency - frequency[0]) > LARGEST_DEVIATION
        if far.any():
            yield (
                f"{FREQUENCY} goes from {frequency.min():.4g} to {frequency.max():.4g} Hz, first more than "
                f"{LARGEST_DEVIATION:g} Hz from its start at t = {times[int(np.argmax(far))]:g} s: synchronism is "
                "lost"
            )
    for name in (POWER, FREQUENCY):
        if name in signals and len(times) > 1:
            yield from _late_swing(times, name, signals[name], event_time)


def not_judged(findings: Sequence[Mapping[str, Any]]) -> str:
    """Return what the watch could not judge of a run, in its words; empty where it judged all of it."""
    return "; ".join(
        str(finding["message"]) for finding in findings if finding["kind"] == NOT_JUDGED
    )


def _late_swing(times: Numbers, name: str, signal: Numbers, event_time: float) -> Iterator[str]:
    """The swing from peak to peak in the last third after the event, after removing a straight drift."""
    begin = float(times[-1]) - (float(times[-1]) - event_time) / 3
    first, last = (times >= event_time) & (times <= event_time + SLOWEST_PERIOD), times >= begin
    if last.sum() < 3 or not first.any() or not np.isfinite(signal).all():
        return
    drift = np.polyval(np.polyfit(times[last] - begin, signal[last], 1), times[last] - begin)
    late, early = float(np.ptp(signal[last] - drift)), float(np.ptp(signal[first]))
    if late > LATE_SWING * early:
        yield (
            f"{name} still swings by {late:.3g} from peak to peak from t = {begin:.3g} s to the end, and by "
            f"{early:.3g} in the first {SLOWEST_PERIOD:g} s after the event: more than {LATE_SWING:g} of it, so "
            "that it does not come to rest"
        )
