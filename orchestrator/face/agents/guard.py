"""Files that a process may open which answers an agent: the given folders to read, one to write."""

import mimetypes
import os
import sys
import sysconfig
import tempfile
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from fmus.toolchain.cache import cache_directory

_WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND

_PACKAGES = ("fmus", "gfor_fmu", "orchestrator")
"""Ours, which may lie elsewhere than Python's packages: a checkout that is being worked on."""

_CHANGES = frozenset(
    {"os.remove", "os.rename", "os.rmdir", "os.link", "os.symlink", "os.truncate", "shutil.rmtree"}
)
"""Events of Python's audit hook, other than ``open``, by which files are changed."""

_DEVICES = ("/dev/null", "/dev/shm")
"""Where Python drops what nobody reads, and shares memory among processes."""

_SYSTEM = (
    "/sys/fs/cgroup",
    "/dev/urandom",
    "/usr",
    "/lib",
    "/lib64",
    "/etc/ld.so.cache",
    "/etc/localtime",
    *mimetypes.knownfiles,
)
"""Files and folders that libraries read on Linux to find their like, the number of cores and the time."""

_PROC = Path("/proc")

_OF_PROCESSES = frozenset(
    {"cgroup", "children", "cpuinfo", "filesystems", "maps", "meminfo", "stat", "statm", "status"}
)
"""Files of /proc that libraries read: no words of a command, no environment, which may hold secrets."""


def keep_within(roots: Sequence[Path], results: Path) -> None:
    """Refuse, from now on and in this process, to open files outside of folders that an agent may use.

    Python's own folders, gfor's, its cache, Matplotlib's and the folder of temporary files (``TMPDIR``) stay open. A
    library that opens files without Python is not seen; foreign FMUs run in a sandbox of their own.

    Parameters
    ----------
    roots
        Folders that may be read, with all that is in them.
    results
        The folder that may be written.
    """
    places = [sys.prefix, sys.base_prefix, *sysconfig.get_paths().values(), *sys.path, *_SYSTEM]
    own = [Path(place) for place in places if place]
    own += [_folder(package) for package in _PACKAGES]
    written = [
        results,
        Path(tempfile.gettempdir()),
        cache_directory("").absolute(),
        *map(Path, _DEVICES),
    ]
    pictures = os.environ.get("MPLCONFIGDIR")
    if pictures:
        written.append(Path(pictures))
    readable = _resolved([*roots, *own, *written])
    writable = _resolved(written)

    def watch(event: str, arguments: tuple[Any, ...]) -> None:
        if event == "open":
            path, mode, flags = arguments
            writes = bool(flags & _WRITING) or any(c in str(mode or "") for c in "wax+")
            _check(path, writable if writes else readable, writes=writes)
        elif event in _CHANGES:
            _check(arguments[0], writable, writes=True)

    sys.addaudithook(watch)


def is_within(path: Path, folders: Sequence[Path]) -> bool:
    """Return whether a path, with its links followed, is in one of the folders or is one of them; not one of links
    without an end."""
    try:
        place = path.resolve()
    except RuntimeError:  # as Python 3.11 and 3.12 call a loop of links
        return False
    return any(place.is_relative_to(folder) for folder in folders)


def _is_of_processes(path: Path) -> bool:
    place = path.resolve()
    return place.is_relative_to(_PROC) and place.name in _OF_PROCESSES


def _folder(package: str) -> Path:
    spec = find_spec(package)
    if spec is None or not spec.submodule_search_locations:
        raise ModuleNotFoundError(f"{package} is a part of gfor-cosim and is not installed")
    return Path(next(iter(spec.submodule_search_locations)))


def _resolved(paths: Sequence[Path]) -> tuple[Path, ...]:
    return tuple(path.resolve() for path in paths)


def _check(path: object, folders: Sequence[Path], *, writes: bool) -> None:
    if not isinstance(path, str | bytes | os.PathLike):
        return  # the number of a file that is open
    place = Path(os.fsdecode(path))
    if not is_within(place, folders) and not (not writes and _is_of_processes(place)):
        does = "written" if writes else "read"
        raise PermissionError(
            f"{place}: it lies outside of the folders that may be {does} here; "
            "start gfor mcp with --root (to read) or --results (to write) for that folder"
        )
