"""Arguments as they are given in Python, as the rest of the program takes them; one clear error where they do not fit.

A caller gives a list where one name would do, a text where a number is meant, ``None`` from a table that was empty.
Each reader here raises an `InputError` that says which argument it was, the value seen, and how to write it."""

from __future__ import annotations

import hashlib
import re
import sys
import warnings
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from orchestrator.cases.form.locate import FROM_TABLES
from orchestrator.core.asked import Value, number_between, number_in, path, plain_value, seen
from orchestrator.core.errors import InputError
from orchestrator.core.given_files import DIGITS, FOLDER
from orchestrator.core.late import pd

if TYPE_CHECKING:
    from orchestrator.cases.form.parameter_files import ParameterFile
    from orchestrator.core.arrays import Numbers

Time = float | str  # A time: a number of seconds, or text with a unit such as ``"200 us"``
Paths = str | Path | Iterable[str | Path]  # one path, or several

_TABLE_KINDS = {
    ".toml": "file, or its tables",
    ".csv": "file, or a DataFrame with a row for each operating point",
}
"""What may stand in the place of a file's path."""

_CASE_VALUE = re.compile(r"[^.\s]+\.\S+")


def plain(
    values: Mapping[str, Any] | None, argument: str = "values", otherwise: str = ""
) -> dict[str, Value]:
    """Values by name, with NumPy's numbers as Python's own; a mapping in a mapping is read as a name with a point.

    ``otherwise``: where several values of one name belong."""
    if values is None:
        return {}
    if not isinstance(values, Mapping) and type(values).__name__ == "Series":
        values = dict(values)  # of pandas: by its index
    from orchestrator.cases.form.values import flatten, given_twice  # noqa: PLC0415 - a record needs no case

    if not isinstance(values, Mapping):
        raise InputError(
            f"{argument} = {seen(values)}; give values by name, such as {{'grid.X_L': 0.3}}"
        )
    wrong = [key for key in _keys(values) if not isinstance(key, str)]
    if wrong:
        raise InputError(
            f"{argument}: {wrong[0]!r} is not a name; give values by name, such as {{'grid.X_L': 0.3}}"
        )
    flat = flatten(values)
    twice = given_twice(flat)
    if twice:
        raise InputError(f"{argument}: {twice[0]!r} is given twice, flat and nested; give it once")
    found = {".".join(path): plain_value(value) for path, value in flat}
    several = [
        name
        for name, value in found.items()
        if hasattr(value, "__len__") and not isinstance(value, str)
    ]
    if several:
        raise InputError(f"{argument}: {several[0]} is given several values; give one{otherwise}")
    return found


def users_level() -> int:
    """How far above its caller the nearest code outside of this package stands, as `warnings.warn` counts."""
    frame, level = sys._getframe(1), 1
    package = __name__.partition(".")[0]
    while frame.f_back and frame.f_globals.get("__name__", "").partition(".")[0] == package:
        frame, level = frame.f_back, level + 1
    return level


def case_values(values: Mapping[str, Any] | None, argument: str = "values") -> dict[str, Value]:
    """Values by ``component.variable``; otherwise as `plain`."""
    read = plain(values, argument, ", or vary it with case.sweep(…)")
    for name in read:
        check_case_name(name, argument)
    return read


def check_case_name(name: str, argument: str) -> None:
    from orchestrator.cases.form.build_choices import ALPHA, MODELS  # noqa: PLC0415 - a record needs no case

    if not _CASE_VALUE.fullmatch(name) and name not in (ALPHA, MODELS):
        raise InputError(
            f"{argument}: {name!r} is not of the form component.variable, such as 'grid.X_L'"
        )


def _keys(values: Mapping[Any, Any]) -> Iterable[Any]:
    for key, value in values.items():
        yield key
        if isinstance(value, dict):
            yield from _keys(value)


def binding_path(given: Any) -> Path | None:
    """The path of a binding, which may be given as a mapping; None for None."""
    return None if given is None else path_of_given(given, "binding.toml", "binding")


