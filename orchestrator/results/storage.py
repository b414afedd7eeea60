"""Results on disk: NetCDF with units, long names and provenance, and CSV beside it."""

import csv
import json
from collections.abc import Iterable, Mapping
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from orchestrator.cases.prepare import PreparedScenario


def provenance(prepared: PreparedScenario) -> dict[str, str | float]:
    """What a result was made from: case text, values, versions, FMU guids, step and schedule."""
    packages = ("gfor-cosim", "casadi", "fmpy", "numpy", "pythonfmu", "scipy")
    fmus = {name: plan.description for name, plan in prepared.system.components.items()}
    return {
        "case": prepared.case.name,
        "scenario": prepared.name,
        "title": prepared.title,
        "case_file": prepared.case.text,
        "values": json.dumps(prepared.values),
        "events": "; ".join(map(str, prepared.events)),
        "step_size_s": prepared.step_size,
        "schedule": f"{prepared.schedule.name}: {' | '.join(', '.join(g) for g in prepared.schedule.groups)}",
        "fmus": json.dumps(
            {n: {"model": d.model_name, "guid": d.guid, "tool": d.generation_tool} for n, d in fmus.items()}
        ),
        "versions": json.dumps(versions_of(packages)),
        "Conventions": "CF-1.10",
    }


def versions_of(packages: Iterable[str]) -> dict[str, str]:
    """Versions of packages, by name, without those whose extra is not installed."""
    found = {}
    for package in packages:
        with suppress(PackageNotFoundError):
            found[package] = version(package)
    return found


class Recorded(Protocol):
    """Values by time and name, such as those of a `Recorder`."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names ``component.variable`` of the columns."""

    @property
    def times(self) -> NDArray[np.float64]:
        """Times of the rows [s]."""

    @property
    def values(self) -> NDArray[np.float64]:
        """A row for each time and a column for each name."""


def trajectory_dataset(recorder: Recorded, prepared: PreparedScenario) -> xr.Dataset:
    """Recorded variables as a labelled dataset over time [s]."""
    components = prepared.system.components
    data = {}
    for column, name in enumerate(recorder.names):
        component, _, variable = name.partition(".")
        info = components[component].description.variables[variable]
        attributes = {"units": info.unit, "long_name": f"{component}: {info.description}"}
        data[name] = ("time", recorder.values[:, column].copy(), attributes)
    time = ("time", recorder.times.copy(), {"units": "s", "long_name": "Time"})
    return xr.Dataset(data, coords={"time": time}, attrs=provenance(prepared))


def save_dataset(dataset: xr.Dataset, path: Path) -> None:
    """Write ``path``.nc and ``path``.csv."""
    path.parent.mkdir(parents=True, exist_ok=True)
    dataset.to_netcdf(path.with_suffix(".nc"), engine="scipy")
    names = list(dataset.data_vars)
    header = ",".join(["time [s]", *(f"{n} [{dataset[n].attrs['units']}]" for n in names)])
    table = np.column_stack([dataset["time"].values, *(dataset[n].values for n in names)])
    np.savetxt(
        path.with_suffix(".csv"),
        table,
        delimiter=",",
        header=header,
        comments="",
        fmt="%.10g",
        encoding="utf-8",
    )


def save_table(rows: Iterable[Mapping[str, Any]], path: Path) -> None:
    """Write rows of equal keys as CSV."""
    rows = list(rows)
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, fieldnames=list(rows[0]) if rows else [])
        writer.writeheader()
        writer.writerows(rows)


def save_json(content: Any, path: Path) -> None:
    """Write indented JSON."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(content, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
