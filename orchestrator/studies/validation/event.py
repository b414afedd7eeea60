"""One recorded event beside a device: the operating point before it, the response, and how far it is off."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum

import numpy as np

from orchestrator.core.arrays import Complex, Numbers
from orchestrator.devices.fmi.port_mapping import BoundDescription
from orchestrator.studies.validation.angle_jump import ask_of_angle_jump
from orchestrator.studies.validation.angle_reference import ask_of_swing_before
from orchestrator.studies.validation.device import OperatingStart, Played, PlayedDevice
from orchestrator.studies.validation.figures import (
    SIGNALS,
    ErrorFigures,
    SignalFigures,
    SignalNoise,
    compare_signals,
    errors_in,
    noise_in,
    signals_of,
)
from orchestrator.studies.validation.filled import Mask, runs_of
from orchestrator.studies.validation.frames import frames_of, grid_of_frames
from orchestrator.studies.validation.held_by_samples import fastest_corner, is_too_fast
from orchestrator.studies.validation.other_event import ask_of_other_event
from orchestrator.studies.validation.out_of_step import StepLoss, slip, step_loss
from orchestrator.studies.validation.parameters import NEVER
from orchestrator.studies.validation.plant_out_of_step import plant_loss
from orchestrator.studies.validation.questions import Question, QuestionKind
from orchestrator.studies.validation.record import PortBases, Recording, questions_of_level
from orchestrator.studies.validation.ring_gaps import ask_of_gaps
from orchestrator.studies.validation.second_event import second_event
from orchestrator.studies.validation.setpoint import ask_of_setpoint, without_step
from orchestrator.studies.validation.smoothed import ask_of_smoothing
from orchestrator.studies.validation.trend import PARTS_OF_TREND, trend_of
from orchestrator.studies.validation.windows import Windows, find_windows

_SHORTEST_BEFORE = 0.1  # a window before the event [s] that shows a steady state
_MOVES_BEFORE = 0.02  # movement of P or Q before the event [pu] that is no steady state
_LEAST_BEFORE = 0.003  # the same, where the event moves P and Q little
_PART_BEFORE = 0.05  # part of the largest movement from the event on
_SCATTERS = 8.0  # standard deviations of a mean that its noise may move it
_FARTHEST_HZ = 1.0  # from the rated frequency before the event
_STARTS_ELSEWHERE = 0.02  # power at rest [pu] by which a device misses what was measured
_NO_NOISE = 2e-6  # scatter of P and Q before the event [pu] that no instrument has
_TOO_GOOD = 1e-4  # median error [pu] beside a recording without noise, as the model's own
_MOVED = 2e-3  # rms movement [pu] that is an event
_SLOWER_THAN = 0.015  # interval between samples [s] of which is said what it cannot show
_SHOWS_SLIP = 0.003
"""Interval between samples [s] up to which a model that turns past its plant is wrong.

