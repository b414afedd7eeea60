"""A study in rows and columns, by which ``gfor explore`` opens it: each cell a figure, and a case that can be live."""

import hashlib
import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Annotated, Any

from pydantic import ConfigDict, Field, TypeAdapter, ValidationError

from orchestrator.cases.case import BUILT_IN, Case, built_in_cases
from orchestrator.cases.flow.sharing import SharingRule
from orchestrator.cases.form.definition import CaseDefinition
from orchestrator.cases.form.parameter_files import ParameterFile
from orchestrator.cases.form.schema import Value
from orchestrator.core.errors import InputError
from orchestrator.output.results.file_writers import save_json

CELLS = "cells.json"

_FORMAT = 1
_MOST = 200_000  # cells that a page is given; the first rows are the worst


@dataclass(frozen=True)
class Cell:
    __pydantic_config__ = ConfigDict(allow_inf_nan=False)
    text: str = ""  # what stands under the pointer
    percent: float | None = None  # damping, by which it is coloured
    stable: bool | None = None
    real: float | None = None  # of the eigenvalue [1/s]
    hz: float | None = None


@dataclass(frozen=True)
class CellLine:
    """A row or a column."""

    name: str
    # what the case must have set there, by ``component.variable``; None where it cannot be had as a live case
    values: Mapping[str, Value] | None = field(default_factory=dict)
    scenario: str = ""
    out: Sequence[str] = ()  # elements that are out of service


@dataclass(frozen=True)
class Cells:
    title: str
    case: Case
    scenario: str
    frequencies: tuple[float, float]  # [Hz]
    rows: Sequence[CellLine]
    columns: Sequence[CellLine]
    cells: Sequence[Sequence[Cell | None]]
    values: Mapping[str, Value] = field(default_factory=dict)  # that hold in all cells
    step: float | None = None  # communication step [s], where it is not the case's
    sharing: str | None = None  # who feeds what an outage takes, where it is not as the case says
    # whether taps and switched shunts move after an outage, where the case does not say so
    move_controls: bool = False
    followed: bool = False  # whether a row is a mode that is followed over the columns

    def save(self, staging: Path, folder: Path) -> Path:
        """Write ``cells.json``; ``folder`` is where it will be read from, and the case is named from there."""
        fit = max(1, _MOST // max(1, len(self.columns)))
        content = {
            "format": _FORMAT,
            "title": self.title,
            "scenario": self.scenario,
            "range": self.frequencies,
            "case": word_of(self.case, folder),
            "hash": _hash(self.case),
            "values": dict(self.values),
            "sharing": self.sharing,
            "move_controls": self.move_controls,
            "step": self.step,
            "followed": self.followed,
            "left_out": max(0, len(self.rows) - fit),
            "rows": list(map(asdict, self.rows[:fit])),
            "columns": list(map(asdict, self.columns)),
            "cells": [list(map(_figures_of, row)) for row in self.cells[:fit]],
        }
        save_json(content, staging / CELLS)
        return staging / CELLS


def _figures_of(cell: Cell | None) -> dict[str, Any] | None:
    """The figures that a cell has, by name."""
    return None if cell is None else {n: v for n, v in asdict(cell).items() if v not in (None, "")}


def word_of(case: CaseDefinition, folder: Path) -> str:
    """By which a case is found from a folder: the name of a built-in one, or the path of its file."""
    path = case.path
    return (
        path.parent.name
        if path.is_relative_to(BUILT_IN)
        else os.path.relpath(path.resolve(), folder.resolve())
    )


def found_from(word: str, folder: Path) -> Path | str:
    """The case that `word_of` named."""
    return word if word in built_in_cases() else (folder / word).resolve()


def _hash(case: Case) -> str:
    values = [
        file.values if isinstance(file, ParameterFile) else file
        for file in case.parameter_files.values()
    ]
    return hashlib.sha256(f"{case.text}{values}".encode()).hexdigest()


def check_case(study: Mapping[str, Any], case: Case, folder: Path) -> None:
    if study["hash"] != _hash(case):
        raise InputError(
            f"{folder / CELLS}: {case.source} is not as it was when the study was computed, or is another file; "
            "compute the study anew, or give the case itself"
        )


@dataclass(frozen=True)
class _Kept:
    """The file as it must be; what a page needs of it."""

    __pydantic_config__ = ConfigDict(allow_inf_nan=False)
    format: int
    title: str
    case: str
    hash: str
    scenario: str
    range: tuple[float, float]
    values: dict[str, Value]
    sharing: SharingRule | None
    followed: bool
    rows: Annotated[list[CellLine], Field(min_length=1)]
    columns: Annotated[list[CellLine], Field(min_length=1)]
    cells: list[list[Cell | None]]
    step: float | None = None
    move_controls: bool = False


def read_cells(folder: Path) -> dict[str, Any]:
    """Return what `Cells.save` wrote, with the ``case`` as a word that opens it."""
    file = folder / CELLS
    if not file.is_file():
        raise InputError(
            f"{folder}: there is no {CELLS} in it; `gfor screen`, `gfor sweep` and `gfor interactions` write one. "
            f"Give such a folder or a case; `gfor report {folder}` shows other results"
        )
    try:
        found: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
        kept = TypeAdapter(_Kept).validate_python(found)
        if kept.format != _FORMAT:
            raise InputError(
                f"{file}: its format is {kept.format}, and only {_FORMAT} is known; compute the study anew"
            )
        if len(kept.cells) != len(kept.rows) or any(
            len(row) != len(kept.columns) for row in kept.cells
        ):
            raise ValueError("rows and columns do not fit the cells")
        near = found_from(kept.case, folder)
        if isinstance(near, Path) and not near.is_file():
            raise InputError(
                f"{file}: its case {near} is not there; put the folder where it was, beside its case"
            )
        return found | {"case": str(near)}
    except (ValueError, TypeError, OSError, RecursionError) as error:
        text = (
            str(error).splitlines()[0]
            if not isinstance(error, ValidationError)
            else "; ".join(
                f"{'.'.join(map(str, one['loc']))}: {one['msg']}" for one in error.errors()[:3]
            )
        )
        raise InputError(
            f"{file}: it cannot be read as rows and columns: {text}; compute the study anew"
        ) from error
