"""Writes the recording of a run while it grows: a folder of small files, each of them whole, joined at the end."""

from __future__ import annotations

import atexit
import shutil
from collections.abc import Iterator, Sequence
from pathlib import Path
from shutil import rmtree
from tempfile import mkdtemp
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from orchestrator.core.errors import InputError, ResultsError
from orchestrator.core.options import Option
from orchestrator.core.safe_files import flush, not_written, write_bytes
from orchestrator.output.results.file_writers import column_attributes, origin_of_rows
from orchestrator.output.results.netcdf import (
    DAMAGED,
    Attributes,
    join_netcdf,
    netcdf_image,
    opened,
    stored_name,
)
from orchestrator.systems.coupling.recording_blocks import Block

if TYPE_CHECKING:
    from orchestrator.cases.scenario.prepare import PreparedScenario

_NUMBER = 8  # bytes of a value in the compressed parts together with the joined file
_CSV_NUMBER = 13  # bytes of a value in the table: its digits


def recorded_size(prepared: PreparedScenario, *, csv: bool) -> float:
    """About what the recording of a scenario takes on the disk at most [bytes]."""
    rows = prepared.stop_time / prepared.step_size / prepared.record_every + 1
    return rows * (len(prepared.record) + 1) * (_NUMBER + (_CSV_NUMBER if csv else 0))


def require_room(scenarios: Sequence[PreparedScenario], folder: Path, *, csv: bool) -> None:
    needed, free = (
        sum(recorded_size(prepared, csv=csv) for prepared in scenarios),
        shutil.disk_usage(folder).free,
    )
    if needed <= free:
        return
    longest = max(scenarios, key=lambda prepared: recorded_size(prepared, csv=csv))
    interval = longest.step_size * longest.record_every
    raise InputError(
        f"{folder}: the recordings would take about {_in_words(needed)} there, and {_in_words(free)} are free: "
        f"{len(longest.record)} signals every {interval:g} s until t = {longest.stop_time:g} s"
        + (f", in {len(scenarios)} scenarios" if len(scenarios) > 1 else "")
        + (
            "; make solver.record_interval longer, name fewer signals in solver.record, "
            "end the run earlier (" + Option.STOP + "), "
        )
        + (("leave the table out (" + Option.NO_CSV + "), ") if csv else "")
        + ("or choose another disk (" + Option.OUT + ")")
    )


def _in_words(size: float) -> str:
    for unit in ("B", "kB", "MB", "GB"):
        if size < 1000:
            return f"{size:.3g} {unit}"
        size /= 1000
    return f"{size:,.4g} TB"


FOLDER = "recording"  # of the files of a recording that is not finished, in its scenario's folder


TRAJECTORY = "trajectory.nc"  # A recording that is finished
# attribute of a recording whose run ended before its stop time: the reason
ENDED_EARLY = "ended_early"


class RecordingFolder:
    """Rows of a run in files ``000000000000.nc``, named by the number of their first row.

    Each is a NetCDF-4 file, written at once; the last one is replaced as it grows. So every moment leaves a recording
    that can be read, whatever ends the process."""

    def __init__(
        self, folder: Path, prepared: PreparedScenario, further: Attributes | None = None
    ) -> None:
        import h5py  # noqa: F401, PLC0415 - here rather than in the first step, whose time is measured

        self.folder = folder
        self._names = tuple(prepared.record)
        self._units = column_attributes(prepared.record, prepared)
        self._attributes: dict[str, Any] = origin_of_rows(prepared) | dict(further or {})
        self._chunk = 0
        # until a run begins: then what lies there is of an earlier one
        self._rows: int | None = None

    def begin(self, names: Sequence[str]) -> None:
        self._names, self._chunk, self._rows = tuple(names), 0, 0
        try:
            rmtree(self.folder, ignore_errors=True)
            self.folder.mkdir(parents=True)
        except OSError as error:
            raise not_written(self.folder, error) from error

    def keep(self, first: int, times: NDArray[np.float64], values: NDArray[np.float64]) -> None:
        self._chunk = max(self._chunk, len(times))
        image = netcdf_image(
            self._names, times, values, self._units, self._attributes, max(1, len(times))
        )
        if not self.folder.is_dir():
            raise not_written(self.folder, FileNotFoundError(2, "No such file or directory"))
        write_bytes(self.folder / f"{first:012d}.nc", image)
        self._rows = first + len(times)

    def resume(self, names: Sequence[str], rows: int) -> Iterator[Block]:
        self._names = tuple(names)
        for part in parts_of(self.folder):
            first = int(part.stem)
            if first >= rows:
                part.unlink()
                continue
            times, values = _read(part, self._names)
            if first + len(times) > rows:
                self.keep(first, times[: rows - first], values[: rows - first])
            self._rows = min(rows, first + len(times))
            yield first, times[: rows - first], values[: rows - first]

    def join(self, path: Path, further: Attributes | None = None) -> None:
        """Write all as one file, and remove the parts.

        ``further``: more attributes of it, such as `ENDED_EARLY`.
        Raises a `ResultsError` if it cannot be written, or the parts are not those that the run has written; the parts
        stay."""
        parts = parts_of(self.folder)
        found = rows_in(parts)
        if self._rows is not None and found != self._rows:
            raise ResultsError(
                f"{self.folder}: {self._rows} rows were recorded, and {found} follow each other there without a gap: "
                "something else changed the files meanwhile, so they are not taken for the run's; make the run again, "
                "into another folder"
            )
        attributes = self._attributes | dict(further or {})
        if not parts:
            empty = np.empty((0, len(self._names)))
            write_bytes(
                path, netcdf_image(self._names, np.empty(0), empty, self._units, attributes, 1)
            )
        else:
            join_netcdf(parts, path, self._names, self._units, attributes)
        rmtree(self.folder, ignore_errors=True)
        flush(path.parent)


def temporary_recording(prepared: PreparedScenario) -> RecordingFolder:
    """A recording in the system's folder for temporary files; it is removed when the process ends."""
    folder = Path(mkdtemp(prefix="gfor_recording_"))
    atexit.register(rmtree, folder, ignore_errors=True)
    require_room([prepared], folder, csv=False)
    return RecordingFolder(folder / FOLDER, prepared)


def parts_of(folder: Path) -> list[Path]:
    return sorted(path for path in folder.glob("*.nc") if path.stem.isdigit())


def rows_in(parts: Sequence[Path]) -> int:
    """Rows of an unfinished recording that follow each other without a gap, up to a part that cannot be read."""
    rows = 0
    for part in parts:
        try:
            with opened(part) as file:
                if int(part.stem) != rows:
                    break
                rows += len(file["time"])
        except DAMAGED:
            break
    return rows


def _read(part: Path, names: Sequence[str]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    try:
        with opened(part) as file:
            return file["time"][...], np.column_stack(
                [file[stored_name(name)][...] for name in names]
            )
    except DAMAGED as error:
        raise InputError(f"{part}: it cannot be read as part of a recording: {error}") from error
