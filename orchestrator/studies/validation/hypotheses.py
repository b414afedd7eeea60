"""Other ways to read a recording, tried where the device does not do as it says: signs, units, clocks, the meter.

Each is judged by the device itself: it starts and runs again as the recording would then have it, and a reading is
named only where most of the error goes away with it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from orchestrator.core.arrays import Complex, Numbers, rms
from orchestrator.core.errors import CosimError
from orchestrator.core.options import Option
from orchestrator.studies.validation.angle_reference import ask_of_lacking_frequency
from orchestrator.studies.validation.causes import cap_of_current
from orchestrator.studies.validation.device import Play, PlayedDevice
from orchestrator.studies.validation.event import (
    EventComparison,
    RecordedEvent,
    cut_event,
    prepare_event,
    rms_error,
    rms_movement,
)
from orchestrator.studies.validation.frames import RATED_HZ, frames_of, grid_of_frames
from orchestrator.studies.validation.lagged import ask_of_lag
from orchestrator.studies.validation.lost_jump import lost_jump
from orchestrator.studies.validation.magnitude import ask_of_magnitude
from orchestrator.studies.validation.questions import Question, QuestionKind
from orchestrator.studies.validation.record import PortBases, Recording, at_port
from orchestrator.studies.validation.transformer import AT_PORT, Between, Beyond
from orchestrator.studies.validation.voltage_clocks import ask_of_voltage_clocks

_UNREADABLE = (
    QuestionKind.OTHER_EVENT,
    QuestionKind.ANGLE_JUMP,
    QuestionKind.ANGLE_REFERENCE,
    QuestionKind.STORED_TWICE,
)
_OFF = (
    0.25  # part of the movement by which a response is off, from which on other readings are tried
)
_NOISY = 1.5  # times the scatter before the event, which is not the response's
_LEAST_OFF = 0.003  # rms error [pu] below which nothing is tried
_EXPLAINS = 0.35  # part of the error that a reading may leave, to be named
_AS_GOOD = 1.15  # times the least error left, up to which the reading that comes first in the list is named
_BEFORE = 1.0  # part of a recording before the event with which readings are tried [s]
_AFTER = 3.0  # part after its begin, the same [s]
_LEAVES = 0.25  # part of the error that another scale may leave: parameters change a size as well
_FOLLOWS = 0.25  # part of the movement that the right unit of the times leaves at most: a device at rest leaves all
_LEAVES_ALONE = (
    0.12  # the same of a meter that stands alone beyond a transformer: wrong reactances are like it
)
_MOST_FACTOR = 2000
_BASE_MVA = 100.0  # of a usual per unit
_BASES_AWAY = (
    0.4,
    2.5,
)  # how far a ratio of movements may be from the base: the device starts elsewhere
_RATINGS_AWAY = (
    1.5,
    20.0,
)  # times by which a rating is off that is asked about: less is a wrong reactance as well
_NEAR_PREFIX = 0.1  # part by which a factor may miss one of ten and be it
_CURRENTS = ("ia", "ib", "ic")
_FRAMES_LEAVE = 0.8  # part of the error that the frequency may leave for which the phasors speak
_RADIAN = 180 / math.pi  # [deg]
_OFF_ELSEWHERE = 0.06  # part of the movement, as above, of a voltage that is measured elsewhere
_TRIED_REACTANCE = 0.12  # of a usual transformer [pu of the rating]
_REACTANCES = 0.04, 0.25  # of which transformers are [pu of the rating]
_PROMISES = 0.5  # part of the error that a straight line may leave, for a run to say what is left
_UNITS_OF_TIME = {"min": 60.0, "ms": 1e-3, "us": 1e-6, "h": 3600.0, "d": 86400.0}
_INTERVALS = 1e-4, 0.2  # between samples of a recording that shows an event [s]
_LENGTHS = 0.5, 1200.0  # of such a recording [s]
_OFF_WHOLE = 0.1, 1e-3
"""By how much samples a second may be off a whole number: as rounded times make, and as a part of them."""

_LEAST_CLOCK = 0.004  # delay [s] that is named, and at least
_SAMPLES_CLOCK = 0.6  # so many samples
_ALIKE = 0.25  # part by which the delays of P and Q may differ and be one clock's
_CLOCK_LEAVES = 0.6  # part of the error that is left once the clocks are alike, to be named
_AT_ONCE = 0.1  # time after the event's begin in which a right reading shows already [s]
_FEWEST_AT_ONCE = 5  # samples of that time at least: slow ones may not hold the event's moment
_MOST_AT_ONCE = 0.75
"""Part of the movement in that time which a reading leaves at most where a limit of the current is likely as well.

