"""Our own FMUs, unpacked once and kept for the next system of this process that has them.

A study opens the same FMUs again and again, and three quarters of an opening are the unpacking, and the Python modules
inside, which stay loaded for as long as their folder is there. What a stranger packed has a new folder each time: its
code may have changed what lies there."""

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from fmus.toolchain.slave_code import lay_code
from fmus.toolchain.temporary import remove
from orchestrator.devices.fmi.archive import extract

# folders that are kept beside those in use: a study has a dozen kinds of components, and each takes a megabyte
_MOST_UNUSED = 24

_Key = tuple[str, int, int, int]


@dataclass
class _Folder:
    path: Path
    users: int = 0


_folders: dict[_Key, _Folder] = {}
"""By file, the least recently used first."""

_one_at_a_time = threading.Lock()
_process = os.getpid()


def extract_with_code(path: Path) -> Path:
    """Unpack an FMU into a new temporary folder, in which Python finds our own modules compiled."""
    folder = extract(path)
    lay_code(folder / "resources")
    return folder


@contextmanager
def unpacked(path: Path) -> Iterator[Path]:
    """The folder into which an FMU of our own is unpacked; nobody may write there.

    A file that has changed since has another folder."""
    seen = path.stat()
    key = str(path), seen.st_ino, seen.st_size, seen.st_mtime_ns
    with _one_at_a_time:
        _forget_those_of_another_process()
        folder = _folders.pop(key, None)
        if folder is None or not folder.path.exists():
            folder = _Folder(extract_with_code(path))
        _folders[key] = folder
        folder.users += 1
    try:
        yield folder.path
    finally:
        with _one_at_a_time:
            _forget_those_of_another_process()
            folder.users -= 1
            _remove_the_oldest()


def _forget_those_of_another_process() -> None:
    """A copy of a process has folders of its own, as the other one may remove what it has."""
    global _process  # noqa: PLW0603 - a process has one number
    if _process != os.getpid():
        _process = os.getpid()
        _folders.clear()


def _remove_the_oldest() -> None:
    unused = [key for key, folder in _folders.items() if not folder.users]
    for key in unused[: max(0, len(unused) - _MOST_UNUSED)]:
        with suppress(OSError):
            remove(_folders.pop(key).path)
