"""Sources of a report: the folders that `gfor run` and `gfor sweep` leave."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from orchestrator.cases.case import Case, load_case
from orchestrator.core.errors import InputError
from orchestrator.output.results.manifest import MANIFEST, check_one_run, checked, read_manifest
from orchestrator.output.results.recording_reader import open_whole, warn_of_early_end
from orchestrator.output.results.recording_writer import TRAJECTORY

if TYPE_CHECKING:
    import xarray as xr

SUMMARY = "summary.json"  # what a folder of `gfor run` has, and no other


@dataclass
class Results:
    folder: Path
    case: Case
    scenarios: list[dict[str, Any]]  # one summary a scenario, as in ``summary.json``
    modes: list[dict[str, str]]
    participation: list[dict[str, str]]
    step_sizes: list[dict[str, str]]
    trajectories: dict[str, xr.Dataset]
    linear: dict[str, xr.Dataset]
    # how and where the study ended before its last scenario, as in ``summary.json``; None where it came to its end
    ended_early: dict[str, Any] | None = None
    beside: Sequence[str] = ()  # what devices bring, as `gfor modes` says it


def read_results(folder: Path) -> Results:
    summary = folder / SUMMARY
    tables = ("summary.json", "case.toml", "modes.csv", "participation.csv", "step_size.csv")
    check_one_run(folder, tables, ("trajectory.nc", "linear.nc"))
    try:
        content = json.loads(summary.read_text(encoding="utf-8"))
        case = load_case(folder / "case.toml")
        scenarios = content["scenarios"]
        names = [s["name"] for s in scenarios]
        return Results(
            folder,
            case,
            scenarios=scenarios,
            modes=_rows(folder / "modes.csv"),
            participation=_rows(folder / "participation.csv"),
            step_sizes=_rows(folder / "step_size.csv"),
            trajectories=dict(_datasets(folder, names, "trajectory.nc")),
            linear=dict(_datasets(folder, names, "linear.nc")),
            ended_early=content.get("ended_early"),
            beside=content.get("beside", []),
        )
    except (OSError, ValueError, KeyError) as error:
        raise InputError(
            f"{folder}: a result file cannot be read: {error}; run the study again"
        ) from error


def sweeps_of(place: Path) -> list[xr.Dataset]:
    own = place.is_file() and place.match("sweep.nc")
    return [_load(path) for path in ([place] if own else sorted(place.glob("sweep.nc")))]


def _rows(path: Path) -> list[dict[str, str]]:
    if not path.is_file():
        return []
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def _datasets(folder: Path, names: Sequence[str], file: str) -> Iterator[tuple[str, xr.Dataset]]:
    for name in names:
        path = folder / name / file
        if path.is_file():
            dataset = _load(path)
            manifest = read_manifest(path.parent)
            said = (manifest.scenario if manifest else "") or name
            recorded = dataset.attrs.get("scenario", said)
            found = said if recorded == name else recorded
            if found != name:
                raise InputError(
                    f"{path}: it is the recording of scenario {found!r}, and lies in the folder of {name!r}: the "
                    "folders were renamed or swapped; give each its own name again, or run the study again"
                )
            if not dataset.sizes["time"]:
                raise InputError(
                    f"{path}: nothing was recorded in it, so there is no response to show; run the scenario again"
                )
            if file == TRAJECTORY:
                warn_of_early_end(dataset, str(path))
            yield name, dataset


def _load(path: Path) -> xr.Dataset:
    if path.name == "sweep.nc" and (path.parent / MANIFEST).is_file():
        checked(path.parent, [path.name])
    return open_whole(path)
