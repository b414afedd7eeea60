"""Swings of the network's frequency, and what a damping controller (POD) adds to the answers."""

from collections.abc import Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass
from math import pi, sqrt

import numpy as np

from orchestrator.core.arrays import Complex, Numbers
from orchestrator.devices.acceptance.checks.port import of_current, voltage_rows
from orchestrator.devices.acceptance.checks.subject import OperatingAt, Running, Subject
from orchestrator.devices.fmi.port_mapping import BoundDescription

_BASE = 100 * pi  # angular frequency [rad/s] by which an angle turns with 1 pu of deviation
_HERTZ = (0.7, 1.3)  # bounds of the swing's frequency [Hz], that of oscillations between areas
_SWINGS = 1.6  # duration of a swing [s]
LOOKS = (2.0, 5.0, 8.0)  # times [s] at which the answer to a lasting deviation is compared
LATE_LOOKS = (34.0, 40.0)  # the same where something seems to stay
_PLATEAU = 0.5  # time [s] over which the power is averaged where an output stays at its limit
_RESTED = 3.0  # time at rest after strong swings [s]
_WIDEST = 0.01  # largest deviation of the frequency [pu] that every device follows
_MEAN = 0.1  # time [s] over which that is averaged
_BEFORE = 0.1  # time at rest before events [s]
_EVENT = 0.1  # duration of an event [s]
_STRENGTHS = (1.0, 0.5, 0.2)  # of events, in parts of the strongest
_BACK = 0.02  # distance of a power from where it was [pu, S_n] at which the device has come back
_PAUSE = 0.3  # time between events [s]
_ACTS = 0.5  # gain [pu] from which a controller acts at all
_NOISE = 1e-7  # power [pu, S_n] that is rounding


def controllers(subject: Subject) -> tuple[str, ...]:
    """The damping controllers whose switch is known: ``pod_p``, ``pod_q``."""
    variables = subject.description.variables
    return tuple(
        name
        for name in ("pod_p", "pod_q")
        if (info := variables.get(f"{name}.enabled"))
        and info.type == "Boolean"
        and info.causality == "parameter"
    )


def answer_size(size: float) -> float:
    """Power [pu, S_n] from which a swing of the frequency [pu] of that size has an answer."""
    return max(_NOISE, _ACTS * size)


@dataclass(frozen=True)
class FrequencySwing:
    """A deviation of the network's frequency.

    ``size``: its amplitude [pu].
    ``point``: where the device starts; the bench's own point where None.
    ``step_size``: communication step [s]; the subject's own where None.
    ``begin``: when the run begins [s].
    ``rest``: how long the device is at rest before it [s].
    ``lasting``: how long the frequency stays where it went [s]; 0 where it swings.
    ``then``: how long it is watched after that, at the rated frequency [s]."""

    size: float
    point: OperatingAt | None = None
    step_size: float | None = None
    begin: float = 0.0
    rest: float = 0.0
    lasting: float = 0.0
    then: float = 0.0


@dataclass(frozen=True)
class Effect:
    """The part of an answer that one controller adds.

    ``shown``: whether the FMU shows the controller's output, which ``course`` then is; else ``course`` is ``power``.
    ``power``: change of the power at the port that it makes [pu, S_n]."""

    title: str
    size: float
    time: Numbers
    course: Numbers
    power: Numbers
    shown: bool

    @property
    def peak(self) -> float:
        """The largest output [pu, S_n]."""
        return float(np.abs(self.course).max())

    @property
    def least_peak(self) -> float:
        """The largest output, or the largest change of the power, whichever is less [pu, S_n]."""
        return min(self.peak, float(np.abs(self.power).max()))

    def pairs(self, other: "Effect") -> Iterator[tuple[Numbers, Numbers]]:
        """Courses of this one and the other one, in proportion to their swings and at equal times."""
        for mine, its in ((self.course, other.course), (self.power, other.power)):
            yield mine / self.size, np.interp(self.time, other.time, its) / other.size

    def apart(self, other: "Effect", within: float = 0.0) -> float:
        """The largest difference in parts of this one's answer; values may come `within` [s] sooner or later."""
        found = []
        for course, its in ((self.course, other.course), (self.power, other.power)):
            shifts = (-within, 0.0, within)
            moved = np.array([np.interp(self.time + shift, other.time, its) for shift in shifts])
            mine, moved = course / self.size, moved / other.size
            away = np.maximum(mine - moved.max(axis=0), moved.min(axis=0) - mine)
            found.append(float(np.maximum(away, 0.0).max() / np.abs(mine).max()))
        return max(found)

    @property
    def sample_time(self) -> float:
        """Time [s] between two movements of an output that moves in less than half of the steps, else 0."""
        moves = np.flatnonzero(np.diff(self.course))
        if not self.shown or len(moves) < 2 or len(moves) > 0.5 * len(self.course):
            return 0.0
        return float(np.median(np.diff(self.time[moves])))


