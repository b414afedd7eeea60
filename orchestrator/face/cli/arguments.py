"""Readers of options' values; argparse prints what is wrong with one."""

import argparse
import math
import tomllib
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import Any, cast

from orchestrator.core.asked import (
    as_number,
    asked_of,
    read_percent,
    read_positive,
    read_range,
    read_whole,
)
from orchestrator.core.errors import InputError
from orchestrator.core.units import read_value, to_unit
from orchestrator.studies.points.executor import Executor
from orchestrator.systems.coupling.no_trip_regions import read_no_trip_code
from orchestrator.systems.coupling.schedule import check_tolerance

_ASKED = "asked_"  # before the name of a field whose own name is that of another option


def switch(parser: argparse._ActionsContainer, name: str, text: str) -> None:
    parser.add_argument(name, action="store_true", help=text)


def option(
    parser: argparse._ActionsContainer,
    name: str,
    metavar: str,
    text: str,
    *,
    read: Callable[[str], Any] = str,
    default: Any = None,
) -> None:
    parser.add_argument(name, metavar=metavar, help=text, type=read, default=default)


def repeatable(
    parser: argparse._ActionsContainer,
    name: str,
    metavar: str,
    text: str,
    *,
    read: Callable[[str], Any] = str,
) -> None:
    parser.add_argument(name, metavar=metavar, help=text, type=read, action="append", default=[])


def add_options(parser: argparse._ActionsContainer, part: str, **given: Any) -> None:
    """Add the options that ``options.toml`` has for a part of a command.

    ``given``: readers and choices that the file names and that are not here, and what its help is filled in with."""
    for name, table in _read_options()[part].items():
        if name == "epilog":
            cast("argparse.ArgumentParser", parser).epilog = str(table).format(**given)
            continue
        how = {
            key: value for key, value in table.items() if key not in ("read", "several", "filled")
        }
        if table.get("filled"):
            how["help"] = how["help"].format(**given)
        for key in ("choices", "default"):
            if isinstance(how.get(key), str):
                how[key] = given.get(how[key], how[key])
        kind, _, unit = table.get("read", "").partition(" ")
        if kind:
            how["type"] = quantity(unit) if unit else given.get(kind) or READERS[kind]
        if table.get("several"):
            how |= {"action": "append", "default": []}
        plain = how.keys() & {
            "metavar",
            "type",
            "choices",
            "nargs",
            "action",
        } or not name.startswith("-")
        parser.add_argument(name, **how if plain else how | {"action": "store_true"})


@cache
def _read_options() -> dict[str, dict[str, dict[str, Any]]]:
    return tomllib.loads(Path(__file__).with_name("options.toml").read_text(encoding="utf-8"))


def add_kept_argument(parser: argparse.ArgumentParser, name: str) -> None:
    option(parser, "--out", "DIR", f"write {name}.json there, for `gfor report`", read=Path)


def add_json_argument(parser: argparse.ArgumentParser) -> None:
    switch(parser, "--json", "print JSON")


def add_request_arguments(parser: argparse._ActionsContainer, request: type) -> None:
    """An option for each field of a request that has one and that the parser lacks; None where it is not given."""
    for name, one in asked_of(request).items():
        if one.option is None or one.option in parser._option_string_actions:
            continue
        # as ``--parameters`` beside ``--parameter``
        taken = any(action.dest == name for action in parser._actions)
        how: dict[str, Any] = {"action": "append"} if one.kind.several else {}
        how["dest"] = f"{_ASKED}{name}" if taken else name
        options = [(one.option, one.metavar, one.help, one.kind.read), *one.kind.besides]
        for spelt, metavar, text, read in options:
            of = how | (
                {"action": "store_true"} if read is None else {"metavar": metavar, "type": read}
            )
            parser.add_argument(spelt, help=text, **of)


def asked_by(options: argparse.Namespace, request: type) -> dict[str, Any]:
    def value_of(name: str) -> Any:
        return getattr(options, f"{_ASKED}{name}", getattr(options, name, None))

    found = {name: (one.kind, value_of(name)) for name, one in asked_of(request).items()}
    asked: dict[str, Any] = {}
    for name, (kind, value) in found.items():
        if value is None or value is False or value == []:
            continue
        plain = tuple(value) if isinstance(value, list) else value
        asked[name] = ",".join(value) if kind.joined else plain
    return asked


def assignment(text: str) -> tuple[str, bool | float | str]:
    """``component.parameter=value`` of a case."""
    key, equals, given = text.partition("=")
    if not equals or ("." not in key and key.strip() != "models") or not given:
        raise ValueError(
            f"{text!r} is not of the form component.parameter=value, such as grid.X_L=0.2"
        )
    return key.strip(), read_value(given.strip())


def setting(text: str) -> tuple[str, bool | float | str]:
    """``variable=value`` of one FMU."""
    name, equals, given = text.partition("=")
    if not equals or not name or not given:
        raise ValueError(f"{text!r} is not of the form variable=value, such as pod_p.enabled=true")
    return name.strip(), read_value(given.strip())


def seconds(text: str) -> float:
    """A time above 0 [s], as a number or with a unit."""
    time = _time(text)
    if not (time > 0 and math.isfinite(time)):
        raise ValueError(f"{text!r} must exceed 0 and be finite")
    return time


def seconds_or_none(text: str) -> float:
    """A time [s], as `seconds`, or 0."""
    time = _time(text)
    if not (time >= 0 and math.isfinite(time)):
        raise ValueError(f"{text!r} must be 0 or above and finite")
    return time


def _time(text: str) -> float:
    """Any time [s], as a number or with a unit."""
    value = read_value(text)
    if isinstance(value, bool):
        raise ValueError(f"{text!r} is not a time; write it like 0.5 or '500 ms'")
    return to_unit(value, "s")


def quantity(unit: str) -> Callable[[str], float]:
    """Reads a number with or without a unit, in a declared one."""
    return lambda text: to_unit(text, unit)


def tolerance(text: str) -> float:
    value = as_number(text)
    check_tolerance(value)
    return value


READERS: dict[str, Callable[[str], Any]] = {
    "path": Path,
    "seconds": seconds,
    "no_trip_code": read_no_trip_code,
    "seconds_or_none": seconds_or_none,
    "setting": setting,
    "assignment": assignment,
    "positive": read_positive,
    "percent": read_percent,
    "range": read_range,
    "value": read_value,
    "int": int,
    "float": float,
}
"""What makes a value of an option's text, by how ``options.toml`` calls it."""


def add_executor_arguments(parser: argparse._ActionsContainer) -> None:
    add_options(parser, "executor", workers=read_whole(1, 1000))


def choose_executor(options: argparse.Namespace, imports: Sequence[str]) -> Executor:
    if options.scheduler is not None and options.workers is not None:
        raise InputError(
            "--workers and --scheduler exclude each other; a Dask cluster brings its own workers"
        )
    from orchestrator.studies.points import study  # noqa: PLC0415 - imports the reading of cases

    return study.choose_executor(options.workers, options.scheduler, imports, options.tls)
