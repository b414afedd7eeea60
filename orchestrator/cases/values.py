"""Values of a case file, brought to the type, unit and range that a variable declares."""

import math
from collections.abc import Mapping
from typing import Any

from orchestrator.cases.schema import Value
from orchestrator.fmi.description import VariableInfo
from orchestrator.units import to_unit


def convert(info: VariableInfo, value: Value) -> float | bool:
    """Return the value in the variable's own unit.

    Raises
    ------
    ValueError
        If type, unit or range do not fit; the message names the variable, the value and the rule.
    """
    if info.type == "Boolean":
        if isinstance(value, bool):
            return value
        raise ValueError(f"{info.name} = {value!r}; it must be true or false")
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        raise ValueError(f"{info.name} = {value!r}; it must be a number")
    try:
        number = to_unit(value, info.unit)
    except ValueError as error:
        raise ValueError(f"{info.name}: {error}") from error
    unit = f" {info.unit}" if info.unit not in ("", "1") else ""
    if not math.isfinite(number):
        raise ValueError(f"{info.name} = {number}; it must be a finite number")
    if info.type == "Integer" and number != int(number):
        raise ValueError(f"{info.name} = {number:g}; it must be a whole number")
    if info.minimum is not None and number < info.minimum:
        raise ValueError(f"{info.name} = {number:g}{unit}; it must be at least {info.minimum:g}{unit}")
    if info.maximum is not None and number > info.maximum:
        raise ValueError(f"{info.name} = {number:g}{unit}; it must be at most {info.maximum:g}{unit}")
    return number


def flatten(table: Mapping[str, Any]) -> list[tuple[tuple[str, ...], Any]]:
    """Nested tables as paths: ``droop.R_f = 0.05`` is the variable ``droop.R_f``."""
    flat: list[tuple[tuple[str, ...], Any]] = []
    for key, value in table.items():
        if isinstance(value, dict):
            flat += [((key, *path), inner) for path, inner in flatten(value)]
        else:
            flat.append(((key,), value))
    return flat
