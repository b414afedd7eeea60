"""Writes the files of finished results: NetCDF with units, long names and provenance; CSV, JSON, MATLAB.

The rows of a run that is under way: `recording_writer`."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from fmus.toolchain.extras import installed_version
from orchestrator.core.arrays import Matrix
from orchestrator.core.late import xarray_alone, xr
from orchestrator.core.safe_files import replacing, write_bytes, write_text
from orchestrator.output.results.netcdf import netcdf_image, stored_name
from orchestrator.systems.coupling.filtered_recorder import FILTER
from orchestrator.systems.coupling.recording_blocks import BLOCK_ROWS

if TYPE_CHECKING:
    from orchestrator.cases.scenario.prepare import PreparedScenario

_CSV_ROWS = 10_000  # rows of a table that are written at a time


def provenance(prepared: PreparedScenario) -> dict[str, str | float]:
    """Return what a result was made from: case text, values and those given, versions, FMU guids, step and schedule."""
    packages = ("gfor-cosim", "fmpy", "numpy", "pythonfmu", "scipy")
    fmus = {name: plan.description for name, plan in prepared.system.components.items()}
    tolerance = prepared.schedule.tolerance
    models = json.dumps(
        {
            n: {"model": d.model_name, "guid": d.guid, "tool": d.generation_tool}
            for n, d in fmus.items()
        }
    )
    return {
        "case": prepared.case.name,
        "scenario": prepared.name,
        "title": prepared.title,
        "case_file": prepared.case.text,
        "values": json.dumps(prepared.values),
        "given": json.dumps(prepared.given),
        "events": "; ".join(map(str, prepared.events)),
        "step_size_s": prepared.step_size,
        "schedule": f"{prepared.schedule.name}: {' | '.join(', '.join(g) for g in prepared.schedule.groups)}",
        **({} if tolerance is None else {"tolerance": tolerance}),
        "fmus": models,
        "versions": json.dumps(versions_of(packages)),
        "Conventions": "CF-1.10",
    }


def origin_of_rows(prepared: PreparedScenario) -> dict[str, str | float]:
    """`provenance` of a recording, with the interval of its rows and what they went through before."""
    filtered = prepared.record_filtered and prepared.record_every > 1
    how = f"low-pass: {FILTER}" if filtered else "none: every row is the signal at its time"
    return provenance(prepared) | {
        "record_interval_s": prepared.record_every * prepared.step_size,
        "record_every_steps": prepared.record_every,
        "record_filter": how,
        "places": json.dumps(measuring_places(prepared)),
    }


def measuring_places(prepared: PreparedScenario) -> dict[str, str]:
    """The bus of each unit, and both of each line, as names of the recording without their last part."""
    found = {
        wire.target.component: str(wire.source).removesuffix(".v_re")
        for wire in prepared.system.connections
        if wire.target.variable == "v_re" and str(wire.source).endswith(".v_re")
    }
    network, grid = prepared.network, prepared.case.table.power_flow
    if network is not None and grid is not None:
        found |= {
            f"{grid.grid}.{line.name}": f"{grid.grid}.{line.from_bus} {grid.grid}.{line.to_bus}"
            for line in network.lines
        }
    return found


def versions_of(packages: Iterable[str]) -> dict[str, str]:
    """Versions of those that are installed."""
    return {package: found for package in packages if (found := installed_version(package))}


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


def column_attributes(
    names: Iterable[str], prepared: PreparedScenario
) -> dict[str, dict[str, str]]:
    components = prepared.system.components
    found = {"time": {"units": "s", "long_name": "Time"}}
    for name in names:
        component, _, variable = name.partition(".")
        info = components[component].description.variables[variable]
        found[name] = {"units": info.unit, "long_name": f"{component}: {info.description}"}
    return found


def trajectory_dataset(recorder: Recorded, prepared: PreparedScenario) -> xr.Dataset:
    attributes = column_attributes(recorder.names, prepared)
    values = recorder.values
    data = {
        name: ("time", values[:, k].copy(), attributes[name])
        for k, name in enumerate(recorder.names)
    }
    time = ("time", recorder.times.copy(), attributes["time"])
    return xr.Dataset(data, coords={"time": time}, attrs=origin_of_rows(prepared))


def save_dataset(dataset: xr.Dataset, path: Path) -> None:
    """Write ``path``.nc and ``path``.csv of a recording in memory."""
    names = [str(name) for name in dataset.data_vars]
    units = {name: dataset[name].attrs for name in ("time", *names)}
    values = (
        np.column_stack([dataset[n].values for n in names])
        if names
        else np.empty((dataset.sizes["time"], 0))
    )
    chunk = max(1, min(BLOCK_ROWS, len(values)))
    image = netcdf_image(names, dataset["time"].values, values, units, dataset.attrs, chunk)
    write_bytes(path.with_suffix(".nc"), image)
    save_csv(dataset, path.with_suffix(".csv"))


def save_csv(dataset: xr.Dataset, path: Path) -> None:
    """Write recorded signals over the time as a table, some rows at a time."""
    names = [str(name) for name in dataset.data_vars]
    header = io.StringIO()
    csv.writer(header, lineterminator="\n").writerow(
        ["time [s]", *(safe_cell(f"{n} [{dataset[n].attrs['units']}]") for n in names)]
    )
    rows = dataset.sizes["time"]
    with replacing(path) as partial, partial.open("w", newline="", encoding="utf-8") as file:
        file.write(header.getvalue())
        for begin in range(0, rows, _CSV_ROWS):
            part = dataset.isel(time=slice(begin, begin + _CSV_ROWS))
            table = np.column_stack([part["time"].values, *(part[n].values for n in names)])
            np.savetxt(file, table, delimiter=",", fmt="%.10g")


def safe_cell(value: Any) -> Any:
    """A cell of a table; a text that a spreadsheet would take for a formula gets an apostrophe before it."""
    if isinstance(value, str) and value.startswith(("=", "+", "-", "@", "\t", "\r")):
        try:
            float(value)
        except ValueError:
            return f"'{value}"
    return value


def save_table(rows: Iterable[Mapping[str, Any]], path: Path, names: Sequence[str] = ()) -> None:
    """Write rows of equal keys as CSV; ``names`` are its columns where there may be no row."""
    rows = list(rows)
    file = io.StringIO(newline="")
    writer = csv.writer(file)
    names = list(rows[0]) if rows else names
    writer.writerow([safe_cell(name) for name in names])
    writer.writerows([safe_cell(row.get(name, "")) for name in names] for row in rows)
    write_text(path, file.getvalue())


def save_matrix(matrix: Matrix, rows: Sequence[str], columns: Sequence[str], path: Path) -> None:
    """Write a matrix as CSV, with the names of its rows and columns."""
    file = io.StringIO(newline="")
    writer = csv.writer(file)
    writer.writerow(["", *map(safe_cell, columns)])
    for name, numbers in zip(rows, matrix, strict=True):
        writer.writerow([safe_cell(name), *numbers.tolist()])
    write_text(path, file.getvalue())


def save_json(content: Any, path: Path) -> None:
    write_text(path, json.dumps(content, indent=1, ensure_ascii=False) + "\n")


def save_matrices(content: Mapping[str, Any], path: Path) -> None:
    from scipy.io import savemat  # noqa: PLC0415 - a tenth of a second that only this format needs

    file = io.BytesIO()
    savemat(file, dict(content))
    write_bytes(path, file.getvalue())


def save_netcdf(dataset: xr.Dataset, path: Path) -> None:
    """Write a dataset of moderate size as NetCDF-3."""
    kept = dataset.rename({name: stored_name(str(name)) for name in dataset.data_vars})
    with xarray_alone():
        image = kept.to_netcdf(engine="scipy")
    write_bytes(path, bytes(image))
