"""Values as they are given in Python, as the rest of the program takes them."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from orchestrator.cases.parameter_files import ParameterFile, read_parameter_file
from orchestrator.cases.schema import Value
from orchestrator.errors import InputError
from orchestrator.units import to_unit

Time = float | str
"""A time: a number of seconds, or text with a unit such as ``"200 us"``."""


def plain(values: Mapping[str, Any] | None) -> dict[str, Value]:
    """Values by name, with NumPy's numbers as Python's own."""
    return {name: plain_value(value) for name, value in (values or {}).items()}


def plain_value(value: Any) -> Value:
    """A value, as Python's own number where it is one of NumPy."""
    own: Value = value.item() if hasattr(value, "item") else value
    return own


def in_seconds(time: Time | None, name: str) -> float | None:
    """A time [s]; None for None.

    Raises
    ------
    InputError
        If it is no time above 0.
    """
    if time is None:
        return None
    try:
        number = to_unit(time, "s")
    except ValueError as error:
        raise InputError(f"{name}: {error}") from error
    if not 0 < number < float("inf"):
        raise InputError(f"{name} = {time!r}; it must be a time above 0 and finite, such as 5.0 or '200 us'")
    return number


def parameter_files(paths: Iterable[str | Path]) -> list[ParameterFile]:
    """The parameter files of some paths.

    Raises
    ------
    InputError
        If one cannot be read.
    """
    return [read_parameter_file(Path(path)) for path in paths]
