"""A recording that was finished, or ended before its time, as one that grows again."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from orchestrator.results.netcdf import DAMAGED, stored_name
from orchestrator.results.recording import RecordingFolder, parts_of, rows_in


def take_back(
    recording: RecordingFolder, names: tuple[str, ...], rows: int, block: int, whole: Iterable[Path], run: str
) -> bool:
    """Make a recording hold at least so many rows, from files into which they were joined if need be."""
    import h5py  # noqa: PLC0415 - a tenth of a second that only a resumed run needs

    if rows_in(parts_of(recording.folder)) >= rows:
        return True
    for path in whole:
        try:
            with h5py.File(path, "r") as file:
                if file.attrs.get("run") != run or len(file["time"]) < rows:
                    continue
                recording.begin(names)
                for first in range(0, rows, block):
                    part = slice(first, min(first + block, rows))
                    values = np.column_stack([file[stored_name(name)][part] for name in names])
                    recording.keep(first, file["time"][part], values)
                return True
        except DAMAGED:  # it is not there, or not whole
            continue
    return False