def likeness(usual: Effect, other: Effect) -> float:
    """Correlation of the controllers' courses, −1 to 1."""
    a, b = next(usual.pairs(other))
    size = sqrt(float(a @ a) * float(b @ b))
    return float(a @ b) / size if size else 0.0


def ratio(usual: Effect, other: Effect) -> float:
    """Answer of the other one in parts of the usual one, of output and power that which is further from 1."""
    parts = [float(np.abs(b).max() / np.abs(a).max()) for a, b in usual.pairs(other)]
    return max(parts, key=lambda part: abs(np.log(max(part, 1e-9))))


class DampingBench:
    """Runs of one subject with its damping controllers on and off; equal runs are made once."""

    lasts = _SWINGS
    widest = _WIDEST

    def __init__(self, subject: Subject, names: tuple[str, ...], point: OperatingAt) -> None:
        self.subject, self.names, self._point = subject, names, point
        self.hertz = float(subject.random("pod, swing").uniform(*_HERTZ))
        self._known: dict[tuple[FrequencySwing, bool | str], Numbers] = {}

    @property
    def titles(self) -> list[str]:
        return [f"POD-{name[-1].upper()}" for name in self.names]

    def value_of(self, name: str) -> float | None:
        """A parameter's value, as used; None where there is no such parameter."""
        info = self.subject.description.variables.get(name)
        if info is None or info.type != "Real" or info.start is None:
            return None
        values = self.subject.use.values
        return float(values.get(name, info.start_number * self._base_of(name)))

    def _base_of(self, name: str) -> float:
        """The rating as delivered in parts of the S_n that is used, where the parameter is a power in MW."""
        described, S_n = self.subject.description, self.subject.use.values.get("S_n")
        if not isinstance(described, BoundDescription) or S_n is None:
            return 1.0
        signal = described.port.signals.get(name)
        return described.port.rating / S_n if signal is not None and signal.per_rating else 1.0

    def declared_limit(self, name: str) -> float | None:
        """The limit of a controller's output [pu, S_n]."""
        return self.value_of(f"{name}.limit")

    def _place(self, name: str) -> int | None:
        """Place of a controller's output among the outputs."""
        wanted = f"delta_{name[-1]}_pod"
        return self.subject.outputs.index(wanted) if wanted in self.subject.outputs else None

    def _settings(self, on: bool | str) -> dict[str, float | bool]:
        """All controllers on or off, or one of them on."""
        return {f"{name}.enabled": on in (True, name) for name in self.names}

    def effects(self, swing: FrequencySwing) -> tuple[Effect, ...]:
        """Give what each controller adds in a swing: the run with it alone on, less the run with all of them off."""
        off = self._rows(swing, on=False)
        return tuple(
            self._effect(name, swing, self._rows(swing, on=name), off) for name in self.names
        )

    def courses(self, swing: FrequencySwing) -> list[Numbers]:
        """Each controller's output [pu, S_n] in a swing, or what it adds to the power where no output shows it."""
        found = []
        for name in self.names:
            on, shown = self._rows(swing, on=name), self._place(name)
            found.append(
                _part(on - self._rows(swing, on=False), name) if shown is None else on[:, 2 + shown]
            )
        return found

    def part(self, course: Numbers, begin: float, end: float) -> Numbers:
        """The rows of a course between two times [s]."""
        h = self.subject.step_size
        return course[round(begin / h) : round(end / h)]

    def time_left(self, wanted: float) -> float:
        """The time that a run lasts [s]: what is wanted, or until its experiment ends."""
        ends = [self.subject.memory.get(end) for end in ("ended_at", "stops_at")]
        return min([wanted, *(0.9 * float(end) for end in ends if end)])

    def together(self, swing: FrequencySwing) -> tuple[Effect, ...]:
        """Give `effects` with all controllers on at once.

        A device without its controllers is taken to answer as it does without a rest before."""
        off = self._rows(FrequencySwing(swing.size, swing.point, swing.step_size), on=False)
        on = self._rows(swing, on=True)
        return tuple(self._effect(name, swing, on, off) for name in self.names)

    def _effect(self, name: str, swing: FrequencySwing, on: Numbers, off: Numbers) -> Effect:
        h = swing.step_size or self.subject.step_size
        time: Numbers = h * np.arange(1, len(on) + 1, dtype=np.float64)
        power, shown = _part(on - off, name), self._place(name)
        course = power if shown is None else on[:, 2 + shown]
        return Effect(f"POD-{name[-1].upper()}", swing.size, time, course, power, shown is not None)

    def _rows(self, swing: FrequencySwing, *, on: bool | str) -> Numbers:
        key = (swing, True if self.names == (on,) else on)
        if key not in self._known:
            self._known[key] = self._run(swing, on)
        return self._known[key]

    def _run(self, swing: FrequencySwing, on: bool | str) -> Numbers:
        subject, before = self.subject, self.subject.start_time
        subject.start_time = swing.begin
        try:
            with subject.running(
                point=swing.point or self._point, parameters=self._settings(on)
            ) as running:
                return self._swing(running, swing)
        finally:
            subject.start_time = before

    def _swing(self, running: Running, swing: FrequencySwing) -> Numbers:
        """Active and reactive power [pu, S_n] and all outputs after each step of a swing."""
        h = swing.step_size or self.subject.step_size
        _still(running, swing.rest, h)
        time = h * np.arange(max(2, round((swing.lasting or _SWINGS) / h)))
        turn = 2 * pi * self.hertz
        angle = _BASE * swing.size * (time if swing.lasting else (1 - np.cos(turn * time)) / turn)
        stays = np.full(round(swing.then / h), angle[-1])
        return _hold(running, np.exp(1j * np.append(angle, stays)), h)

    def apart_after_events(self, size: float, wait: float) -> list[float] | None:
        """By which part of its usual effect each controller's answer differs some time after events.

        The events are the strongest from which the device comes back; None where it comes back from none."""
        rest = self._rows(FrequencySwing(0.0), on=True)
        for strength in _STRENGTHS:
            still = self._after_events(FrequencySwing(0.0), wait, strength)
            if np.abs(still[-1, :2] - rest[-1, :2]).max() < _BACK:
                break
        else:
            return None
        return self._apart(size, self._after_events(FrequencySwing(size), wait, strength) - still)

    def _after_events(self, swing: FrequencySwing, wait: float, strength: float) -> Numbers:
        """The answer to a swing after a dip, a jump, an overvoltage and another dip, on with all controllers."""
        h = self.subject.step_size
        draw = self.subject.random("pod, events")
        angle = draw.choice((-1, 1)) * draw.uniform(0.3, 0.6)
        events = [
            1 - strength * draw.uniform(0.5, 0.8),
            np.exp(1j * strength * angle),
            1 + strength * draw.uniform(0.1, 0.2),
            1 - strength * draw.uniform(0.2, 0.5),
        ]
        with self.subject.running(point=self._point, parameters=self._settings(True)) as running:
            _still(running, _BEFORE, h)
            for factor in events:
                _hold(running, np.full(max(1, round(_EVENT / h)), complex(factor)), h)
                _still(running, _PAUSE, h)
            _still(running, wait, h)
            return self._swing(running, swing)

    def apart_after_switching(self, size: float) -> list[float]:
        """By which part each controller's answer differs where all were switched off and on again twice in the run."""

        def rows(size: float) -> Numbers:
            with self._on() as running:
                for on in (False, True, False, True):
                    running.component.set(self._settings(on))
                    _still(running, _PAUSE, self.subject.step_size)
                return self._swing(running, FrequencySwing(size))

        return self._apart(size, rows(size) - rows(0.0))

    def apart_after_work(self, size: float, strong: float, number: int) -> list[float]:
        """By which part each controller's answer differs some seconds after so many strong swings."""

        def rows(size: float) -> Numbers:
            with self._on() as running:
                for _ in range(number):
                    self._swing(running, FrequencySwing(strong))
                _still(running, _RESTED, self.subject.step_size)
                return self._swing(running, FrequencySwing(size))

        return self._apart(size, rows(size) - rows(0.0))

    def _on(self) -> AbstractContextManager[Running]:
        """A run with all controllers on."""
        return self.subject.running(point=self._point, parameters=self._settings(True))

    def _apart(self, size: float, moved: Numbers) -> list[float]:
        """By which part each controller's usual effect differs from what a swing moves with all of them on."""
        swing = FrequencySwing(size)
        usual = self._rows(swing, on=True) - self._rows(FrequencySwing(0.0), on=True)
        found = []
        for name, effect in zip(self.names, self.effects(swing), strict=True):
            change, shown = _part(moved - usual, name), self._place(name)
            if shown is not None:
                change = moved[:, 2 + shown] - usual[:, 2 + shown]
            found.append(float(np.abs(change).max()) / effect.peak)
        return found

    def plateaus(self, size: float, seconds: float) -> list[float]:
        """The most power [pu, S_n] that each controller adds for a while against a lasting deviation."""
        mean = max(1, round(_PLATEAU / self.subject.step_size))
        found = []
        for effect in self.effects(FrequencySwing(size, lasting=seconds)):
            sums = np.cumsum(effect.power)
            found.append(float(np.abs(sums[mean:] - sums[:-mean]).max()) / mean)
        return found

    def lasting(
        self, size: float, looks: tuple[float, ...] = LOOKS
    ) -> Iterator[tuple[str, str, list[float]]]:
        """Title, name, and answers [pu, S_n] at some times to a lasting deviation; the first is positive."""
        swing = FrequencySwing(0.5 * size, lasting=looks[-1])
        h = self.subject.step_size
        mean = max(1, round(_MEAN / h))
        for name, effect in zip(self.names, self.effects(swing), strict=True):
            ends = [min(len(effect.course), round(look / h)) for look in looks]
            answers = [float(effect.course[end - mean : end].mean()) for end in ends]
            side = -1.0 if answers[0] < 0 else 1.0
            yield effect.title, name, [side * answer for answer in answers]


def _part(change: Numbers, name: str) -> Numbers:
    """The power that a controller moves: active that of POD-P, reactive that of POD-Q."""
    found: Numbers = change[:, 0 if name.endswith("p") else 1]
    return found


def _hold(running: Running, factors: Complex, h: float) -> Numbers:
    """Step with the voltage multiplied by factors; powers [pu, S_n] and outputs after each step, one row each."""
    names = running.subject.inputs
    rows = voltage_rows(running, factors)
    values = running.hold(rows, len(factors), h)
    at = [names.index("v_re"), names.index("v_im")]
    voltage = (running.rest[at] + rows[:, at]) @ (1, 1j)
    power = voltage * of_current(running, values).conj()
    return np.column_stack([power.real, power.imag, values])


def _still(running: Running, seconds: float, h: float) -> None:
    """Leave it at rest."""
    left = round(seconds / h)
    while left > 0:
        some = min(left, 20000)
        running.hold(np.zeros((1, len(running.rest))), some, h)
        left -= some