A right sign leaves 0.03 to 0.65 of it beside most wrong parameters, a sign that stands for a limit 1.1 and more: later
the limited plant's Q is near the other model's with the sign turned."""
_FOLLOWED = 0.15
"""Part of the samples after the event at which the model may follow the recording as it is, not with the sign turned.

Beside plants that came to a limit of the current after a quarter of a second it did at 0.25 to 0.36 of them, beside
wrong signs and a wrong parameter at 0.07 and less."""
_FOLLOWS_BETTER = (
    0.5  # times the error with the sign turned, below which a sample is followed as it is
)
_BEYOND_SCATTER = 3.0  # times the scatter that this error has at least
_LIMITED = 1.0, math.inf
"""Times after the event's begin in which a limit of the current is looked for [s]: a peak makes none in the first."""


@dataclass(frozen=True)
class Reading:
    """Another way to read a recording: what is changed, and how ``--channel`` says so."""

    name: str
    roles: tuple[str, ...]
    factor: float
    change: Callable[[Recording], Recording]
    of_unit: str = ""  # of the angle, where only one in that unit may be meant so
    leaves: float = _EXPLAINS  # part of the error that it may leave, to be named
    swaps: bool = False  # its two channels change their places
    turns: int = 0  # its three channels do, each by so many places
    unit: str = ""  # that says so, in place of the factor
    rating: float = 0.0  # of the device, that says so [MVA]
    of_size: bool = False  # P and Q are scaled as they would be by another rating

    def fits(self, recording: Recording) -> bool:
        """Return whether a recording may be meant so: it has the channels, in the unit."""
        channels = recording.channels
        if not set(self.roles) <= channels.keys():
            return False
        return self.of_unit in ("", recording.angle_unit)

    def remedy(self, recording: Recording) -> list[str]:
        """Return what ``--channel`` takes to read the recording so."""
        channels = recording.channels
        if self.rating:
            return [f"{Option.SET} S_n={self.rating:g}"]
        if self.swaps:
            first, second = self.roles
            return [channels[second].taken_for(first), channels[first].taken_for(second)]
        if self.turns:
            others = self.roles[self.turns :] + self.roles[: self.turns]
            return [
                replace(channels[other], role=role).as_text()
                for role, other in zip(self.roles, others, strict=True)
            ]
        if self.unit:
            return [channels[role].changed(unit=self.unit) for role in self.roles]
        return [channels[role].changed(factor=round(self.factor, 6)) for role in self.roles]

    def scales(self) -> tuple[float, float]:
        """Return by what it multiplies P and Q."""
        p, q = (abs(self.factor) if role in self.roles else 1.0 for role in ("p", "q"))
        return p, q


def _power(p: float, q: float) -> Callable[[Recording], Recording]:
    """A change of P and Q by factors."""

    def changed(recording: Recording) -> Recording:
        power = p * recording.power.real + 1j * q * recording.power.imag
        return replace(recording, power=np.asarray(power))

    return changed


def _swapped(recording: Recording) -> Recording:
    power = recording.power.imag + 1j * recording.power.real
    return replace(recording, power=np.asarray(power))


def _power_turned(thirds: int) -> Callable[[Recording], Recording]:
    """A change of the power's angle by thirds of a turn, as of currents that are of another phase."""
    way = np.exp(2j * np.pi / 3 * thirds)
    return lambda recording: replace(recording, power=np.asarray(recording.power * way))


def _angle(factor: float) -> Callable[[Recording], Recording]:
    def changed(recording: Recording) -> Recording:
        angle = np.unwrap(np.angle(recording.voltage))
        turned = np.abs(recording.voltage) * np.exp(1j * factor * angle)
        return replace(recording, voltage=np.asarray(turned))

    return changed


