"""Values of a case file, brought to the type, unit and range that a variable declares."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

from fmus.toolchain.port_variables import I_RE, S_BASE, S_N, SYSTEM_BASE, SYSTEM_BASE_MVA
from orchestrator.core.units import to_unit

if TYPE_CHECKING:
    from orchestrator.cases.form.schema import Value
    from orchestrator.devices.fmi.description import FmuDescription, VariableInfo

# in the description of a variable that chooses: what its numbers mean
_CHOICES = re.compile(r"\b0: .*\b1: ")


def as_written(value: object) -> str:
    """Return a value as a case file or an option has it: ``true``, ``50``, ``'half'``."""
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:.15g}" if isinstance(value, float) else repr(value)


def convert(info: VariableInfo, value: Value) -> float | bool:
    if info.type == "Boolean":
        if isinstance(value, bool):
            return value
        raise ValueError(f"{info.name} = {as_written(value)}; it must be true or false")
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        raise ValueError(f"{info.name} = {as_written(value)}; it must be a number")
    unit = f" {info.unit}" if info.unit not in ("", "1") else ""
    choices = f" ({info.description})" if _CHOICES.search(info.description) else ""
    try:
        number = to_unit(value, info.unit)
    except ValueError as error:
        if choices:
            raise ValueError(
                f"{info.name} = {value!r}; it must be one of its numbers{choices}"
            ) from error
        raise ValueError(f"{info.name}: {error}") from error
    if not math.isfinite(number):
        raise ValueError(f"{info.name} = {number}; it must be a finite number")
    if info.type == "Integer" and number != int(number):
        raise ValueError(f"{info.name} = {number:g}; it must be a whole number{choices}")
    if info.minimum is not None and number < info.minimum:
        raise ValueError(
            f"{info.name} = {number:g}{unit}; it must be at least {info.minimum:g}{unit}{choices}"
        )
    if info.maximum is not None and number > info.maximum:
        raise ValueError(
            f"{info.name} = {number:g}{unit}; it must be at most {info.maximum:g}{unit}{choices}"
        )
    return number


def check_system_base(description: FmuDescription, variable: str, value: float | bool) -> None:
    """Refuse another system base for a device with our port. In a bound FMU the name has another meaning."""
    from orchestrator.devices.fmi.port_mapping import BoundDescription  # noqa: PLC0415 - FMUs, which reading a file does without

    own = not isinstance(description, BoundDescription) and I_RE.name in description.variables
    if own and variable == S_BASE.name and value != SYSTEM_BASE_MVA:
        raise ValueError(
            f"{variable} = {value:g} MVA; currents at the port and all networks are in pu of the system base, which is "
            f"{SYSTEM_BASE}: leave {variable} away, and give the device's own rating with {S_N.name}"
        )


def flatten(table: Mapping[str, Any]) -> list[tuple[tuple[str, ...], Any]]:
    """Nested tables as paths: ``droop.R_f = 0.05`` is the variable ``droop.R_f``."""
    flat: list[tuple[tuple[str, ...], Any]] = []
    for key, value in table.items():
        if isinstance(value, dict):
            flat += [((key, *path), inner) for path, inner in flatten(value)]
        else:
            flat.append(((key,), value))
    return flat


def given_twice(flat: Iterable[tuple[tuple[str, ...], Any]]) -> list[str]:
    """Names that two paths lead to: ``droop.R_f`` in a table ``droop`` and as one quoted key."""
    counts = Counter(".".join(path) for path, _ in flat)
    return [name for name, count in counts.items() if count > 1]


TWICE = "it is given twice, once in quotes and once as a name in a table; keep one of them"
