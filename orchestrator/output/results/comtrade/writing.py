"""Recorded signals as a COMTRADE recording of 2013, or of 1999 for 16 bits and text."""

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import xarray as xr

from orchestrator.core.arrays import Numbers
from orchestrator.core.errors import InputError
from orchestrator.core.safe_files import write_bytes
from orchestrator.output.results.comtrade.configuration import FORMS

_LARGEST = {"ASCII": 99998, "BINARY": 0x7FFE, "BINARY32": 0x7FFFFFFE}
"""Largest whole number of a sample; those beyond stand for missing samples."""

_TYPES = {"BINARY": "<i2", "BINARY32": "<i4", "FLOAT32": "<f4"}
_MOST_STAMP = 0xFFFFFFFE
_EVEN = 1e-3  # part of the interval by which times may be off and still count as evenly sampled
_START = "01/01/2000,00:00:00.000000"  # date and time of t = 0: a simulation has none


def write_comtrade(
    dataset: xr.Dataset,
    names: Sequence[str],
    path: Path,
    form: str = "BINARY32",
    frequency: float = 50.0,
) -> tuple[Path, Path]:
    """Write signals over the time.

    A sample is a whole number between the signal's least and largest value, so that its error is at most a part of that
    span: 1.2e-10 with ``BINARY32``, 7.6e-6 with ``BINARY``, 2.5e-6 with ``ASCII``; with ``FLOAT32`` it is 6e-8 of the
    largest distance from the middle of the span.

    ``dataset``: evenly recorded signals over the time [s].
    ``path``: of the ``.cfg``; the ``.dat`` gets the same stem."""
    if form not in FORMS:
        raise InputError(f"the form {form!r} is unknown; choose one of {', '.join(FORMS)}")
    times = np.asarray(dataset["time"].values, dtype=float)
    interval = _interval(times)
    columns, lines = [], []
    for k, name in enumerate(names, start=1):
        values = np.asarray(dataset[name].values, dtype=float)
        if not np.isfinite(values).all():
            raise InputError(
                f"signal {name}: it is no finite number at t = {times[~np.isfinite(values)][0]:g} s"
            )
        scale, offset, stored = _stored(values, form)
        columns.append(stored)
        least, largest = (
            (stored.min(), stored.max()) if form == "FLOAT32" else (-_LARGEST[form], _LARGEST[form])
        )
        unit = _plain(dataset[name].attrs.get("units", ""))
        lines.append(
            f"{k},{_plain(name)},,,{unit},{scale!r},{offset!r},0,{least:g},{largest:g},1,1,P"
        )
    multiplier = max(1, math.ceil((times[-1] - times[0]) * 1e6 / _MOST_STAMP))
    stamps = np.round((times - times[0]) * 1e6 / multiplier).astype(np.int64)
    revision = "2013" if form in ("BINARY32", "FLOAT32") else "1999"
    head = [
        f"{_plain(dataset.attrs.get('case', ''))},gfor-cosim {_plain(dataset.attrs.get('scenario', ''))},{revision}",
        f"{len(names)},{len(names)}A,0D",
    ]
    tail = [
        f"{frequency:g}",
        "1",
        f"{1 / interval!r},{len(times)}",
        _START,
        _START,
        form,
        str(multiplier),
    ]
    tail += ["0,0", "0,0"] if revision == "2013" else []
    configuration, samples = path.with_suffix(".cfg"), path.with_suffix(".dat")
    write_bytes(samples, _samples(form, stamps, columns))
    write_bytes(configuration, ("\r\n".join([*head, *lines, *tail]) + "\r\n").encode("utf-8"))
    return configuration, samples


def _interval(times: Numbers) -> float:
    if len(times) < 2:
        raise InputError("a recording in COMTRADE needs two rows or more; record a longer run")
    interval = float(times[-1] - times[0]) / (len(times) - 1)
    off = np.abs(times - times[0] - interval * np.arange(len(times)))
    if off.max() > _EVEN * interval:
        raise InputError(
            f"the run is not recorded evenly: about t = {times[int(off.argmax())]:g} s the interval is not the mean "
            f"one of {interval:g} s; set solver.record_interval to a multiple of the step and run again"
        )
    return float(f"{interval:.12g}")  # without the last digits of times that were summed up


def _stored(values: Numbers, form: str) -> tuple[float, float, Numbers]:
    """Scale, offset and samples: value = scale · sample + offset."""
    offset = float(values.min() + values.max()) / 2
    half = float(np.abs(values - offset).max())
    if form == "FLOAT32":
        return 1.0, offset, values - offset
    scale = half / _LARGEST[form] if half > 0 else 1.0
    return scale, offset, np.round((values - offset) / scale)


def _samples(
    form: str, stamps: np.ndarray[tuple[int], np.dtype[np.int64]], columns: Sequence[Numbers]
) -> bytes:
    count = len(stamps)
    if form == "ASCII":
        rows = np.column_stack([np.arange(1, count + 1), stamps, *columns]).astype(np.int64)
        return ("\r\n".join(",".join(map(str, row)) for row in rows.tolist()) + "\r\n").encode(
            "ascii"
        )
    table = np.empty(
        count, [("number", "<u4"), ("stamp", "<u4"), ("analog", _TYPES[form], (len(columns),))]
    )
    table["number"], table["stamp"] = np.arange(1, count + 1), stamps
    table["analog"] = np.column_stack(columns)
    return table.tobytes()


def _plain(text: object) -> str:
    """A field, without what would end it."""
    return " ".join(str(text).replace(",", ";").split())