READINGS_OF_SIGN = (
    Reading("P counts into the plant", ("p",), -1, _power(-1, 1)),
    Reading("Q counts into the plant", ("q",), -1, _power(1, -1)),
    Reading("P and Q count into the plant", ("p", "q"), -1, _power(-1, -1)),
)
READINGS = (
    *READINGS_OF_SIGN,
    Reading("P and Q are of one phase", ("p", "q"), 3, _power(3, 3), "", _LEAVES, of_size=True),
    Reading("P is of one phase", ("p",), 3, _power(3, 1), "", _LEAVES),
    Reading("Q is of one phase", ("q",), 3, _power(1, 3), "", _LEAVES),
    Reading("P and Q are in each other's place", ("p", "q"), 1, _swapped, "", _LEAVES, swaps=True),
    Reading(
        "the currents are each of the next phase",
        _CURRENTS,
        1,
        _power_turned(-1),
        "",
        _LEAVES,
        turns=2,
    ),
    Reading(
        "the currents are each of the phase before",
        _CURRENTS,
        1,
        _power_turned(1),
        "",
        _LEAVES,
        turns=1,
    ),
    Reading("the angle is in radians", ("angle",), _RADIAN, _angle(_RADIAN), of_unit="deg"),
    Reading("the angle is in degrees", ("angle",), 1 / _RADIAN, _angle(1 / _RADIAN), of_unit="rad"),
    Reading("the angle has the other sign", ("angle",), -1, _angle(-1)),
)


def question_readings(comparison: EventComparison, bases: PortBases) -> list[Question]:
    """Return what another reading of the recording, or another clock, would explain."""
    event = comparison.event
    if any(one.kind in _UNREADABLE for one in comparison.questions):
        return []  # no reading makes one event of two, and none brings samples back
    error, moved = rms_error(comparison.played.power, event), rms_movement(event)
    scatter = (comparison.noise["p"].scatter, comparison.noise["q"].scatter)
    excess = [max(e * e - (_NOISY * n) ** 2, 0) ** 0.5 for e, n in zip(error, scatter, strict=True)]
    off = [one > max(_LEAST_OFF, _OFF * way) for one, way in zip(excess, moved, strict=True)]
    named = list(ask_of_magnitude(comparison))[:1] if any(off) else []
    if any(off) and not named:
        named = _likeliest(comparison, bases, math.hypot(*error))
    if any(off) and not named:
        named = list(_time_unit(comparison, bases, math.hypot(*error)))
    if named:
        return named
    whole = math.hypot(*error)
    explained = [
        *lost_jump(comparison),
        *_clock(comparison, whole),
        *ask_of_voltage_clocks(comparison),
    ]
    if not comparison.lacks_limit:  # whose part a lag would play
        explained += ask_of_lag(comparison)
    if whole > max(_LEAST_OFF, _OFF_ELSEWHERE * math.hypot(*moved)):
        explained += _meter_elsewhere(comparison, bases, whole)
    if whole > _LEAST_OFF and _is_off_later(comparison):
        explained += _rated_otherwise(comparison, whole)
    # what leaves more than the plant moved explains nothing, as of a model that falls out of step
    explained = [one for one in explained if one[0] * whole <= math.hypot(*moved)]
    if explained:
        return [min(explained, key=lambda one: one[0])[1]]
    if any(one.keeps_open for one in comparison.questions):
        return []
    rated = comparison.device.rated_hz
    return ask_of_lacking_frequency(event.recording, event.windows, comparison.played.power, rated)


def _is_off_later(comparison: EventComparison) -> bool:
    """Return whether the error is some part of the movement, in the whole or after the event alone.

    During a fault P and Q move so far that a swing of another frequency is little beside it."""
    event = comparison.event
    recording = event.recording
    error = comparison.played.power - recording.power
    moved = recording.power - event.start.power
    parts = [recording.times > event.windows.begin, recording.times > event.windows.end]
    rms = [
        [float(np.sqrt(np.mean(np.abs(one[part & recording.good]) ** 2))) for one in (error, moved)]
        for part in parts
        if (part & recording.good).any()
    ]
    return any(off > _OFF_ELSEWHERE * way for off, way in rms)


def sign_that_starts(device: PlayedDevice, event: RecordedEvent, bases: PortBases) -> str:
    """Name the sign of P, Q or both with which a device starts that refuses the recording as it is read.

    Empty where none helps, or where P counts out of the plant."""
    before = event.start.power.real
    if before >= 0:
        return ""
    near = cut_event(event, _AFTER, _BEFORE)
    for reading in READINGS_OF_SIGN:
        if reading.fits(event.recording) and [*_trials_of(device, near, reading, bases)]:
            typed = " ".join(
                (Option.CHANNEL + f" '{one}'") for one in reading.remedy(event.recording)
            )
            return f"P is {before:.3g} pu before the event; if {reading.name}, give {typed}: so the device starts"
    return ""