Of 26 right models beside samples 1 ms apart none did; beside samples 5 ms apart one of two."""
_SUCH = 3  # times of a device that are named, which the samples do not show
_SHORT_GAP = 0.02  # [s]: over a period voltages are means, and a gap hides little
_IN_GAP = 0.3  # part of the largest change of the voltage, from which on a gap hides an event
_SAME_SAMPLE = 1e-9  # [pu] by which samples of one recording differ that was read twice
_FEWEST_BEFORE = 30  # samples before an event that a part of the recording keeps
_ENDS = (
    QuestionKind.OUT_OF_STEP,
    QuestionKind.SLIP,
    QuestionKind.PLANT_OUT_OF_STEP,
    QuestionKind.ANGLE_JUMP,
)
_OF_SAMPLES = ("voltage", "power", "good", "driven")


@dataclass(frozen=True)
class RecordedEvent:
    """A recording at the operating point and in the frame in which it drives a device."""

    recording: Recording
    windows: Windows
    start: OperatingStart
    questions: tuple[Question, ...] = ()

    def same_as(self, other: RecordedEvent) -> bool:
        """Return whether another recording holds the same samples, of which the same event is looked at."""
        mine, its = self.recording, other.recording
        if len(mine.voltage) != len(its.voltage) or self.windows.begin != other.windows.begin:
            return False
        return bool(
            np.allclose(mine.voltage, its.voltage, rtol=0, atol=_SAME_SAMPLE)
            and np.allclose(mine.power, its.power, rtol=0, atol=_SAME_SAMPLE)
        )


class JumpDoubt(StrEnum):
    """Why the error around a jump of the voltage is known only so well."""

    SAMPLES = "samples"  # when it jumped between two of them
    STEP = "step"  # the device sees it at the begin of a step
    FIXED_STEP = "fixed step"  # likewise, of a device that refuses a shorter one


@dataclass(frozen=True)
class EventComparison:
    """The response of a device at an event, beside what was measured."""

    event: RecordedEvent
    device: PlayedDevice
    played: Played
    # window → signal → figures
    errors: Mapping[str, Mapping[str, ErrorFigures]]
    noise: Mapping[str, SignalNoise]
    signals: Mapping[str, SignalFigures]
    questions: tuple[Question, ...] = field(default=())
    doubt: JumpDoubt | None = None  # that is counted as noise in the errors

    def beyond_doubt(self, signal: str) -> bool:
        """Return whether a signal is off by more than scatter, samples and step may make of it, in the mean."""
        found = [
            of[signal] for name, of in self.errors.items() if name != "before" and signal in of
        ]
        return any(one.mean_abs_error > one.mean_abs_of_noise for one in found)

    @property
    def lacks_limit(self) -> bool:
        """Return whether the model's current is above a limit that it does not represent."""
        return any(one.kind is QuestionKind.OVER_LIMIT for one in self.questions)

    @property
    def largest_error(self) -> tuple[str, str, ErrorFigures]:
        """Window, signal and figures of the largest error of P or Q."""
        found = [
            (window, signal, of[signal])
            for window, of in self.errors.items()
            for signal in ("p", "q")
            if signal in of
        ]
        return max(found, key=lambda one: one[2].max_error)

    def near_power(self, near: RecordedEvent) -> Complex:
        """The device's power in a part of the recording [pu of the rating]."""
        whole = self.event.recording
        first = round((near.recording.begin - whole.begin) / whole.interval)
        return np.asarray(self.played.power[first : first + len(near.recording.power)])

    @property
    def measured(self) -> dict[str, Numbers]:
        """The measured signals, by name [pu of the rating]."""
        return signals_of(self.event.recording, self.event.recording.power)

    @property
    def simulated(self) -> dict[str, Numbers]:
        """The device's signals, by name [pu of the rating]."""
        return signals_of(self.event.recording, self.played.power)


def prepare_event(
    recording: Recording, bases: PortBases, windows: Windows | None = None
) -> RecordedEvent:
    """Find windows and the operating point before the event, and turn the frame with the frequency before it."""
    windows = windows or find_windows(recording)
    before = windows.part("before", recording.times) & recording.good
    hertz = _frequency_before(recording, before)
    recording = recording.turned(hertz)
    v, s = recording.voltage[before], recording.power[before]
    turned = np.angle(v.mean()) if len(v) else 0.0
    voltage = complex(np.abs(v).mean() * np.exp(1j * turned))
    start = OperatingStart(voltage, complex(s.mean()))
    asked = list(recording.questions)
    if abs(hertz) > _FARTHEST_HZ:
        seen = bases.rated_hz + hertz
        asked.append(
            Question(QuestionKind.RATED_FREQUENCY, {"seen": seen, "rated": bases.rated_hz})
        )
    grid = grid_of_frames(recording)
    if grid is not None and abs(grid - bases.rated_hz) > _FARTHEST_HZ:
        figures = {"frames": frames_of(recording), "grid": grid, "rated": bases.rated_hz}
        asked.append(Question(QuestionKind.FRAMES, figures))
    asked += questions_of_level(recording, abs(voltage), start.power, bases)
    asked += _of_windows(recording, windows, before)
    asked += ask_of_smoothing(recording, windows)
    second = second_event(recording, windows)
    if second is not None:
        windows = replace(windows, second=second)
        figures = {"at": recording.begin + second, "first": recording.begin + windows.begin}
        asked.append(Question(QuestionKind.SECOND_EVENT, figures))
    asked += ask_of_gaps(recording, windows)
    unique = {one.kind: one for one in reversed(asked)}
    return RecordedEvent(recording, windows, start, tuple(reversed(unique.values())))


def cut_event(event: RecordedEvent, after: float, before: float = math.inf) -> RecordedEvent:
    """The event without what comes so long after its begin [s] or later, and so long before it or earlier."""
    whole, windows = event.recording, event.windows
    stop = int((windows.begin + after) / whole.interval) + 2
    kept = max(round(before / whole.interval), _FEWEST_BEFORE) if before < math.inf else stop
    first = max(0, round(windows.begin / whole.interval) - kept)
    cut = {name: getattr(whole, name)[first:stop] for name in _OF_SAMPLES}
    if whole.sampled is not None:
        cut["sampled"] = whole.sampled[first:stop]
    earlier = first * whole.interval
    recording = replace(whole, begin=whole.begin + earlier, **cut)
    first_end, second = (
        None if one is None else one - earlier for one in (windows.first_end, windows.second)
    )
    moved = replace(
        windows,
        begin=windows.begin - earlier,
        end=windows.end - earlier,
        length=recording.length,
        first_end=first_end,
        second=second if second is not None and second < recording.length else None,
    )
    return replace(event, recording=recording, windows=moved)


