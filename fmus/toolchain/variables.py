"""Declarations of a model's quantities: written once, used everywhere.

A declaration becomes a line of the modelDescription, a row of the README's table, the bounds that
the slave enforces and the unit that a case file is checked against."""

import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

VariableType = Literal["Real", "Integer", "Boolean"]

Kind = Literal["converter", "machine", "network", "load", ""]
"""A component's role in a power system; empty for none of these, such as a controller alone."""

UNITS: dict[str, dict[str, float]] = tomllib.loads(
    Path(__file__).with_name("units.toml").read_text(encoding="utf-8")
)
"""Unit → exponents of SI base units, with the factor to them."""


@dataclass(frozen=True, slots=True)
class Usual:
    """The usual range of a parameter in its unit, both ends included. A value outside is questioned, not refused.

    It is wide: it finds a wrong unit (ms for s, kVA for MVA) or a wrong base, and does not judge data."""

    low: float
    high: float
    why: str
    or_zero: bool = False  # whether 0 is usual as well, because it switches a part off
    slip: str = ""  # the likely mistake behind a value outside; found from the value where empty

    def fits(self, value: float) -> bool:
        return self.low <= value <= self.high or (self.or_zero and value == 0)


def usual_beside(module: str, file: str = "usual_ranges.toml") -> dict[str, Usual]:
    """Usual ranges by parameter, of a file beside a module."""
    tables = tomllib.loads(Path(module).with_name(file).read_text(encoding="utf-8"))["usual"]
    return {
        name: Usual(low, high, table["why"], table.get("or_zero", False))
        for table in tables
        for name, (low, high) in table["ranges"].items()
    }


@dataclass(frozen=True, slots=True)
class Variable:
    """A named quantity with its unit.

    ``name``: Dotted name, as the FMU shows it.
    ``unit``: One of `UNITS`.
    ``description``: One sentence; for per-unit quantities it is followed by the base.
    ``base``: What 1 pu is, for the unit ``pu``: ``"S_n"`` (the device's rating) or ``"100 MVA"``."""

    name: str
    unit: str
    description: str
    base: str = ""

    def __post_init__(self) -> None:
        if self.unit not in UNITS:
            raise ValueError(
                f"variable {self.name!r} has the unit {self.unit!r}, which is not declared; "
                f"use one of {', '.join(sorted(UNITS))} or add it to UNITS"
            )
        if self.unit == "pu" and not self.base:
            raise ValueError(
                f"variable {self.name!r} is in pu and names no base; add base='S_n' or '100 MVA'"
            )

    @property
    def text(self) -> str:
        return f"{self.description} [pu, base {self.base}]" if self.base else self.description


@dataclass(frozen=True, slots=True)
class Parameter(Variable):
    """A quantity that the user sets: before initialisation, or (``tunable``) at any communication point."""

    start: float = 0.0
    minimum: float | None = None
    maximum: float | None = None
    tunable: bool = False
    type: VariableType = "Real"
    source: str = ""
    usual: Usual | None = None


@dataclass(frozen=True, slots=True)
class CalculatedParameter(Variable):
    """A quantity computed from fixed parameters at initialisation, such as a set-point of the operating point."""


@dataclass(frozen=True, slots=True)
class Input(Variable):
    """A quantity that the master sets at communication points, and that keeps its value in between."""

    start: float = 0.0


@dataclass(frozen=True, slots=True)
class State(Variable):
    """A continuous state; its initial value is computed from the parameters.

    ``stepwise``: it is held during a communication step, as inputs are, and moves by rate × step size at its end."""

    stepwise: bool = False


@dataclass(frozen=True, slots=True)
class Output(Variable):
    """A function of states and inputs, evaluated when it is read."""
