"""Events at given times. Each says in the field's words what happens.

Most come down to variables that are set; faults of connections and components set none (`Fault`)."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from math import isfinite, pi, sin
from typing import Literal

from fmus.grid.names import line_variable
from orchestrator.systems.coupling.connections import Connection
from orchestrator.systems.coupling.imperfections import Imperfection

SMALLEST_FAULT_REACTANCE = 1e-5
"""X [pu, 100 MVA] of a fault without impedance: what is left of the voltage is 1e-5 pu for each pu of its current."""

FORCING_POINTS = 200  # values a period by which a forcing follows a sine

ForcingShape = Literal["sine", "square"]

FaultKind = Literal["3-phase", "1-phase", "2-phase", "2-phase-earth"]
"""Phases of a fault: all three to earth, one to earth, two together, two together and to earth."""


@dataclass(frozen=True, slots=True)
class Event:
    """Something that happens at a communication point [s], before the step that starts there."""

    time: float
    component: str

    def settings(self) -> Mapping[str, float | bool]:
        raise TypeError(f"{type(self).__name__} is not a kind of event of its own")

    def changes(self) -> Mapping[str, Mapping[str, float | bool]]:
        return {self.component: self.settings()}

    def __str__(self) -> str:
        values = [
            f"{who}.{name} = {value:g}"
            for who, new in self.changes().items()
            for name, value in new.items()
        ]
        return f"t = {self.time:g} s: {', '.join(values)}"


@dataclass(frozen=True, slots=True)
class LoadChange(Event):
    """A load takes ``scale`` times its power: conductance and susceptance together."""

    load: str
    scale: float

    def settings(self) -> Mapping[str, float | bool]:
        return {f"{self.load}.scale": self.scale}


@dataclass(frozen=True, slots=True)
class LoadSwitching(LoadChange):
    """A load is switched off (``scale`` 0), or on again."""


@dataclass(frozen=True, slots=True)
class LineSwitching(Event):
    """A line is opened at both ends, or closed again."""

    line: str
    connected: bool

    def settings(self) -> Mapping[str, float | bool]:
        return {line_variable(self.line, "connected"): self.connected}


@dataclass(frozen=True, slots=True)
class LineEndSwitching(Event):
    """A line is opened at one end, or closed again; from the other end it stays charged."""

    line: str
    end: Literal["from", "to"]
    connected: bool

    def settings(self) -> Mapping[str, float | bool]:
        return {line_variable(self.line, f"{self.end}_connected"): self.connected}


@dataclass(frozen=True, slots=True)
class ShuntSwitching(Event):
    shunt: str
    connected: bool

    def settings(self) -> Mapping[str, float | bool]:
        return {f"{self.shunt}.connected": self.connected}


@dataclass(frozen=True, slots=True)
class UnitSwitching(Event):
    """A unit is taken from the grid, or put back: the grid's port, and the unit's own breaker where it has one."""

    unit: str
    connected: bool
    has_breaker: bool = True

    def settings(self) -> Mapping[str, float | bool]:
        return {f"{self.unit}.connected": self.connected}

    def changes(self) -> Mapping[str, Mapping[str, float | bool]]:
        own: dict[str, Mapping[str, float | bool]] = {self.unit: {"connected": self.connected}}
        return (own if self.has_breaker else {}) | {self.component: self.settings()}


@dataclass(frozen=True, slots=True)
class BranchChange(Event):
    """A line takes other values of X and, if given, R [pu]."""

    line: str
    X: float
    R: float | None = None

    def settings(self) -> Mapping[str, float | bool]:
        values = {line_variable(self.line, "X"): self.X}
        return values if self.R is None else values | {line_variable(self.line, "R"): self.R}


@dataclass(frozen=True, slots=True)
class PoleSwitching(BranchChange):
    """One of a line's three phases opens, or closes again: X and R are those of the positive sequence then."""

    open: bool = True


@dataclass(frozen=True, slots=True)
class PoleEndSwitching(Event):
    """One of a line's three phases opens at one end alone, or closes again.

    R + jX [pu, 100 MVA] is what the positive sequence meets between the line and its bus then."""

    line: str
    end: Literal["from", "to"]
    R: float = 0.0
    X: float = 0.0
    open: bool = True

    def settings(self) -> Mapping[str, float | bool]:
        pole = line_variable(self.line, f"{self.end}_pole")
        return {f"{pole}.R": self.R, f"{pole}.X": self.X}


@dataclass(frozen=True, slots=True)
class BusFault(Event):
    """A fault at a bus begins, or ends.

    R + jX [pu, 100 MVA] is what the positive sequence meets there: of three phases the fault itself, of fewer with the
    impedances of the other sequences."""

    bus: str
    on: bool
    R: float = 0.0
    X: float = 0.0
    kind: FaultKind = "3-phase"

    def settings(self) -> Mapping[str, float | bool]:
        """The values that the event sets, by variable."""
        return _fault_settings(f"{self.bus}.fault", self.on, self.R, self.X)