def _frequency_before(recording: Recording, before: Mask) -> float:
    """By how much the frequency before the event is off the frame's [Hz]."""
    times, angle = recording.times[before], np.angle(recording.voltage[before])
    if len(times) < 3:
        return 0.0
    slope = np.polyfit(times - times.mean(), np.unwrap(angle), 1)[0]
    return float(slope / (2 * np.pi))


def _of_windows(recording: Recording, windows: Windows, before: Mask) -> list[Question]:
    found = []
    if not windows.seen:
        found.append(Question(QuestionKind.NO_EVENT, {"last": recording.length}))
    if windows.begin < _SHORTEST_BEFORE:
        found.append(Question(QuestionKind.SHORT_BEFORE, {"length": windows.begin}))
    elif windows.seen:
        moves = trend_of(recording.power[before])
        if moves > _least_movement(recording, windows, before):
            found.append(Question(QuestionKind.NO_STEADY_STATE, {"moves": moves}))
    return found + _gaps(recording, windows)


def _gaps(recording: Recording, windows: Windows) -> list[Question]:
    """The gap of the voltage in which the event begins, or much of it happens."""
    lag = max(1, round(_SHORT_GAP / recording.interval))
    voltage = recording.voltage
    largest = float(np.abs(voltage[lag:] - voltage[:-lag]).max(initial=0.0))
    for low, high in runs_of(~recording.driven):
        begin, end = (recording.interval * k for k in (low - 1, high))
        if end - begin <= _SHORT_GAP + 0.5 * recording.interval or not windows.seen:
            continue
        inside = begin - recording.interval <= windows.begin <= end
        if inside or _jump_within(voltage, low, high) > _IN_GAP * largest:
            figures = {"length": end - begin, "at": recording.begin + begin, "of_power": False}
            return [Question(QuestionKind.GAP_AT_EVENT, figures)]
    return _gaps_of_power(recording, windows)


def _gaps_of_power(recording: Recording, windows: Windows) -> list[Question]:
    """The gap of P or Q beside a known voltage that holds some of the window during the event."""
    if not windows.seen or any(one.kind is QuestionKind.UNMEASURED for one in recording.questions):
        return []
    for low, high in runs_of(recording.driven & ~recording.good):
        begin, end = (recording.interval * k for k in (low - 1, high))
        is_short = end - begin <= _SHORT_GAP + 0.5 * recording.interval
        if not is_short and begin < windows.end and end > windows.begin:
            figures = {"length": end - begin, "at": recording.begin + begin, "of_power": True}
            return [Question(QuestionKind.GAP_AT_EVENT, figures)]
    return []


def _jump_within(voltage: Complex, low: int, high: int) -> float:
    """By how much the lines before and after a gap, each as long as it, miss each other in its middle [pu]."""
    length = high - low + 1
    before, after = voltage[max(0, low - length) : low], voltage[high : high + length]
    if min(len(before), len(after)) < 3:
        return 0.0
    middle = 0.5 * (low + high - 1)
    places = np.arange(low - len(before), low) - middle, np.arange(len(after)) + high - middle
    ends = [
        np.polyfit(at, values, 1)[1] for at, values in zip(places, (before, after), strict=True)
    ]
    return float(abs(ends[1] - ends[0]))


def _slow_samples(comparison: EventComparison) -> list[Question]:
    """A question that names the shortest times of a device, which few samples do not show."""
    interval = comparison.event.recording.interval
    if interval <= _SLOWER_THAN:
        return []
    device = comparison.device
    times = {
        info.name: float(device.value(info.name))
        for info in device.description.variables.values()
        if info.causality == "parameter"
        and info.type == "Real"
        and info.unit == "s"
        and info.name not in NEVER
    }
    fast = sorted(name for name, value in times.items() if is_too_fast(value, interval))
    such = ", ".join(f"{name} = {times[name]:g} s" for name in fast[:_SUCH])
    figures = {
        "interval": interval,
        "fastest": fastest_corner(interval),
        "such": f" ({such})" if such else "",
    }
    return [Question(QuestionKind.SLOW_SAMPLES, figures)]


