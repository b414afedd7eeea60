"""Signals that the probe pair would show in each schedule of a master, and those that it showed in a foreign tool,
however that names and separates its columns."""

import csv
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from itertools import product
from pathlib import Path
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from orchestrator.cases.scenario.catalogue_fmus import catalogue_fmu
from orchestrator.core.errors import InputError
from orchestrator.core.foreign_files import read_text
from orchestrator.core.options import Option
from orchestrator.systems.coupling.clock import Clock
from orchestrator.systems.coupling.master import Master
from orchestrator.systems.coupling.recorder import Recorder
from orchestrator.systems.coupling.schedule import FirstInputs, Schedule
from orchestrator.systems.coupling.system import System

ORDERS = {
    "side by side": (("a", "b"),),
    "a, then b": (("a",), ("b",)),
    "b, then a": (("b",), ("a",)),
}
EXTRAPOLATIONS = (0.0, 0.5, 1.0)
SIGNALS = ("a.y", "b.y", "a.u_held", "b.u_held", "a.stepped", "b.stepped")
LABELS = (0, 1, -1)  # how many steps a row's outputs are ahead of its time


@dataclass(frozen=True)
class Candidate:
    order: str  # a key of `ORDERS`
    first_inputs: FirstInputs
    extrapolation: float
    early_label: int  # a row labelled t holds what t/H + ``early_label`` steps gave
    after_exchange: bool  # outputs are read after the inputs of the next step were set
    wire_by_wire: bool  # see `Schedule`


def probe_system() -> System:
    system = System()
    system.add("a", catalogue_fmu("probe_a"))
    system.add("b", catalogue_fmu("probe_b"))
    system.connect("a.y", "b.u")
    system.connect("b.y", "a.u")
    return system


MasterTrajectory = tuple[Candidate, NDArray[np.float64]]
"""A schedule, and what it shows: row k holds `SIGNALS` after k + ``early_label`` steps, NaN where unknown."""


@cache
def candidates(
    step_size: float, steps: int, extrapolation: float = 0.0
) -> tuple[MasterTrajectory, ...]:
    """Every schedule with one kind of extrapolation, and its trajectory of ``steps`` + 1 rows."""
    found = []
    for schedule in _schedules(extrapolation):
        for after_exchange, values in enumerate(_trajectories(schedule, step_size, steps + 1)):
            for early in LABELS:
                rows = np.full((steps + 1, len(SIGNALS)), np.nan)
                source = values[max(0, early) : steps + 1 + early]
                rows[max(0, -early) : max(0, -early) + len(source)] = source
                what = (
                    schedule.name,
                    schedule.first_inputs,
                    schedule.extrapolation,
                    early,
                    bool(after_exchange),
                )
                found.append((Candidate(*what, schedule.wire_by_wire), rows))
    return tuple(found)


def _schedules(extrapolation: float) -> Iterator[Schedule]:
    for order, first in product(ORDERS, get_args(FirstInputs)):
        yield Schedule(order, ORDERS[order], first, extrapolation)
        if order == "side by side" and not extrapolation and first in ("consistent", "once"):
            # what is handed over wire by wire is read when its turn comes, also the first time
            yield Schedule(order, ORDERS[order], first, wire_by_wire=True)


def _trajectories(schedule: Schedule, step_size: float, steps: int) -> list[NDArray[np.float64]]:
    recorders = [Recorder(SIGNALS, 1), Recorder(SIGNALS, 1, after_exchange=True)]
    with Master(probe_system(), schedule, step_size) as master:
        master.run(Clock(step_size).time(steps), observers=recorders)
    return [recorder.values for recorder in recorders]


_TIMES = ("time", "t", "zeit", "seconds")
_NEEDED = ("a.y", "b.y")


@dataclass(frozen=True)
class ProbeResult:
    times: NDArray[np.float64]  # labels [s], shape (n,), rising
    # shape (n, number of `SIGNALS`); NaN where a signal was not recorded
    values: NDArray[np.float64]
    columns: dict[str, str]  # signal → heading of the column it was read from


