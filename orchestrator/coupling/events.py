"""Events at given times. Each says in the field's words what happens and comes down to variables that are set."""

from collections.abc import Mapping
from dataclasses import dataclass

from fmus.grid.names import line_variable


@dataclass(frozen=True, slots=True)
class Event:
    """Something that happens at a communication point, before the step that starts there.

    Parameters
    ----------
    time
        [s]
    component
        Whose variables are set.
    """

    time: float
    component: str

    def settings(self) -> Mapping[str, float | bool]:
        """Variables of the component with their new values."""
        raise TypeError(f"{type(self).__name__} is not a kind of event of its own")

    def changes(self) -> Mapping[str, Mapping[str, float | bool]]:
        """Settings of every component that is concerned, in the order in which they are made."""
        return {self.component: self.settings()}

    def __str__(self) -> str:
        values = [f"{who}.{name} = {value:g}" for who, new in self.changes().items() for name, value in new.items()]
        return f"t = {self.time:g} s: {', '.join(values)}"


@dataclass(frozen=True, slots=True)
class LoadChange(Event):
    """A load takes ``scale`` times its power: conductance and susceptance together."""

    load: str
    scale: float

    def settings(self) -> Mapping[str, float | bool]:
        """The values that the event sets, by variable."""
        return {f"{self.load}.scale": self.scale}


@dataclass(frozen=True, slots=True)
class LoadSwitching(Event):
    """A load is switched off (``scale`` 0), or on again."""

    load: str
    scale: float = 0.0

    def settings(self) -> Mapping[str, float | bool]:
        """The values that the event sets, by variable."""
        return {f"{self.load}.scale": self.scale}


@dataclass(frozen=True, slots=True)
class LineSwitching(Event):
    """A line is opened at both ends, or closed again."""

    line: str
    connected: bool

    def settings(self) -> Mapping[str, float | bool]:
        """The values that the event sets, by variable."""
        return {line_variable(self.line, "connected"): self.connected}


@dataclass(frozen=True, slots=True)
class UnitSwitching(Event):
    """A unit is taken from the grid, or put back: the grid's port, and the unit's own breaker where it has one."""

    unit: str
    connected: bool
    has_breaker: bool = True

    def settings(self) -> Mapping[str, float | bool]:
        """The values that the event sets, by variable."""
        return {f"{self.unit}.connected": self.connected}

    def changes(self) -> Mapping[str, Mapping[str, float | bool]]:
        """The values that the event sets, by component and variable."""
        own: dict[str, Mapping[str, float | bool]] = {self.unit: {"connected": self.connected}}
        return (own if self.has_breaker else {}) | {self.component: self.settings()}


@dataclass(frozen=True, slots=True)
class BranchChange(Event):
    """A line takes other values of X and, if given, R [pu]."""

    line: str
    X: float
    R: float | None = None

    def settings(self) -> Mapping[str, float | bool]:
        """The values that the event sets, by variable."""
        values = {line_variable(self.line, "X"): self.X}
        return values if self.R is None else values | {line_variable(self.line, "R"): self.R}


@dataclass(frozen=True, slots=True)
class ReferenceChange(Event):
    """A reference moves by ``delta`` from its operating point: ``reference`` is e.g. ``exciter.V_ref``."""

    reference: str
    delta: float

    def settings(self) -> Mapping[str, float | bool]:
        """The values that the event sets, by variable."""
        scope, _, name = self.reference.rpartition(".")
        return {f"{scope}.delta_{name}" if scope else f"delta_{name}": self.delta}


@dataclass(frozen=True, slots=True)
class ParameterChange(Event):
    """A tunable parameter, or an input that nothing feeds, takes a value."""

    parameter: str
    value: float | bool

    def settings(self) -> Mapping[str, float | bool]:
        """The values that the event sets, by variable."""
        return {self.parameter: self.value}