def _least_movement(recording: Recording, windows: Windows, before: Mask) -> float:
    """The movement before an event from which on there is no steady state [pu].

    It is more than noise makes, and some of what follows, as in a record that begins in a swing."""
    following = windows.part("after", recording.times) | windows.part("during", recording.times)
    part = _PART_BEFORE * trend_of(recording.power[following])
    least = min(_MOVES_BEFORE, max(_LEAST_BEFORE, part))
    return max(least, _SCATTERS * _scatter(recording, before))


def _scatter(recording: Recording, before: Mask) -> float:
    """How far the means that tell the movement before an event scatter by noise [pu].

    Samples within the time over which the power is averaged hold the same noise."""
    lag = max(1, round(recording.average / recording.interval))
    power = recording.power[before]
    changes = power[lag:] - power[:-lag]
    if not len(changes):
        return 0.0
    independent = max(1.0, len(power) / PARTS_OF_TREND / lag)
    return float(max(np.std(changes.real), np.std(changes.imag)) / np.sqrt(2 * independent))


def compare_with(device: PlayedDevice, event: RecordedEvent) -> EventComparison:
    """Let the recorded voltage drive a device, and count its errors."""
    return judge_response(device, event, device.play(event.recording, event.start))


def judge_response(device: PlayedDevice, event: RecordedEvent, played: Played) -> EventComparison:
    recording, windows = event.recording, event.windows
    measured = signals_of(recording, recording.power)
    simulated = signals_of(recording, played.power)
    error = {name: simulated[name] - measured[name] for name in SIGNALS}
    noise = noise_before(event, played)
    errors = {}
    for name in windows.parts:
        of_signals = {
            signal: errors_in(recording, error, windows, (name, signal), noise[signal])
            for signal in SIGNALS
        }
        errors[name] = {signal: one for signal, one in of_signals.items() if one is not None}
    comparison = EventComparison(
        event=event,
        device=device,
        played=played,
        errors={name: of for name, of in errors.items() if of},
        noise=noise,
        signals=compare_signals(recording, played.power, windows),
    )
    asked = event.questions + tuple(_of_response(comparison))
    return replace(comparison, questions=asked)


def noise_before(event: RecordedEvent, played: Played) -> dict[str, SignalNoise]:
    """The scatter of each signal's error before the event; of a device that was not at rest, the recording's alone."""
    recording = event.recording
    scattering = signals_of(recording, recording.power)
    if played.still:
        simulated = signals_of(recording, played.power)
        scattering = {name: simulated[name] - scattering[name] for name in SIGNALS}
    return {name: noise_in(recording, scattering[name], event.windows) for name in SIGNALS}


def rms_error(power: Complex, event: RecordedEvent) -> tuple[float, float]:
    """Rms error of P and Q from the event on [pu of the rating]."""
    recording = event.recording
    part = recording.good & (recording.times > event.windows.begin)
    error = power[part] - recording.power[part]
    return float(np.sqrt(np.mean(error.real**2))), float(np.sqrt(np.mean(error.imag**2)))


def rms_movement(event: RecordedEvent) -> tuple[float, float]:
    """Rms movement of the measured P and Q from the operating point, from the event on [pu of the rating]."""
    return rms_error(np.full(len(event.recording.power), event.start.power), event)


def _without_noise(comparison: EventComparison) -> list[Question]:
    """A recording that is a simulation, and one that the model itself may have made."""
    event = comparison.event
    measured = [noise_in(event.recording, comparison.measured[s], event.windows) for s in "pq"]
    scatter = max(one.scatter for one in measured)
    if scatter > _NO_NOISE:
        return []
    error = _usual_error(comparison.played.power, event)
    figures = {"scatter": scatter, "error": error}
    if error < _TOO_GOOD and max(rms_movement(event)) > _MOVED:
        return [Question(QuestionKind.TOO_GOOD, figures)]
    return [Question(QuestionKind.NO_NOISE, figures)]


def _usual_error(power: Complex, event: RecordedEvent) -> float:
    """The median error of P and Q [pu of the rating]: a few samples of a fast transient do not count."""
    error = (power - event.recording.power)[event.recording.good]
    return float(np.median(np.maximum(np.abs(error.real), np.abs(error.imag))))