def _likeliest(comparison: EventComparison, bases: PortBases, error: float) -> list[Question]:
    """The one reading that explains the most, where it explains enough.

    What leaves more than the plant moved explains nothing: a model that is out of step has an error that any reading at
    which it stays in step makes smaller. Nor does, beside a limit that the plant shows, what explains only later: a
    reading holds from the first moment."""
    event, device = comparison.event, comparison.device
    near = cut_event(event, _AFTER, _BEFORE)
    here = math.hypot(*rms_error(comparison.near_power(near), near))
    readings = [x for x in (*READINGS, *_scalings(comparison)) if x.fits(event.recording)]
    changed = [_read_so(near, reading.change, bases) for reading in readings]
    read = filter(None, changed)
    device.announce([Play(device.rough, one.recording, one.start) for one in read])
    tried = [
        (trial.rest_of_error, reading)
        for reading, known in zip(readings, changed, strict=True)
        for trial in _trials_of(device.rough, near, reading, bases, known)
        if trial.rest_of_error <= reading.leaves * here
    ]
    if not tried:
        return []
    least = min(left for left, _ in tried)
    best = next(reading for left, reading in tried if left <= _AS_GOOD * least)
    most = min(best.leaves * error, math.hypot(*rms_movement(event)))
    remedy, more = best.remedy(event.recording), dict[str, float]()
    if best.of_size and "S_n" in device.description.variables:
        more = {"rating": device.rating, "other_rating": device.rating / best.factor}
    told = {"reading": best.name, "error": error}
    return [
        Question(
            QuestionKind.READ_OTHERWISE,
            {**told, "left": trial.rest_of_error, "remedy": remedy, **more},
        )
        for trial in _trials_of(device, event, best, bases)
        if trial.rest_of_error <= most
        and (trial.holds_at_once or not _shows_limit(comparison))
        and not (best in READINGS_OF_SIGN and _followed_as_it_is(comparison, trial))
    ]


def _shows_limit(comparison: EventComparison) -> bool:
    """Return whether the plant's current stays at a level that the model's exceeds, at once or later."""
    recording = comparison.event.recording
    since = recording.times - comparison.event.windows.begin
    for length in _LIMITED:
        part = recording.good & (since <= length)
        powers = [comparison.played.power[part]], [recording.power[part]]
        if cap_of_current(*powers, [np.abs(recording.voltage[part])]) is not None:
            return True
    return False


def _scalings(comparison: EventComparison) -> Iterator[Reading]:
    """Factors by which the device moves more than the recording, or less: of P and Q, or a prefix of one.

    First the bases of a per unit that was read as MW, then whole numbers."""
    event = comparison.event
    part = event.recording.good & (event.recording.times > event.windows.begin)
    way: Complex = (event.recording.power - event.start.power)[part]
    own: Complex = (comparison.played.power - comparison.played.rest)[part]
    both = np.concatenate([way.real, way.imag]), np.concatenate([own.real, own.imag])
    yield from _per_unit(comparison, _ratio(*both))
    yield from _of_rating(comparison, _ratio(*both))
    factor = _whole_factor(*both)
    if factor:
        change = _power(factor, factor)
        said = _scale_name("P and Q are", factor)
        yield Reading(said, ("p", "q"), factor, change, leaves=_LEAVES, of_size=True)
    p, q = _whole_factor(way.real, own.real), _whole_factor(way.imag, own.imag)
    if _is_prefix(p) and not _is_prefix(q):
        yield Reading(_scale_name("P is", p), ("p",), p, _power(p, 1), "", _LEAVES)
    if _is_prefix(q) and not _is_prefix(p):
        yield Reading(_scale_name("Q is", q), ("q",), q, _power(1, q), "", _LEAVES)


def _per_unit(comparison: EventComparison, ratio: float) -> Iterator[Reading]:
    """P and Q in per unit of the rating, or of a base of 100 MVA, if the movements are not too far from it."""
    channels, rating = comparison.event.recording.channels, comparison.device.rating
    if not {"p", "q"} <= channels.keys() or any(channels[x].unit == "pu" for x in "pq"):
        return
    for base, name in ((rating, "the rating"), (_BASE_MVA, f"{_BASE_MVA:g} MVA")):
        if _BASES_AWAY[0] < ratio / base < _BASES_AWAY[1]:
            said, change = f"P and Q are in per unit of {name}", _power(base, base)
            unit = "pu" if base == rating else ""
            yield Reading(said, ("p", "q"), base, change, leaves=_LEAVES, unit=unit)


