"""Readers of measured recordings, found by the ending of a file's name: ours, and those of other distributions."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from fmus.toolchain.plugins import PlugIns
from orchestrator.core.late import xr

Reader = Callable[[Path], "xr.Dataset"]
"""Gives the signals of a file by name over the coordinate ``time`` [s], with `LINE_FREQUENCY`."""

LINE_FREQUENCY = "line_frequency_hz"
"""Coordinate of a recording's signals: frequency of the line [Hz], 0 where the file leaves it open."""

READERS: PlugIns[Reader] = PlugIns("gfor_cosim.readers", lambda: (Callable,))  # type: ignore[arg-type, return-value]
"""Readers by ending, in small letters and without the dot."""

_OURS = ("", "nc", "toml")
"""Endings of our own results, for which no reader is looked for."""


def reader_of(path: Path) -> Reader | None:
    """Return what reads a file of that name; None where it is no recording of others."""
    return READERS[_ending(path)] if has_reader(path) else None


def has_reader(path: Path) -> bool:
    """Return whether the file's name is that of a measured recording."""
    return _ending(path) not in _OURS and _ending(path) in READERS


def _ending(path: Path) -> str:
    return path.suffix.lower().removeprefix(".")
