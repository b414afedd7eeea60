"""What a report is made from: the folders that `gfor run`, `gfor sweep` and `gfor design` leave."""

import csv
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import xarray as xr

from orchestrator.cases.case import Case, load_case
from orchestrator.errors import InputError
from orchestrator.results.manifest import MANIFEST, check_one_run, checked, read_manifest
from orchestrator.results.recorded import open_whole, warn_of_early_end
from orchestrator.results.recording import TRAJECTORY


@dataclass
class Results:
    """Contents of result folders, read as far as they are there."""

    folder: Path
    case: Case
    scenarios: list[dict[str, Any]]  # one summary a scenario, as in ``summary.json``
    modes: list[dict[str, str]]
    participation: list[dict[str, str]]
    step_sizes: list[dict[str, str]]
    trajectories: dict[str, xr.Dataset]
    linear: dict[str, xr.Dataset]
    # sweeps, designs: datasets and calculation sheets that were found beside the run
    sweeps: list[xr.Dataset] = field(default_factory=list)
    designs: list[dict[str, Any]] = field(default_factory=list)
    # how and where the study ended before its last scenario, as in ``summary.json``; None where it came to its end
    ended_early: dict[str, Any] | None = None


def read_results(folder: Path, others: Sequence[Path] = ()) -> Results:
    """Read a run's folder, and sweeps and designs from it and from further folders.

    Raises an `InputError` if the folder holds no run, its files are of different runs or not as they were written, or a
    file in it cannot be read.
    """
    summary = folder / "summary.json"
    if not summary.is_file():
        raise InputError(
            f"{folder}: there is no summary.json in it, so it is not the folder of a run; "
            "make one with `gfor run CASE --out DIR`, and give that folder first"
        )
    for other in others:
        if not other.exists():
            raise InputError(f"{other}: there is no such file or folder")
        if other.is_dir() and other != folder and (other / "summary.json").is_file():
            raise InputError(
                f"{other}: this is the folder of another run; a report is of one run, {folder}, with its sweeps "
                "and designs; write one report for each run, or compare two with `gfor compare`"
            )
    tables = ("summary.json", "case.toml", "modes.csv", "participation.csv", "step_size.csv")
    check_one_run(folder, tables, ("trajectory.nc", "linear.nc"))
    try:
        content = json.loads(summary.read_text(encoding="utf-8"))
        case = load_case(folder / "case.toml")
        scenarios = content["scenarios"]
        names = [s["name"] for s in scenarios]
        results = Results(
            folder,
            case,
            scenarios,
            _rows(folder / "modes.csv"),
            _rows(folder / "participation.csv"),
            _rows(folder / "step_size.csv"),
            dict(_datasets(folder, names, "trajectory.nc")),
            dict(_datasets(folder, names, "linear.nc")),
            ended_early=content.get("ended_early"),
        )
        for place in (folder, *others):
            sweeps, designs = [_load(path) for path in _files(place, "sweep.nc")], _designs(place)
            if place != folder and not (sweeps or designs):
                raise InputError(_unused(place))
            results.sweeps += sweeps
            results.designs += designs
    except (OSError, ValueError, KeyError) as error:
        raise InputError(f"{folder}: a result file cannot be read: {error}; run the study again") from error
    return results


def _unused(place: Path) -> str:
    pages = ", ".join(path.name for path in sorted(place.glob("*.html")))
    own = f"it has a page of its own: {pages}" if pages else "leave it out"
    return (
        f"{place}: nothing in it belongs into a run's report, which takes sweeps and designs of POD controllers; {own}"
    )


def _designs(place: Path) -> list[dict[str, Any]]:
    """The calculation sheet in a file, or those among the JSON files of a folder, which may hold other people's too."""
    contents = []
    for path in _files(place, "*.json"):
        try:
            contents.append(json.loads(path.read_text(encoding="utf-8")))
        except ValueError:
            if path == place:
                raise
    return [c for c in contents if isinstance(c, dict) and {"controller", "target_mode", "T_S1"} <= c.keys()]


def _files(place: Path, pattern: str) -> list[Path]:
    return [place] if place.is_file() and place.match(pattern) else sorted(place.glob(pattern))


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
            if (found := dataset.attrs.get("scenario", said)) != name or (found := said) != name:
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