def _of_rating(comparison: EventComparison, ratio: float) -> Iterator[Reading]:
    """P and Q of a plant of another rating, if the device has its own from its file alone."""
    device = comparison.device
    away = max(ratio, 1 / ratio) if ratio > 0 else 0.0
    if device.rating_is_told or not _RATINGS_AWAY[0] < away < _RATINGS_AWAY[1]:
        return
    rating = float(f"{device.rating / ratio:.3g}")
    factor = device.rating / rating
    said = f"is the plant's rating {rating:g} MVA, and not the {device.rating:g} MVA of the model's file"
    change = _power(factor, factor)
    yield Reading(said, ("p", "q"), factor, change, leaves=_LEAVES_ALONE, rating=rating)


def _scale_name(which: str, factor: float) -> str:
    said = f"1/{factor:g} of" if factor > 1 else f"{1 / factor:g} times"
    return f"{which} {said} the plant's: another prefix of the unit, or so many units"


def _whole_factor(way: Numbers, own: Numbers) -> float:
    """By what a movement is to be multiplied to be the device's: a whole number or its inverse; 0 where it is none."""
    ratio = _ratio(way, own)
    if ratio <= 0:
        return 0.0
    count = max(ratio, 1 / ratio)
    power = 10 ** round(np.log10(count))
    whole = power if abs(count / power - 1) < _NEAR_PREFIX else round(count)
    if not 2 <= whole <= _MOST_FACTOR:
        return 0.0
    return float(whole) if ratio > 1 else 1 / whole


def _ratio(way: Numbers, own: Numbers) -> float:
    """By what a movement is to be multiplied to be the device's; 0 where nothing moves."""
    size = float(way @ way)
    return float(way @ own) / size if size > 0 else 0.0


def _is_prefix(factor: float) -> bool:
    """Return whether a factor is of tens or thousands, as units have it."""
    return factor > 0 and factor != 1 and float(np.log10(factor)).is_integer()


@dataclass(frozen=True)
class _Trial:
    """A device's answer to a recording that is read otherwise: the event as it then is, and the power."""

    reading: Reading
    event: RecordedEvent
    power: Complex

    @property
    def rest_of_error(self) -> float:
        """The rms error that the reading leaves, per unit of the power as it is read now."""
        errors = zip(rms_error(self.power, self.event), self.reading.scales(), strict=True)
        return math.hypot(*(error / scale for error, scale in errors))

    @property
    def holds_at_once(self) -> bool:
        """Return whether it leaves nothing but scatter before the event, and little of the first movement after it.

        One that is of P alone, or of Q, shows there."""
        recording, windows = self.event.recording, self.event.windows
        error = self._as_read(self.power - recording.power)
        moved = self._as_read(recording.power - self.event.start.power)
        before = windows.part("before", recording.times) & recording.good
        since = recording.times - windows.begin
        length = max(_AT_ONCE, _FEWEST_AT_ONCE * recording.interval)
        first = (since > 0) & (since <= length) & recording.good
        least = _LEAST_OFF * max(self.reading.scales())
        scatter = _NOISY * rms(moved[before])
        most = math.hypot(scatter, _MOST_AT_ONCE * rms(moved[first]))
        return rms(error[before]) <= max(least, scatter) and rms(error[first]) <= max(least, most)

    def followed_at(self, played: Complex, event: RecordedEvent, scatter: float) -> float:
        """Return at which part of the samples after an event a device follows the recording as it is much better."""
        here = np.abs(self._as_read(played - event.recording.power))
        turned = np.abs(self._as_read(self.power - self.event.recording.power))
        better = (here < _FOLLOWS_BETTER * turned) & (turned > _BEYOND_SCATTER * scatter)
        after = (event.recording.times > event.windows.begin) & event.recording.good
        return float(better[after].mean())

    def _as_read(self, power: Complex) -> Complex:
        """The part of a power that the reading is of: P, Q or both."""
        if self.reading.roles == ("p",):
            return np.asarray(power.real, dtype=complex)
        if self.reading.roles == ("q",):
            return np.asarray(power.imag, dtype=complex)
        return power


