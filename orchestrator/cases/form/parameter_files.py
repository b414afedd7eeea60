"""Parameter files: values for a case's components in a file of their own, with a note of their origin."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from orchestrator.cases.form.locate import line_of
from orchestrator.cases.form.schema import Value
from orchestrator.cases.form.values import TWICE, flatten, given_twice
from orchestrator.core.errors import CaseError, InputError, Problem
from orchestrator.core.toml_files import read_toml

COMMENT = "# "  # before what a file says of itself
_TABLE = "set"
_EXAMPLE = '[set]\n"gfor.pod_p.K" = 200.0'


@dataclass(frozen=True)
class ParameterFile:
    path: Path
    text: str
    # by ``component.variable``; the component may be a pattern such as ``gfor*``
    values: dict[str, Value]

    def place(self, key: str) -> str:
        return _place(self.path, self.text, key)


def read_parameter_file(path: Path) -> ParameterFile:
    """Read a file whose one table ``[set]`` holds values by ``component.variable``.

    Raises an `InputError` if there is no such file, it is not TOML, or it has no table ``[set]``.
    Raises a `CaseError` with every key and value that is not valid."""
    text, raw = read_toml(path, "the parameter file", "`gfor design` writes one")
    table = raw.get(_TABLE)
    if not isinstance(table, dict) or not table:
        raise InputError(
            f"{path}: a parameter file needs a table [set] with values, such as\n{_EXAMPLE}\n"
            f"this one has at its top: {', '.join(raw) or 'nothing'}"
        )
    unknown = "this key is unknown; a parameter file has the table [set] and no other"
    problems = [
        Problem(_place_of(path, line_of(text, (key,)), key), unknown)
        for key in raw
        if key != _TABLE
    ]
    problems += [Problem(_place(path, text, key), TWICE) for key in given_twice(flatten(table))]
    values: dict[str, Value] = {}
    for parts, value in flatten(table):
        key = ".".join(parts)
        if "." not in key:
            form = "it is not of the form component.parameter, such as gfor.pod_p.K"
            problems.append(Problem(_place(path, text, key), form))
        elif not isinstance(value, bool | int | float | str):
            kinds = f"{value!r} is neither a number, a text with a unit, nor true or false"
            problems.append(Problem(_place(path, text, key), kinds))
        else:
            values[key] = value
    if problems:
        raise CaseError(str(path), problems)
    return ParameterFile(path, text, values)


def parameter_file_text(values: Mapping[str, Value], comments: Sequence[str]) -> str:
    lines = [f"{COMMENT}{line}".rstrip() for comment in comments for line in comment.splitlines()]
    lines += [
        "",
        f"[{_TABLE}]",
        *(f'"{key}" = {_toml(value)}' for key, value in values.items()),
        "",
    ]
    return "\n".join(lines)


def _toml(value: Value) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return (
        repr(value)
        if not isinstance(value, str)
        else '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'
    )


def _place(path: Path, text: str, key: str) -> str:
    """The place of a key. A quoted key is one part of a path, and an unquoted key with dots has several parts."""
    lines = [line_of(text, (_TABLE, *parts)) for parts in ((key,), key.split("."))]
    return _place_of(path, max(filter(None, lines), default=None), key)


def _place_of(path: Path, line: int | None, key: str) -> str:
    return f"{path}, line {line}, {key}" if line else f"{path}, {key}"