@dataclass(frozen=True, slots=True)
class LineFault(Event):
    """A fault along a line begins, or ends, at a part of the way from the from bus; R + jX are as in `BusFault`."""

    line: str
    at: float
    on: bool
    R: float = 0.0
    X: float = 0.0
    kind: FaultKind = "3-phase"

    def settings(self) -> Mapping[str, float | bool]:
        """The values that the event sets, by variable."""
        values = _fault_settings(line_variable(self.line, "fault"), self.on, self.R, self.X)
        place = {line_variable(self.line, "fault.at"): self.at}
        return values | place if self.on else values


def _fault_settings(fault: str, on: bool, R: float, X: float) -> dict[str, float | bool]:
    """Return the values of a fault, by variable; the size of X is at least the grid's smallest reactance."""
    if not on:
        return {f"{fault}.on": False}
    if not isfinite(R):  # no current of another sequence flows, and so none of this one
        return {f"{fault}.on": False}
    return {
        f"{fault}.R": R,
        f"{fault}.X": X if abs(X) > SMALLEST_FAULT_REACTANCE else SMALLEST_FAULT_REACTANCE,
        f"{fault}.on": True,
    }


@dataclass(frozen=True, slots=True)
class ReferenceChange(Event):
    """A reference moves by ``delta`` from its operating point: ``reference`` is e.g. ``exciter.V_ref``."""

    reference: str
    delta: float

    def settings(self) -> Mapping[str, float | bool]:
        scope, _, name = self.reference.rpartition(".")
        return {f"{scope}.delta_{name}" if scope else f"delta_{name}": self.delta}


@dataclass(frozen=True, slots=True)
class ParameterChange(Event):
    """A tunable parameter, or an input that nothing feeds, takes a value."""

    parameter: str
    value: float | bool

    def settings(self) -> Mapping[str, float | bool]:
        return {self.parameter: self.value}


@dataclass(frozen=True, slots=True)
class Fault(Event):
    """An event that sets no variable: nothing that looks at `Event.changes` alone knows of it."""

    def settings(self) -> Mapping[str, float | bool]:
        return {}

    def changes(self) -> Mapping[str, Mapping[str, float | bool]]:
        return {}


@dataclass(frozen=True, slots=True)
class WireFault(Fault):
    """A connection gets an imperfection, in place of another of its kind; ``component`` is the one that it leads to."""

    connection: Connection
    imperfection: Imperfection

    def __str__(self) -> str:
        return f"t = {self.time:g} s: {self.connection}: {self.imperfection}"


@dataclass(frozen=True, slots=True)
class WireRecovery(Fault):
    """An imperfection of a connection ends; what it has permanently holds again."""

    connection: Connection
    imperfection: Imperfection

    def __str__(self) -> str:
        return f"t = {self.time:g} s: {self.connection}: end of {self.imperfection}"


@dataclass(frozen=True, slots=True)
class NotANumber(Fault):
    """All coupled outputs of a component are no numbers any more, as those of an FMU that divides by zero."""

    def __str__(self) -> str:
        return f"t = {self.time:g} s: {self.component} gives no numbers"


@dataclass(frozen=True, slots=True)
class Silence(Fault):
    """A component in a process of its own answers no more: its process is stopped."""

    def __str__(self) -> str:
        return f"t = {self.time:g} s: {self.component} answers no more"


@dataclass(frozen=True, slots=True)
class Forcing(Fault):
    """A reference swings around its value: what a faulty controller or a pulsating prime mover does.

    ``variable``: The tunable variable that is set, such as ``governor.delta_P_ref``.
    ``frequency``: [Hz]
    ``amplitude``: Half of what the reference goes through, in the variable's unit.
    ``end``: From then on the reference has its own value again [s]; None for the end of the run."""

    variable: str
    frequency: float
    amplitude: float
    shape: ForcingShape = "sine"
    end: float | None = None

    def changes(self) -> Mapping[str, Mapping[str, float | bool]]:
        return {self.component: {}}

    def values(self, step_size: float, stop: float) -> Iterator[ParameterChange]:
        """Return what is set one after the other, at communication points of a step [s], until ``stop`` [s].

        A sine is held for at most a two hundredth of its period, at its value in the middle of that time."""
        end = stop if self.end is None else min(self.end, stop)
        first, last = round(self.time / step_size), round(end / step_size)
        parts = 2 if self.shape == "square" else FORCING_POINTS
        points = [
            first + round(k / (parts * self.frequency * step_size))
            for k in range(int((last - first) * step_size * parts * self.frequency) + 2)
        ]
        for k, (point, following) in enumerate(pairwise(dict.fromkeys(points))):
            if point >= last:
                break
            middle = (point + following - 2 * first) / 2 * step_size
            phase = 2 * pi * self.frequency * middle
            value = sin(phase) if self.shape == "sine" else (-1.0) ** k
            yield ParameterChange(
                point * step_size, self.component, self.variable, self.amplitude * value
            )
        if last * step_size < stop:
            yield ParameterChange(last * step_size, self.component, self.variable, 0.0)

    def __str__(self) -> str:
        until = "" if self.end is None else f" until {self.end:g} s"
        return (
            f"t = {self.time:g} s: {self.component}.{self.variable} swings by {self.amplitude!r} at "
            f"{self.frequency!r} Hz ({self.shape}){until}"
        )


def faults_among(events: Iterable[Event]) -> list[Fault]:
    """Events that set no variable, for whoever cannot do them and has to say so."""
    return [event for event in events if isinstance(event, Fault)]
