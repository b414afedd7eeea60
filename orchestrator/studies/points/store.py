"""Finished points on disk: no point is computed twice, and an interrupted study continues where it ended."""

import json
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestrator.core.errors import InputError, ResultsError
from orchestrator.core.options import Option
from orchestrator.core.safe_files import PARTIAL, made_folder, replacing

Arrays = dict[str, NDArray[Any]]

POINTS = "points"  # folder of the points in that of a study's results
_KEPT = ".npz"


class PointStore:
    """A folder with one small file for each point. An incomplete file counts as missing."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        made_folder(folder, what="points cannot be kept there")

    def load(self, key: str) -> tuple[dict[str, Any], Arrays] | None:
        try:
            with np.load(self._path(key), allow_pickle=False) as data:
                arrays = {name: data[name] for name in data}
            header = json.loads(arrays.pop("header").tobytes())
        except (OSError, EOFError, ValueError, KeyError, zipfile.BadZipFile, zlib.error):
            return None
        return (
            (header, arrays)
            if isinstance(header, dict) and header.pop("key", None) == key
            else None
        )

    def save(self, key: str, header: Mapping[str, Any], arrays: Arrays) -> None:
        """Write a point in one step: the file gets the name that `load` looks for only when it is complete."""
        text = json.dumps({**header, "key": key}).encode()
        try:
            with replacing(self._path(key)) as partial, partial.open("wb") as file:
                np.savez(
                    file, allow_pickle=False, header=np.frombuffer(text, dtype=np.uint8), **arrays
                )
        except ResultsError as error:
            raise InputError(
                Option.OUT
                + f": a finished point cannot be kept: {error}, and start the same command "
                "again: what is written stays"
            ) from error

    def _path(self, key: str) -> Path:
        return self.folder / f"{key}{_KEPT}"


def holds_points_alone(folder: Path) -> bool:
    """Return whether a folder is that of a study's points, be it before the first one."""
    return folder.is_dir() and all(path.suffix == _KEPT for path in folder.iterdir())


def any_kept(folder: Path) -> bool:
    return any(not path.name.startswith(PARTIAL) for path in folder.glob(f"*{_KEPT}"))
