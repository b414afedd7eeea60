"""Connections from outputs to inputs, and which of them are refused: by direction, by type, or by unit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from orchestrator.core.errors import InputError

if TYPE_CHECKING:
    from orchestrator.devices.fmi.description import VariableInfo


_CARRIED = {
    ("Real", "Real"),
    ("Integer", "Integer"),
    ("Boolean", "Boolean"),
    ("Enumeration", "Enumeration"),
    ("Integer", "Real"),  # every whole number is a real one
}
"""Types of an output and of the input that it may feed. SSP leaves connections between types to the importer; those
that could lose a part of the value are none here.
"""


@dataclass(frozen=True, slots=True)
class Endpoint:
    component: str
    variable: str

    def __str__(self) -> str:
        return f"{self.component}.{self.variable}"


@dataclass(frozen=True, slots=True)
class Connection:
    source: Endpoint
    target: Endpoint

    def __str__(self) -> str:
        return f"{self.source} -> {self.target}"


def check_direction(connection: Connection, out: VariableInfo, into: VariableInfo) -> None:
    """Refuse a connection that does not lead from an output to an input."""
    if out.causality != "output":
        raise InputError(
            f"{_label(connection)}: {connection.source} is of causality {out.causality}; a connection starts at an "
            "output"
        )
    if into.causality != "input":
        raise InputError(
            f"{_label(connection)}: {connection.target} is of causality {into.causality}; a connection ends at an "
            "input"
        )


def check_type(connection: Connection, kinds: tuple[str, str]) -> None:
    """Refuse a connection between types of which one cannot take all values of the other.

    ``kinds``: The types that the FMUs themselves declare, of the output and of the input."""
    if kinds not in _CARRIED:
        raise InputError(
            f"{_label(connection)}: {connection.source} is {kinds[0]} and {connection.target} is {kinds[1]}; a "
            "connection carries Real, Integer, Boolean and Enumeration to the same type, and Integer to Real: correct "
            "the wrong end, or let a component convert"
        )


def check_unit(connection: Connection, out: VariableInfo, into: VariableInfo) -> None:
    """Refuse a connection between different units; an end without a unit takes any."""
    if out.unit and into.unit and out.unit != into.unit:
        raise InputError(
            f"{_label(connection)}: {connection.source} is in {out.unit} and {connection.target} in {into.unit}; units "
            "must be equal, since none is converted on the way: correct the wrong one, or let a component convert"
        )


def _label(connection: Connection) -> str:
    return f"connection {connection.source} → {connection.target}"
