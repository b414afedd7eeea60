"""A recording at a device's port, in per unit and at even times, and what is odd about it by itself."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from fmus.toolchain.port_variables import SYSTEM_BASE_MVA
from orchestrator.core.arrays import Complex, Numbers
from orchestrator.core.errors import InputError
from orchestrator.core.late import interpolate
from orchestrator.core.options import Option
from orchestrator.output.results.readers import LINE_FREQUENCY
from orchestrator.studies.validation.angle_questions import (
    questions_beside_frequency,
    questions_of_hold,
    questions_of_unit,
)
from orchestrator.studies.validation.averaging import averaged
from orchestrator.studies.validation.channels import RecordedChannel, channels_in, in_base, unit_of
from orchestrator.studies.validation.clipped import clipped_run
from orchestrator.studies.validation.filled import Mask, filled_samples, held_alone, runs_of
from orchestrator.studies.validation.held_power import held_power
from orchestrator.studies.validation.missing_codes import without_codes
from orchestrator.studies.validation.questions import Question, QuestionKind
from orchestrator.studies.validation.stored_twice import stored_twice
from orchestrator.studies.validation.transformer import AT_PORT, Between, Beyond

if TYPE_CHECKING:
    import xarray as xr

SHORT_STEP = 1e-4
"""Communication step [s] of a coupled run, whose held voltage is late by nothing that matters."""

_MOST_KEPT = 100_000  # voltages of short steps, 1.6 MB, that a recording keeps
LEAST_VOLTAGE = 1e-3  # [pu] by which a power is divided for its current
_FEWEST = 20  # samples of a recording that can be compared with anything
_LONGEST_GAP = 0.25  # gap [s] that a straight line bridges in the voltage that drives the device
# gap [s] of P or Q beside a known voltage, from which on a swing's largest error may lie in it
_LONG_UNMEASURED = 0.1
_TURN = 2 * np.pi
_PERIODS_OF_ORDER = 5  # of which the order of the phases is taken
_OTHER_ORDER = (
    3.0  # times the positive sequence, from which on a negative one is the order of the phases
)
_MEASURED = 2e-6  # scatter of a voltage [pu] that no simulation has and each instrument
_SPIKE = 3.0  # jump to one sample and back [pu] that no plant makes
_ROUNDS = 8  # in which the current beyond an impedance is found
_FASTEST_PHASOR = (
    0.0021  # interval [s] below which samples of an angle may be unwrapped at any time
)
_VOLTAGES_KV = (0.4, 0.69, 10, 20, 33, 66, 110, 132, 150, 220, 230, 275, 345, 380, 400, 500, 525)
_LIKELY = (0.3, 1.6)  # magnitude of a voltage [pu], or it is in another unit
_NORMAL = (0.8, 1.2)  # magnitude of the voltage before the event [pu] that is not asked about
_MOST_LOADED = 1.3  # apparent power before the event [pu of the rating] that is not asked about
_LEAST_LOADED = 0.01  # the same that a plant feeds at least
_KILO = 1000.0
_FARTHEST_HZ = 1.0  # a grid's frequency is nearer to the rated one before an event

_VOLTAGES = {"v", "angle", "f", "va", "vb", "vc"}
_POWERS = {"p", "q", "i", "i_angle", "ia", "ib", "ic"}
_PHASORS = np.exp(2j * np.pi / 3 * np.arange(3))


@dataclass(frozen=True)
class PortBases:
    """The meaning of per unit at the port."""

    rating: float  # [MVA]
    rated_hz: float
    kilovolt: float | None = None  # rated voltage, line to line, rms [kV]
    between: Between = AT_PORT  # the meters and the port
    average: float | None = None  # time over which P and Q are averaged [s]; a period where None

    @property
    def averaging(self) -> float:
        """Time over which the powers are averaged before they are compared [s]."""
        return 1 / self.rated_hz if self.average is None else self.average


@dataclass(frozen=True)
class Recording:
    """Voltage and power at the port, at even times.

    ``voltage``: [pu], in a frame that rotates with ``frame_hz``; ``power``: into the grid [pu of the rating], averaged.
    ``good``: where no sample is missing."""

    label: str
    begin: float  # time of the first sample in the recording's own clock [s]
    interval: float  # [s]
    voltage: Complex
    power: Complex
    good: Mask
    driven: Mask  # where no sample of the voltage is missing
    frame_hz: float
    instantaneous: bool
    average: float  # time over which the power is averaged [s], and a response is to be
    channels: Mapping[str, RecordedChannel]
    questions: tuple[Question, ...] = ()
    sha256: str = ""
    angle_unit: str = ""  # that it is said to have
    # sample before a jump → part of the interval after which the voltage jumps; a straight line where none is given
    jumps: Mapping[int, float] = field(default_factory=dict)
    sampled: Complex | None = None  # the power before it was averaged
    bends: bool = False  # whether a phasor runs along smooth curves between samples, and not along straight lines
    # of a device by its communication step [s]; a changed recording begins without
    driving: dict[float, Driving] = field(
        init=False, default_factory=dict, compare=False, repr=False
    )

    @property
    def times(self) -> Numbers:
        """Times since the first sample [s]."""
        return np.asarray(self.interval * np.arange(len(self.voltage)))

    @property
    def ahead(self) -> float:
        """By how much a mean's end is after its time [s].

        Means of dense samples end at their time, so that none before an event holds something of it; a phasor of a
        recorder that sends one a period is of the time around it."""
        return 0.5 * self.average if 2 * self.interval > self.average else 0.0

    @property
    def length(self) -> float:
        return self.interval * (len(self.voltage) - 1)

    @cached_property
    def magnitude(self) -> Numbers:
        """The voltage's magnitude, a mean over the same time as the power's [pu]."""
        sizes: Complex = np.abs(self.voltage).astype(complex)
        if self.ahead:
            return sizes.real
        return averaged(self.times, sizes, self.average, self.times).real

    def current_of(self, power: Complex) -> Complex:
        """Active and reactive current of a power beside this voltage [pu of the rating]: P/|v| + jQ/|v|.

        Both are means over the same time: a mean that still holds the power before a fault, over the voltage within it,
        would be a current that never flowed."""
        return np.asarray(power / np.maximum(self.magnitude, LEAST_VOLTAGE))

    def turned(self, hertz: float) -> Recording:
        """The same in a frame that rotates faster by ``hertz``."""
        if not hertz:
            return self
        back = np.exp(-1j * _TURN * hertz * self.times)
        return replace(self, voltage=self.voltage * back, frame_hz=self.frame_hz + hertz)

    def drives_as(self, other: Recording) -> bool:
        """Return whether a device answers both alike: what was measured of its power is not looked at."""
        mine, others = (
            (one.interval, one.instantaneous, one.average, one.jumps, one.bends)
            for one in (self, other)
        )
        return mine == others and np.array_equal(self.voltage, other.voltage)

    def measured_as(self, other: Recording) -> bool:
        """Return whether both hold the same power, and where it is known."""
        return np.array_equal(self.power, other.power) and np.array_equal(self.good, other.good)

    def driving_in(self, step_size: float) -> Driving:
        """The voltage for the steps of a device; of a recording that is not long, made once."""
        known = self.driving.get(step_size)
        if known is None:
            known = Driving.of(self, step_size)
            if known.held.size <= _MOST_KEPT:
                self.driving[step_size] = known
        return known

    def at(self, times: Numbers) -> Complex:
        """The voltage between samples: instantaneous values along straight lines, phasors by magnitude and angle."""
        for sample, part in self.jumps.items():
            low, high = self.interval * sample, self.interval * (sample + 1)
            inside = (times > low) & (times < high)
            jumped = np.where(times < low + part * self.interval, low, high)
            times = np.where(inside, jumped, times)
        if self.instantaneous:
            found: Complex = np.interp(times, self.times, self.voltage)
            return found
        angle = np.unwrap(np.angle(self.voltage))
        along = _along_cubics if self.bends else np.interp
        magnitude = along(times, self.times, np.abs(self.voltage))
        return np.asarray(magnitude * np.exp(1j * along(times, self.times, angle)))


@dataclass(frozen=True)
class Driving:
    """A recorded voltage for the communication steps of a device.

    ``times``: of the steps' begins and of the last one's end [s]; ``voltage``: at these; ``held``: what short steps in
    each step would hold, shape (steps, short steps in one)."""

    times: Numbers
    voltage: Complex
    held: Complex

    @classmethod
    def of(cls, recording: Recording, step_size: float) -> Driving:
        steps = int(np.ceil(recording.length / step_size - 1e-9))
        times: Numbers = np.asarray(step_size * np.arange(steps + 1))
        parts = max(1, int(np.ceil(step_size / SHORT_STEP - 1e-9)))
        short: Numbers = np.asarray(step_size / parts * np.arange(steps * parts))
        held = np.asarray(recording.at(short).reshape(steps, parts))
        return cls(times, recording.at(times), held)

    @cached_property
    def means(self) -> Complex:
        """Means of what short steps hold, one for each step."""
        return np.asarray(self.held.mean(axis=1))


def _along_cubics(times: Numbers, known: Numbers, values: Numbers) -> Numbers:
    """Values between samples at even times, along cubics whose slopes are those of the samples beside each.

    E. Catmull, R. Rom, A class of local interpolating splines, 1974."""
    slopes = np.gradient(values, known[1] - known[0])
    inside = np.clip(times, known[0], known[-1])
    return np.asarray(interpolate.CubicHermiteSpline(known, values, slopes)(inside))


def read_recording(
    dataset: xr.Dataset,
    label: str,
    bases: PortBases,
    given: Sequence[str] = (),
    place: str | None = None,
) -> Recording:
    """A recording of ours or of somebody else's as voltage and power at the port.

    Raises an `InputError` if channels or units are missing, or it is too short."""
    if "places" in dataset.attrs and not given:
        dataset, place = _of_run(dataset, place, label), None
    channels = channels_in(dataset, place, given, label)
    dataset, of_codes = without_codes(dataset, channels)
    reading = _Reading(dataset, label, bases, channels)
    reading.questions += of_codes
    reading.ask_of_samples()
    voltage, power = reading.voltage(), reading.power()
    return _evened(reading, voltage, power)


def _of_run(dataset: xr.Dataset, place: str | None, label: str) -> xr.Dataset:
    """Voltage, P and Q of one unit of a run of ours, as columns of a recording."""
    import xarray  # noqa: PLC0415 - imported where a recording is there already

    buses = {
        name: where
        for name, where in json.loads(dataset.attrs["places"]).items()
        if " " not in where and f"{name}.i_re" in dataset and f"{where}.v_re" in dataset
    }
    if place is None and len(buses) > 1:
        place = "gfor" if "gfor" in buses else None
    if place is None and len(buses) == 1:
        (place,) = buses
    if not buses:
        raise InputError(
            f"{label}: the run holds no unit's current with its bus's voltage; run the case again with "
            "'record = [\"*\"]' in its [solver]"
        )
    if place is None or place not in buses:
        known = ", ".join(buses)
        raise InputError(
            f"{label}: it is a run with several units; give "
            + Option.PLACE
            + f" with one of {known}"
        )

    def phasor(name: str, what: str) -> Complex:
        real, imaginary = (dataset[f"{name}.{what}_{part}"].values for part in ("re", "im"))
        return np.asarray(real + 1j * imaginary)

    v: Complex = phasor(buses[place], "v")
    s = np.asarray(v * phasor(place, "i").conj() * SYSTEM_BASE_MVA)
    columns = {
        "v": (np.abs(v), "pu"),
        "angle": (np.unwrap(np.angle(v)), "rad"),
        "p": (s.real, "MW"),
        "q": (s.imag, "Mvar"),
    }
    named = {name: ("time", values, {"units": unit}) for name, (values, unit) in columns.items()}
    return xarray.Dataset(named, {"time": dataset["time"].values})


class _Reading:
    """The channels of one recording, brought into per unit."""

    def __init__(
        self,
        dataset: xr.Dataset,
        label: str,
        bases: PortBases,
        channels: Mapping[str, RecordedChannel],
    ) -> None:
        self.dataset, self.label, self.bases, self.channels = dataset, label, bases, channels
        self.times = np.asarray(dataset["time"].values, dtype=float)
        if "time" in channels:
            self.times = self._values("time")[0]
        self.questions: list[Question] = []
        # which samples of P or Q a recorder held, whatever it did with the other
        self.held = {
            role: held_alone(np.asarray(dataset[channels[role].column].values, dtype=float))
            for role in ("p", "q")
            if role in channels
        }
        if len(self.times) < _FEWEST:
            raise InputError(
                f"{label}: it has {len(self.times)} samples; at least {_FEWEST} are compared"
            )

    @property
    def instantaneous(self) -> bool:
        return {"va", "vb", "vc"} <= self.channels.keys()

    @property
    def angle_unit(self) -> str:
        return unit_of(self.channels["angle"], self.dataset) if "angle" in self.channels else ""

    def ask(self, kind: QuestionKind, **figures: object) -> None:
        self.questions.append(Question(kind, figures))

    def filled(self, roles: Collection[str]) -> Mask:
        """Return which samples of these channels a recorder filled with the last value."""
        columns = [
            np.asarray(self.dataset[one.column].values, dtype=float)
            for role, one in self.channels.items()
            if role in roles
        ]
        found = filled_samples(columns) if columns else np.zeros(len(self.times), dtype=bool)
        for role, held in self.held.items():
            if role in roles:
                found |= held
        return found

    @property
    def held_columns(self) -> list[str]:
        """The columns of P and Q of which a recorder held samples."""
        return [self.channels[role].column for role, held in self.held.items() if held.any()]

    def ask_of_samples(self) -> None:
        """Ask about a channel that never moves, and about one sample that stands alone."""
        self._ask_of_line()
        self._ask_of_repeated_rows()
        for role, read in _IN_PER_UNIT.items():
            if role not in self.channels:
                continue
            column = self.channels[role].column
            values = read(self, role)
            known = np.isfinite(values)
            value, times = values[known], self.times[known]
            if len(value) < _FEWEST:
                continue
            if np.ptp(value) == 0:
                figures = {"role": role, "column": column, "count": len(value)}
                self.ask(QuestionKind.STUCK, value=float(self.dataset[column][known][0]), **figures)
            if role == "v" and _scatters(value):
                self._ask_of_still_angle()
            held = None if role == "v" and not _scatters(value) else held_power(times, value)
            if held is not None:
                kind = QuestionKind.MAGNITUDE_HELD if role == "v" else QuestionKind.POWER_HELD
                figures = {"role": role, "column": column, "count": held.count}
                self.ask(kind, usual=held.usual, longest=held.longest, **figures)
            own = known & ~self.held[role] if role in self.held else known
            moved, when = values[own], self.times[own]
            run = clipped_run(moved) if role in ("p", "q") else None
            if run is not None:
                low, high = run
                figures = {"role": role, "column": column, "at": float(when[low])}
                figures |= {
                    "value": float(moved[low]),
                    "length": float(when[high - 1] - when[low]),
                }
                self.ask(QuestionKind.CLIPPED, **figures)
            before, after = value[1:-1] - value[:-2], value[1:-1] - value[2:]
            alone = np.where(before * after > 0, np.minimum(np.abs(before), np.abs(after)), 0.0)
            most = int(alone.argmax())
            if alone[most] > _SPIKE:
                at = float(times[most + 1])
                self.ask(QuestionKind.SPIKE, column=column, jump=float(alone[most]), at=at)

    def _ask_of_line(self) -> None:
        """Ask about a rated frequency that is none of the line which the recorder's file names."""
        line = float(self.dataset.coords.get(LINE_FREQUENCY, 0.0))
        if line and abs(line - self.bases.rated_hz) > _FARTHEST_HZ:
            figures = {"seen": line, "rated": self.bases.rated_hz, "said": True}
            self.ask(QuestionKind.RATED_FREQUENCY, **figures)

    def _ask_of_repeated_rows(self) -> None:
        columns = [
            np.asarray(self.dataset[one.column].values, dtype=float)
            for role, one in self.channels.items()
            if role != "time"
        ]
        interval = float(np.median(np.diff(self.times)))
        period = 1 / (self.bases.rated_hz * interval) if self.instantaneous else 0.0
        block = stored_twice(columns, period)
        if block is not None:
            first, at = (float(self.times[k]) for k in (block.first, block.first + block.later))
            self.ask(QuestionKind.STORED_TWICE, count=block.count, first=first, at=at)

    def _ask_of_still_angle(self) -> None:
        """Ask about an angle that never moves beside a magnitude that an instrument measured."""
        if "angle" not in self.channels:
            return
        column = self.channels["angle"].column
        values = np.asarray(self.dataset[column].values, dtype=float)
        known = values[np.isfinite(values)]
        if len(known) and np.ptp(known) == 0:
            figures = {"role": "angle", "column": column, "count": len(known)}
            self.ask(QuestionKind.STUCK, value=float(known[0]), **figures)

    def voltage(self) -> Complex:
        """[pu], in a frame that rotates with the rated frequency."""
        if self.instantaneous:
            phases = [self._volts(f"v{x}", math.sqrt(2 / 3)) for x in "abc"]
            turn = np.exp(-1j * _TURN * self.bases.rated_hz * self.times)
            self._ask_of_order("v", phases)
            return np.asarray(2 / 3 * (_PHASORS @ np.array(phases)) * turn)
        return np.asarray(self._volts("v", 1.0) * np.exp(1j * self._angle()))

    def power(self) -> Complex:
        """Into the grid [pu of the rating]."""
        found: Complex
        if {"p", "q"} <= self.channels.keys():
            found = self._watts("p") + 1j * self._watts("q")
        elif self.instantaneous and {"ia", "ib", "ic"} <= self.channels.keys():
            phases = [self._amperes(f"i{x}", math.sqrt(2)) for x in "abc"]
            turn = np.exp(-1j * _TURN * self.bases.rated_hz * self.times)
            current = 2 / 3 * (_PHASORS @ np.array(phases)) * turn
            self._ask_of_order("i", phases)
            found = self.voltage() * current.conj()
        elif {"i", "i_angle"} <= self.channels.keys():
            current = self._amperes("i", 1.0) * np.exp(1j * self._values("i_angle")[0])
            found = self.voltage() * current.conj()
        else:
            raise InputError(
                f"{self.label}: currents of phases need voltages of phases beside them, va, vb and vc; or give p and q"
            )
        return np.asarray(found)

    def _ask_of_order(self, what: str, phases: Sequence[Numbers]) -> None:
        """Ask about three phases that follow each other as a, c, b."""
        first = self.times - self.times[0] <= _PERIODS_OF_ORDER / self.bases.rated_hz
        turn = np.exp(-1j * _TURN * self.bases.rated_hz * self.times)
        sizes = [
            abs(np.nanmean((way @ np.array(phases) * turn)[first]))
            for way in (_PHASORS, _PHASORS.conj())
        ]
        if sizes[1] > _OTHER_ORDER * sizes[0]:
            b, c = f"{what}b", f"{what}c"
            remedy = [
                replace(self.channels[one], role=other).as_text() for one, other in ((c, b), (b, c))
            ]
            self.ask(QuestionKind.PHASE_ORDER, what=what, remedy=remedy)

    def _values(self, role: str) -> tuple[Numbers, str]:
        channel = self.channels[role]
        values = np.asarray(self.dataset[channel.column].values, dtype=float)
        return in_base(values, unit_of(channel, self.dataset), channel, self.label)

    def _volts(self, role: str, peak: float) -> Numbers:
        """A voltage [pu]; ``peak``: amplitude of the rated voltage over its rms value between lines."""
        values, base = self._values(role)
        channel = self.channels[role]
        typical = float(np.nanmedian(np.abs(values)))
        of_rated = typical / (self.bases.kilovolt * peak) if self.bases.kilovolt else 0.0
        if (
            not base
            and not _LIKELY[0] < typical < _LIKELY[1]
            and _LIKELY[0] < of_rated < _LIKELY[1]
        ):
            base = "kV"  # the rated voltage was given in it, and the values are near that
        if not base and not _LIKELY[0] < typical < _LIKELY[1]:
            raise InputError(
                f"{self.label}: {channel.column!r} says no unit, and is about {typical:.4g}; "
                "give it, as in " + Option.CHANNEL + f" '{channel.changed(unit='kV')}'"
            )
        if base == "kV" and self.bases.kilovolt is None:
            near = min(_VOLTAGES_KV, key=lambda kV: abs(math.log(kV * peak / max(typical, 1e-9))))
            raise InputError(
                f"{self.label}: {channel.column!r} is in kV; give the rated voltage between "
                "lines, as in " + Option.VOLTAGE + f" '{near:g} kV', the nearest usual one"
            )
        return (
            values / (self.bases.kilovolt * peak)
            if base == "kV" and self.bases.kilovolt
            else values
        )

    def _amperes(self, role: str, peak: float) -> Numbers:
        """A current [pu of the rating]."""
        values, base = self._values(role)
        if base == "kA" and self.bases.kilovolt is None:
            raise InputError(
                f"{self.label}: {self.channels[role].column!r} is in kA; give the rated "
                "voltage between lines, as in " + Option.VOLTAGE + " '400 kV'"
            )
        if base == "kA" and self.bases.kilovolt:
            return values / (peak * self.bases.rating / (math.sqrt(3) * self.bases.kilovolt))
        return values

    def _watts(self, role: str) -> Numbers:
        values, base = self._values(role)
        channel = self.channels[role]
        unit = "MW" if role == "p" else "Mvar"
        if not base:
            raise InputError(
                f"{self.label}: {channel.column!r} says no unit; give it, as in "
                + Option.CHANNEL
                + f" '{channel.changed(unit=unit)}', or in pu, which is of the rating"
            )
        return values if base == "pu" else values / self.bases.rating

    def _angle(self) -> Numbers:
        """[rad], without wraps; from the frequency where there is no angle."""
        if "angle" not in self.channels:
            self.ask(QuestionKind.FREQUENCY_ALONE)
            return self._integrated()
        angle, base = self._values("angle")
        channel = self.channels["angle"]
        raw = np.asarray(self.dataset[channel.column].values, dtype=float)
        if not base:
            raise InputError(
                f"{self.label}: {channel.column!r} says no unit; give it: "
                + Option.CHANNEL
                + f" '{channel.changed(unit='deg')}', or "
                + Option.CHANNEL
                + f" '{channel.changed(unit='rad')}'"
            )
        self.questions += questions_of_unit(raw, self.angle_unit, channel)
        self.questions += questions_of_hold(angle)
        known = np.isfinite(angle)
        angle = angle.copy()
        angle[known] = np.unwrap(angle[known])
        if "f" in self.channels:
            turned = self._integrated()
            angles = (angle, turned)
            frequency = self.channels["f"]
            self.questions += questions_beside_frequency(self.times, angles, channel, frequency)
        return np.asarray(angle)

    def _hertz(self) -> Numbers:
        values, base = self._values("f")
        hertz = values * self.bases.rated_hz if base == "pu" else values
        before = float(np.nanmedian(hertz[: max(5, len(hertz) // 10)]))
        if abs(before - self.bases.rated_hz) > _FARTHEST_HZ:
            self.ask(QuestionKind.RATED_FREQUENCY, seen=before, rated=self.bases.rated_hz)
        return np.asarray(hertz)

    def _integrated(self) -> Numbers:
        deviation = self._hertz() - self.bases.rated_hz
        middle = 0.5 * (deviation[1:] + deviation[:-1]) * np.diff(self.times)
        return np.asarray(_TURN * np.concatenate([[0.0], np.nancumsum(middle)]))


_IN_PER_UNIT: Mapping[str, Callable[[_Reading, str], Numbers]] = {
    "v": lambda reading, role: reading._volts(role, 1.0),
    "p": _Reading._watts,
    "q": _Reading._watts,
}


def _scatters(values: Numbers) -> bool:
    """Return whether a magnitude [pu] scatters from sample to sample in its first part, as a measured one does."""
    first = values[: max(_FEWEST, len(values) // 10)]
    return float(np.diff(first, 2).std()) > _MEASURED


def _evened(reading: _Reading, voltage: Complex, power: Complex) -> Recording:
    """At even times; short gaps are bridged, and the samples there are not compared."""
    times = reading.times
    filled = [reading.filled(roles) for roles in (_VOLTAGES, _POWERS)]
    driven = np.isfinite(voltage) & ~filled[0]
    known = np.isfinite(power) & ~filled[1]
    if (driven & known).sum() < _FEWEST:
        raise InputError(
            f"{reading.label}: {int((driven & known).sum())} samples have voltage, P and Q together; at least "
            f"{_FEWEST} are compared"
        )
    first, last = np.flatnonzero(driven & known)[[0, -1]]
    part = slice(first, last + 1)
    times, voltage, power = times[part], voltage[part], power[part]
    driven, known = driven[part], known[part]
    interval = float(np.median(np.diff(times)))
    even = times[0] + interval * np.arange(round((times[-1] - times[0]) / interval) + 1)
    longest = _longest_gap(reading.label, times[driven], interval)
    v = _voltage_at(even, times[driven], voltage[driven], instantaneous=reading.instantaneous)
    s: Complex = np.interp(even, times[known], power[known])
    drives = _near(even, times[driven], interval)
    good = drives & _near(even, times[known], interval)
    stale = sum(int(one[part].sum()) for one in filled)
    lost = list(runs_of(drives & ~good))
    low, high = max(lost, key=lambda run: run[1] - run[0], default=(0, 0))
    is_long = (high - low) * interval > _LONG_UNMEASURED
    if is_long:
        length, at = (high - low) * interval, float(even[low])
        reading.ask(QuestionKind.UNMEASURED, length=length, at=at)
    missing = int((~(drives if is_long else good)).sum())
    if stale:
        at = float(times[np.flatnonzero(filled[0][part] | filled[1][part])[0]])
        alone = [] if filled[0].any() else reading.held_columns
        figures = {"count": stale, "of": len(even), "at": at, "longest": longest, "columns": alone}
        reading.ask(QuestionKind.FILLED, **figures)
    elif missing:
        of_power = bool(drives.all())
        longest = (high - low) * interval if of_power else longest
        figures = {"count": missing, "of": len(even), "longest": longest, "of_power": of_power}
        reading.ask(QuestionKind.MISSING, **figures)
    recording = Recording(
        label=reading.label,
        begin=float(times[0]),
        interval=interval,
        voltage=v,
        power=s,
        good=good,
        driven=drives,
        frame_hz=reading.bases.rated_hz,
        instantaneous=reading.instantaneous,
        average=reading.bases.averaging,
        channels=reading.channels,
        questions=tuple(reading.questions),
        angle_unit=reading.angle_unit,
    )
    return at_port(recording, reading.bases.between)


def _longest_gap(label: str, times: Numbers, interval: float) -> float:
    """The longest time between two samples of the voltage [s].

    Raises an `InputError` if it is too long for a straight line."""
    gaps = np.diff(times)
    longest = float(gaps.max())
    if longest > max(_LONGEST_GAP, 3 * interval):
        at = float(times[int(gaps.argmax())])
        raise InputError(
            f"{label}: samples of the voltage are missing, or hold the last value, for "
            f"{longest:.3g} s from {at:g} s on; what drives the device there is not "
            "known. Give a part of the recording, with " + Option.START + " and " + Option.STOP
        )
    return longest


def _voltage_at(even: Numbers, times: Numbers, voltage: Complex, *, instantaneous: bool) -> Complex:
    if instantaneous:
        found: Complex = np.interp(even, times, voltage)
        return found
    angle = np.unwrap(np.angle(voltage))
    magnitude = np.interp(even, times, np.abs(voltage))
    return np.asarray(magnitude * np.exp(1j * np.interp(even, times, angle)))


def _near(even: Numbers, times: Numbers, interval: float) -> Mask:
    """Return at which even times there is a sample."""
    nearest = np.clip(np.searchsorted(times, even), 1, len(times) - 1)
    apart = np.minimum(np.abs(even - times[nearest - 1]), np.abs(times[nearest] - even))
    return np.asarray(apart <= 0.51 * interval)


def _averaged(recording: Recording) -> Recording:
    """With means of the power where samples are dense; such as come once a period are means already."""
    if recording.ahead:
        return recording
    times = recording.times
    power = averaged(times, recording.power, recording.average, times)
    return replace(recording, power=power)


def at_port(recording: Recording, between: Between) -> Recording:
    """The measured voltage and power moved from the meters to the port, which lies behind an impedance.

    The samples of the power are moved, and averaged then."""
    power = recording.power if recording.sampled is None else recording.sampled
    voltage = recording.voltage
    if between.impedance:
        voltage, power = _move_to_port(voltage, power, between)
    return _averaged(replace(recording, voltage=voltage, power=power, sampled=power))


def _move_to_port(voltage: Complex, power: Complex, between: Between) -> tuple[Complex, Complex]:
    """Voltage and power at the port.

    If one meter alone is beyond the impedance, the current is that of the power and of a voltage at the same place: a
    few rounds, each of which leaves a tenth of the error."""

    def current_at(place: Complex) -> Complex:
        return np.divide(power, place, out=np.zeros_like(power), where=place != 0).conj()

    z, at_meter, at_port_ = between.impedance, voltage, voltage
    for _ in range(_ROUNDS):
        match between.beyond:
            case Beyond.ALL:
                at_port_ = voltage + z * current_at(voltage)
            case Beyond.VOLTAGE:
                at_meter = at_port_ = np.asarray(voltage + z * current_at(at_port_))
            case Beyond.POWER:
                at_meter = np.asarray(voltage - z * current_at(at_meter))
    return at_port_, np.asarray(at_port_ * current_at(at_meter).conj())


def questions_of_level(before: Recording, v: float, s: complex, bases: PortBases) -> list[Question]:
    """Questions about voltage and power before the event, each beside its likeliest cause."""
    found = []
    level = before.channels.get("v") or before.channels["va"]
    if not _NORMAL[0] < v < _NORMAL[1]:
        causes = {
            1 / math.sqrt(3): ("it is measured to ground", math.sqrt(3)),
            math.sqrt(3): ("the rated voltage is one to ground", 1 / math.sqrt(3)),
            math.sqrt(2): ("it is a peak", 1 / math.sqrt(2)),
            math.sqrt(2 / 3): ("it is the peak to ground", math.sqrt(1.5)),
        }
        near = min(causes, key=lambda ratio: abs(math.log(v / ratio)))
        cause, factor = causes[near] if abs(v / near - 1) < 0.12 else ("", 1 / v)
        figures = {"v": v, "cause": cause, "remedy": level.changed(factor=round(factor, 6))}
        found.append(Question(QuestionKind.VOLTAGE_LEVEL, figures))
    if abs(s) > _MOST_LOADED:
        figures = {"s": abs(s), "rating": bases.rating, "remedy": []}
        if _KILO * _LEAST_LOADED < abs(s) < _KILO * _MOST_LOADED:
            units = {"p": "kW", "q": "kvar"}
            channels = before.channels
            figures["remedy"] = [
                channels[role].changed(unit=unit)
                for role, unit in units.items()
                if role in channels
            ]
        found.append(Question(QuestionKind.RATING, figures))
    return found