def read_probe_result(path: Path, named: Mapping[str, str] | None = None) -> ProbeResult:
    """Read a CSV file. The end of a heading says which signal the column holds (``a.y``, ``probe_a::y``, ``system/a/y
    [1]``).

    ``path``: separated by commas, semicolons or tabs; with a decimal comma where a semicolon or a tab separates.
    ``named``: heading of the column for ``time`` or a signal, where the end of the heading does not show it.
    Raises an `InputError` if the file cannot be read, the time is missing, both a.y and b.y are missing, or an entry is
    not a number."""
    heads, lines = _table(path)
    columns = _columns(path, heads, dict(named or {}))
    picked = np.array(
        [
            [_number(path, line, heads, columns[s], row) for s in columns]
            for row, line in enumerate(lines)
        ]
    )
    picked = picked[np.argsort(picked[:, 0], kind="stable")]
    last = np.append(np.diff(picked[:, 0]) > 0, True)  # the last of several rows with one time
    times, picked = picked[last, 0], picked[last, 1:]
    values = np.full((len(times), len(SIGNALS)), np.nan)
    for index, signal in enumerate(list(columns)[1:]):
        values[:, SIGNALS.index(signal)] = picked[:, index]
    return ProbeResult(times, values, {signal: heads[column] for signal, column in columns.items()})


def _table(path: Path) -> tuple[list[str], list[list[str]]]:
    try:
        text = read_text(path, encoding="utf-8-sig")
    except OSError as error:
        raise InputError(
            f"{path}: it cannot be read: {error.strerror}; give the tool's output as CSV"
        ) from error
    except UnicodeDecodeError as error:
        raise InputError(
            f"{path}: it is not text ({error}); give the tool's output as CSV"
        ) from error
    filled = [line for line in text.splitlines() if line.strip()]
    if len(filled) < 2:
        raise InputError(
            f"{path}: it has no heading with rows below it; give the tool's output as CSV"
        )
    separator = max(",;\t", key=filled[0].count)
    rows = [[entry.strip() for entry in row] for row in csv.reader(filled, delimiter=separator)]
    commas = separator != ","  # as the sign before decimals, where there is no point

    def with_points(entry: str) -> str:
        return entry.replace(",", ".") if commas and "." not in entry else entry

    return rows[0], [list(map(with_points, row)) for row in rows[1:]]


def _columns(path: Path, heads: list[str], named: dict[str, str]) -> dict[str, int]:
    """Signal → index of its column, the time first."""
    unknown = [signal for signal in named if signal not in ("time", *SIGNALS)]
    if unknown:
        raise InputError(
            f"there is no signal {', '.join(unknown)}; signals: time, {', '.join(SIGNALS)}"
        )
    found: dict[str, int] = {}
    for signal in ("time", *SIGNALS):
        if signal in named and named[signal] not in heads:
            raise InputError(
                f"{path}: it has no column {named[signal]!r}; columns: {', '.join(heads)}"
            )
        fitting = (
            [named[signal]] if signal in named else [head for head in heads if _means(head, signal)]
        )
        if len(fitting) > 1:
            raise InputError(
                f"{path}: {signal} may be any of {', '.join(fitting)}; say which with "
                + Option.COLUMN
                + f" {signal}=…"
            )
        if fitting:
            found[signal] = heads.index(fitting[0])
    if "time" not in found or not any(signal in found for signal in _NEEDED):
        missing = "time" if "time" not in found else " and ".join(_NEEDED)
        raise InputError(
            f"{path}: no column is seen to be {missing}; columns: {', '.join(heads)}; say "
            "which with " + Option.COLUMN + f" {missing.split(' ')[0]}=…"
        )
    return found


def _means(head: str, signal: str) -> bool:
    plain = re.sub(r"\[[^\]]*\]\s*$|\([^)]*\)\s*$", "", head).strip().strip("\"'").lower()
    plain = re.sub(r"[^a-z0-9]+", ".", plain).strip(".")
    return (
        plain in _TIMES
        if signal == "time"
        else f".{plain}".endswith("." + signal.replace("_", "."))
    )


def _number(path: Path, line: list[str], heads: list[str], column: int, row: int) -> float:
    entry = line[column] if column < len(line) else ""
    try:
        value = float(entry)
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        raise InputError(
            f"{path}, row {row + 1}, column {heads[column]!r}: {entry!r} is not a finite number"
        )
    return value