def path_of_given(given: Any, name: str, argument: str) -> Path:
    """The path of a file that is given, or of one in the cache with what is given: for ``.toml`` a mapping, for
    ``.csv`` a table, or rows by the names of operating points."""
    if not isinstance(given, Mapping) and not hasattr(given, "to_csv"):
        return path(given, argument, _TABLE_KINDS[Path(name).suffix])
    if name.endswith(".toml"):
        import tomli_w  # noqa: PLC0415 - a path needs none

        try:
            text = tomli_w.dumps(given)
        except (TypeError, ValueError, AttributeError) as error:
            raise InputError(
                f"{argument}: {error}; give what TOML has: tables, lists, numbers and text"
            ) from error
        return keep(FROM_TABLES + text, name)
    if isinstance(given, Mapping) and all(isinstance(row, Mapping) for row in given.values()):
        # a row without values is the case as it is
        table = pd.DataFrame([*given.values()], index=[*given])
    else:
        table = given if hasattr(given, "to_csv") else pd.DataFrame.from_dict(given, orient="index")
    if not hasattr(table, "columns"):
        raise InputError(
            f"{argument}: a {type(given).__name__} has no columns; give a DataFrame, a row each"
        )
    gaps = [str(name) for name in table if table[name].isna().any()] if table is given else []
    if gaps:
        warnings.warn(
            f"question: {argument}: {', '.join(gaps)}: the case's value is taken at NaN; is it meant?",
            stacklevel=users_level(),
        )
    named = {"time", "name"} & set(table.columns)
    return keep(table.to_csv(index=not named, index_label=None if named else "name"), name)


def keep(text: str, name: str) -> Path:
    """A text as a file in the cache, where workers find it."""
    from fmus.toolchain.cache import cache_directory  # noqa: PLC0415 - a record needs no cache
    from orchestrator.core.safe_files import write_text  # noqa: PLC0415 - as above

    place = cache_directory(FOLDER) / hashlib.sha256(text.encode()).hexdigest()[:DIGITS] / name
    if not place.is_file():
        write_text(place, text)
    return place


def in_seconds(time: Time | None, argument: str) -> float | None:
    """A time [s]; None for None."""
    if time is None:
        return None
    return number_between(
        time, "s", argument, 5e-324, 1e308, "a time above 0 and finite, such as 5.0 or '200 us'"
    )


def moment(time: Any, argument: str) -> float:
    """A time on the axis of a run [s], which begins at 0."""
    return number_between(
        time, "s", argument, 0.0, 1e308, "a time of 0 or later and finite, such as 2.0 or '500 ms'"
    )


def part_of_record(times: Numbers, start: Any, stop: Any, label: str) -> tuple[float, float]:
    """Begin and end [s] of a part of a record; by default, as None, its own."""
    first, last = float(times[0]), float(times[-1])
    begin = first if start is None else moment(start, "start")
    if begin >= last:
        raise InputError(
            f"start = {start!r}: the record of {label} ends at t = {last:g} s; give an earlier start"
        )
    end = last if stop is None else moment(stop, "stop")
    if end <= max(begin, first):
        raise InputError(
            f"stop = {stop!r}: it must come after start = {start or first!r}; give a later stop"
        )
    return begin, end


def in_megabytes(given: Any, argument: str, least: float) -> float:
    """An amount of memory [MB], as a number or as text such as ``"4 GB"``."""
    rule = "an amount of memory in MB, such as 4096, or '4 GB'"
    number = number_in(given, "MB", argument, rule)
    if not number < float("inf") or not number > 0:
        raise InputError(
            f"{argument} = {given!r}; it must be above 0 MB and finite, such as 4096 or '4 GB'"
        )
    if number < least:
        raise InputError(
            f"{argument} = {given!r} is {number:g} MB, too little to load any FMU; give at least {least:g} MB, such as "
            "4096 or '4 GB'"
        )
    return number


def parameter_files(paths: Paths) -> list[ParameterFile]:
    from orchestrator.cases.form.parameter_files import read_parameter_file  # noqa: PLC0415 - a record needs no case

    if isinstance(paths, Mapping):
        raise InputError(
            "parameters: it takes the paths of parameter files; give values by name as values={…}"
        )
    listed = (
        [paths] if isinstance(paths, str | Path) or not isinstance(paths, Iterable) else list(paths)
    )
    return [read_parameter_file(path(one, "parameters")) for one in listed]