def _followed_as_it_is(comparison: EventComparison, trial: _Trial) -> bool:
    """Return whether the device follows the recording as it is for so long that no sign can be wrong."""
    scatter = math.hypot(*(comparison.noise[one].scatter for one in "pq"))
    followed = trial.followed_at(comparison.played.power, comparison.event, scatter)
    return followed > _FOLLOWED


def _read_so(
    event: RecordedEvent, change: Callable[[Recording], Recording], bases: PortBases
) -> RecordedEvent | None:
    """The event as it is after a change of its recording; None where it cannot be read so."""
    try:
        return prepare_event(change(event.recording), bases, event.windows)
    except CosimError:
        return None


def _trials_of(
    device: PlayedDevice,
    event: RecordedEvent,
    reading: Reading,
    bases: PortBases,
    known: RecordedEvent | None = None,
) -> Iterator[_Trial]:
    """A device's answer to a recording that is read otherwise; nothing where it cannot start so.

    ``known``: the event as it then is, where that was found before."""
    with device.trials.trial(reading.name, of_reading=True):
        changed = known or prepare_event(reading.change(event.recording), bases, event.windows)
        yield _Trial(reading, changed, device.play(changed.recording, changed.start).power)


def _meter_elsewhere(
    comparison: EventComparison, bases: PortBases, error: float
) -> Iterator[tuple[float, Question]]:
    """A transformer between meters and port that explains most of the error, and the part that is left."""
    if bases.between.impedance:
        return
    near = cut_event(comparison.event, _AFTER, _BEFORE)
    tried = {one: _read_so(near, _beyond(_TRIED_REACTANCE, one), bases) for one in Beyond}
    device = comparison.device
    read = filter(None, tried.values())
    device.announce([Play(device, one.recording, one.start) for one in read])
    for beyond, known in tried.items():
        yield from _meters_beyond(comparison, bases, error, (beyond, near, known))


def _beyond(reactance: float, beyond: Beyond) -> Callable[[Recording], Recording]:
    """A change by a transformer between meters and port."""
    return lambda recording: at_port(recording, Between(1j * reactance, beyond))


def _meters_beyond(
    comparison: EventComparison,
    bases: PortBases,
    error: float,
    tried: tuple[Beyond, RecordedEvent, RecordedEvent | None],
) -> Iterator[tuple[float, Question]]:
    """A transformer beyond some meters.

    ``tried``: these meters, a part of the event, and how that is with a usual transformer where it can be read so."""
    beyond, near, known = tried
    device = comparison.device

    def misses(event: RecordedEvent, reactance: float, read: RecordedEvent | None) -> Complex:
        change = _beyond(reactance, beyond)
        changed = read or prepare_event(change(event.recording), bases, event.windows)
        played = device.play(changed.recording, changed.start)
        part = event.recording.good & (event.recording.times > event.windows.begin)
        return np.asarray((played.power - changed.recording.power)[part])

    part = near.recording.good & (near.recording.times > near.windows.begin)
    here: Complex = (comparison.near_power(near) - near.recording.power)[part]
    left = math.inf
    with device.trials.trial(
        f"a transformer between port and meters{_which(beyond)}", of_reading=True
    ):
        way = misses(near, _TRIED_REACTANCE, known) - here
        size = float(np.sum(np.abs(way) ** 2))
        times = -float(np.real(np.vdot(way, here))) / size if size > 0 else 0.0
        reactance = times * _TRIED_REACTANCE
        rest = float(np.sum(np.abs(here + times * way) ** 2) / np.sum(np.abs(here) ** 2))
        likely = _REACTANCES[0] <= abs(reactance) <= _REACTANCES[1] and rest < _PROMISES**2
        if not likely:
            return
        left = float(np.sqrt(np.mean(np.abs(misses(comparison.event, reactance, None)) ** 2)))
    if left <= (_LEAVES if beyond is Beyond.ALL else _LEAVES_ALONE) * error:
        figures = {"reactance": reactance, "error": error, "left": left, "of": str(beyond)}
        yield left / error, Question(QuestionKind.METER_ELSEWHERE, figures)


def _which(beyond: Beyond) -> str:
    return "" if beyond is Beyond.ALL else f" of {beyond} alone"