def _of_response(comparison: EventComparison) -> list[Question]:
    event, played = comparison.event, comparison.played
    found = []
    off = played.rest - event.start.power
    if abs(off) > _STARTS_ELSEWHERE:
        figures = {
            "p": played.rest.real,
            "q": played.rest.imag,
            "p_measured": event.start.power.real,
            "q_measured": event.start.power.imag,
        }
        found.append(Question(QuestionKind.START, figures))
    found += _assumed_bases(comparison.device)
    found += _over_limit(comparison)
    found += _slow_samples(comparison)
    found += _without_noise(comparison)
    return found + _first_asked(comparison)


def _first_asked(comparison: EventComparison) -> list[Question]:
    """The first question of those of which one makes the others likely."""
    recording, windows = comparison.event.recording, comparison.event.windows
    own = comparison.played.power
    return (
        ask_of_swing_before(recording, windows, own)
        or _of_plant(comparison)
        or ask_of_other_event(recording, own)
        or _of_step(comparison)
        or ask_of_setpoint(recording, windows, own)
    )


def _over_limit(comparison: EventComparison) -> list[Question]:
    over, recording = comparison.played.over_limit, comparison.event.recording
    if over is None:
        return []
    current = np.abs(recording.current_of(recording.power)[recording.good])
    figures = {
        "at": recording.begin + over.begin,
        "length": over.length,
        "largest": over.largest,
        "plant": float(current.max()),
    }
    return [Question(QuestionKind.OVER_LIMIT, figures)]


def _of_plant(comparison: EventComparison) -> list[Question]:
    """An angle that jumps by itself, or a plant that falls out of step, which make the right model fall as well."""
    event = comparison.event
    recording = event.recording
    jumps = ask_of_angle_jump(recording, comparison.played.power)
    loss = plant_loss(recording, event.windows)
    if jumps or loss is None:
        return jumps
    figures = {"at": recording.begin + loss.time, "turns": loss.turns}
    return [Question(QuestionKind.PLANT_OUT_OF_STEP, figures)]


def _of_step(comparison: EventComparison) -> list[Question]:
    """A model that falls out of step where the plant did not; a note where it comes back, or is off by little.

    Beside slow samples the right model may fall so, for the voltage between them is not known: that is no note."""
    event = comparison.event
    recording = event.recording
    loss = step_loss(recording, event.windows, comparison.played.power)
    slips = None if loss else slip(recording, event.windows, comparison.played.power)
    if slips is not None and recording.interval <= _SHOWS_SLIP:
        return [Question(QuestionKind.SLIP, {"at": recording.begin + slips})]
    if slips is not None:
        late = recording.times >= slips
        own, seen = (float(x.real[late].mean()) for x in (comparison.played.power, recording.power))
        loss = StepLoss(slips, own, seen)
    if loss is None:
        return []
    figures = {"at": recording.begin + loss.time, "own": loss.own, "seen": loss.seen}
    return [Question(QuestionKind.OUT_OF_STEP, figures)]


def loses_step(comparison: EventComparison) -> bool:
    """Return whether the model falls out of step, the plant does, or the angle jumps by itself."""
    return any(one.kind in _ENDS for one in comparison.questions)


def in_step(comparison: EventComparison) -> EventComparison:
    """The comparison up to where the model falls out of step, the plant does, or the angle jumps by itself.

    The same where none of them happens after the event's begin."""
    event = comparison.event
    for one in comparison.questions:
        if one.kind in _ENDS:
            at = float(one.figures["at"]) - event.recording.begin
            if at <= event.windows.end:
                return comparison
            return compare_with(comparison.device, cut_event(event, at - event.windows.begin))
    return comparison


def before_setpoint(comparison: EventComparison) -> RecordedEvent:
    """The event up to where a setpoint changed, of which no cause is told; the whole event where none did.

    Without the step, where it changed within the event, as nothing of that is before it."""
    event = comparison.event
    for one in comparison.questions:
        if one.kind is QuestionKind.SETPOINT:
            if one.figures.get("within"):
                return replace(event, recording=without_step(event.recording, one))
            stop = float(one.figures["stop"]) - event.recording.begin
            return cut_event(event, stop - event.windows.begin)
    return event


def _assumed_bases(device: PlayedDevice) -> list[Question]:
    """Ask about what stands for a rating or a rated frequency that the device does not have."""
    if isinstance(device.description, BoundDescription):
        return []
    values = {"S_n": f"{device.rating:g} MVA", "f_n": f"{device.rated_hz:g} Hz"}
    missing = [name for name in values if name not in device.description.variables]
    if not missing:
        return []
    assumed = " and ".join(values[name] for name in missing)
    figures = {"missing": " and no ".join(missing), "assumed": assumed}
    return [Question(QuestionKind.BASES_ASSUMED, figures)]