def _time_unit(comparison: EventComparison, bases: PortBases, error: float) -> Iterator[Question]:
    """Another unit of the times that explains most of the error."""
    whole = comparison.event.recording
    if "time" in whole.channels:
        return
    for unit, seconds in _UNITS_OF_TIME.items():
        interval, length = seconds * whole.interval, seconds * whole.length
        if not (
            _INTERVALS[0] <= interval <= _INTERVALS[1] and _LENGTHS[0] <= length <= _LENGTHS[1]
        ):
            continue
        if _is_whole(1 / whole.interval) and not _is_whole(1 / interval):
            continue  # 1000 samples a second are no 16.67 of minutes
        timed = replace(whole, interval=interval, begin=seconds * whole.begin)
        left, moved = math.inf, 0.0
        with comparison.device.trials.trial(f"times in {unit}", of_reading=True):
            event = prepare_event(at_port(timed, AT_PORT), bases)
            near = cut_event(event, _AFTER, _BEFORE)
            power = comparison.device.play(near.recording, near.start).power
            left, moved = (math.hypot(*one) for one in (rms_error(power, near), rms_movement(near)))
        if left <= min(_LEAVES * error, _FOLLOWS * moved):
            figures = {"unit": unit, "interval": whole.interval, "length": whole.length}
            figures |= {"error": error, "left": left, "remedy": f"time=time in {unit}"}
            yield Question(QuestionKind.TIME_UNIT, figures)
            return


def _is_whole(rate: float) -> bool:
    """Return whether so many samples a second are a whole number, as recorders take them."""
    return round(rate) > 0 and abs(rate - round(rate)) <= _OFF_WHOLE[0] + _OFF_WHOLE[1] * rate


def _rated_otherwise(comparison: EventComparison, error: float) -> Iterator[tuple[float, Question]]:
    """The other usual rated frequency, if it explains most of the error; phasors have none by themselves."""
    event, device = comparison.event, comparison.device
    others = [one for one in RATED_HZ if abs(one - device.rated_hz) > 1]
    if "f_n" not in device.description.variables or len(others) != 1:
        return
    near, (hertz,) = cut_event(event, _AFTER, _BEFORE), others
    other = device.with_values({"f_n": hertz})
    here = math.hypot(*rms_error(comparison.near_power(near), near))
    left = math.inf
    spoken_for = grid_of_frames(event.recording) == hertz
    leaves = _FRAMES_LEAVE if spoken_for else _LEAVES_ALONE
    with device.trials.trial(f"f_n = {hertz:g}", of_reading=True):
        power = other.play(near.recording, near.start).power
        if math.hypot(*rms_error(power, near)) > max(_LEAVES, leaves) * here:
            return
        left = math.hypot(*rms_error(other.play(event.recording, event.start).power, event))
    if left <= leaves * error:
        figures = {"seen": hertz, "rated": device.rated_hz, "error": error, "left": left}
        if spoken_for:
            figures["frames"] = frames_of(event.recording)
        yield left / error, Question(QuestionKind.RATED_FREQUENCY, figures)


def _clock(comparison: EventComparison, error: float) -> Iterator[tuple[float, Question]]:
    """P and Q, or one of them, that come later than the model's by one time, and the part of the error that is left."""
    event = comparison.event
    interval = event.recording.interval
    delays = {
        name: one.delay
        for name, one in comparison.signals.items()
        if name in ("p", "q") and one.delay is not None and comparison.beyond_doubt(name)
    }
    least = max(_LEAST_CLOCK, _SAMPLES_CLOCK * interval)
    times, own = event.recording.times, comparison.played.power
    alone = (("p",), ("q",)) if error > _LEAST_OFF else ()
    for signals in (("p", "q"), *alone):
        late = [delays[name] for name in signals if name in delays]
        delay = float(np.mean(late)) if late else 0.0
        if abs(delay) < least or np.ptp(late) > max(_ALIKE * abs(delay), interval):
            continue
        shifted: Complex = np.interp(times - delay, times, own)
        p = shifted.real if "p" in signals else own.real
        q = shifted.imag if "q" in signals else own.imag
        left = math.hypot(*rms_error(np.asarray(p + 1j * q), event))
        if left <= _CLOCK_LEAVES * error:
            which = " and ".join(signals).upper().replace("AND", "and")
            figures = {"delay": delay, "error": error, "left": left, "together": len(late)}
            of = {"which": which, "signals": list(signals)}
            yield left / error, Question(QuestionKind.CLOCKS, figures | of)
            return
