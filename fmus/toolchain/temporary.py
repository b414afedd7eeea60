"""Temporary folders that say by a lock whose they are: those whose owner is gone are removed at the next start.

A process removes its own at its end, also those that an interrupt let nobody remove; one that is killed does not. The
lock of a folder ends with the last process that holds it open, also in another container and when a process number is
used again."""

import atexit
import contextlib
import os
import tempfile
import time
from pathlib import Path

from fmus.toolchain.removal import remove_tree

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

_LOCKED = "gfor_locked_"
"""Beginning of the names of folders that have their lock."""

_NEW = "gfor_new_"
"""Beginning of the names of folders that get their lock within microseconds."""

_YOUNG = 60.0  # age below which a new folder may not have its lock yet [s]
# age at which a folder counts as left behind where there are no locks [s]
_ABANDONED = 7 * 86_400.0
_UNFINISHED = 3600.0
"""Age of a file that is still being written at which nobody writes it any more [s]; it takes seconds."""

_locks: dict[Path, int] = {}
_left = set[Path]()
_swept = set[Path]()
_process = os.getpid()


def own_folder(kind: str) -> Path:
    """A new temporary folder of this process's own; `remove` removes it."""
    parent = Path(tempfile.gettempdir())
    if parent not in _swept:
        _swept.add(parent)
        sweep(parent)
    for other in [path for path in [*_locks] if not path.exists()]:  # removed by other means
        _give_back(other)
    if fcntl is None:
        return Path(tempfile.mkdtemp(prefix=f"{_LOCKED}{kind}_"))
    new = None
    try:
        new = Path(tempfile.mkdtemp(prefix=f"{_NEW}{kind}_"))
        return _locked(new)
    except BaseException:  # also an interrupt
        for folder in [] if new is None else [new, _under_lock(new)]:
            remove_tree(folder)
        raise


def _locked(new: Path) -> Path:
    lock = os.open(new, os.O_RDONLY | os.O_CLOEXEC)
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:  # some network drives have no locks
        os.close(lock)
        return new
    folder = _under_lock(new)
    new.rename(folder)
    _locks[folder] = lock
    return folder


def _under_lock(new: Path) -> Path:
    return new.with_name(_LOCKED + new.name.removeprefix(_NEW))


@atexit.register
def remove_own() -> None:
    """Remove what an interrupt left; a copy of this process, which has the same list, removes nothing."""
    if os.getpid() == _process:
        for folder in {*_locks} - _left:
            with contextlib.suppress(OSError):
                remove(folder)


def in_a_copy() -> None:
    """Leave the folders to the process that this one is a copy of, and have own ones from now on."""
    global _process  # noqa: PLW0603 - a process has one number
    _process = os.getpid()
    _locks.clear()


def leave(folder: Path) -> None:
    """Have the end of this process leave a folder to who removes it even later."""
    _left.add(folder)


def remove(folder: Path) -> None:
    remove_tree(folder)
    _give_back(folder)


def _give_back(folder: Path) -> None:
    """Close a folder's lock, unless another thread has."""
    lock = _locks.pop(folder, None)
    if lock is not None:
        os.close(lock)


def sweep(parent: Path) -> list[Path]:
    """Remove the user's folders whose owners are gone; returns them.

    A folder that cannot be removed stays, and the others are removed all the same: no start fails for what an earlier
    one left behind."""
    names: list[str] = []
    with contextlib.suppress(OSError):
        names = os.listdir(parent)
    gone = []
    for name in names:
        folder = parent / name
        with contextlib.suppress(Exception):
            if name.startswith((_LOCKED, _NEW)) and _is_left_behind(folder):
                remove_tree(folder)
                gone.append(folder)
    return gone


def _is_left_behind(folder: Path) -> bool:
    try:
        seen = folder.lstat()
        age = time.time() - seen.st_mtime
        if fcntl is None:
            return age > _ABANDONED
        if seen.st_uid != os.getuid() or (folder.name.startswith(_NEW) and age < _YOUNG):
            return False
        opened = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC)
    except OSError:
        return False
    try:
        fcntl.flock(opened, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    finally:
        os.close(opened)
    return True


def sweep_partial_files(folder: Path) -> None:
    """Remove files that somebody began to write below a folder and that nobody finished within an hour."""
    for path in folder.rglob("*.part"):
        with contextlib.suppress(OSError):
            if time.time() - path.stat().st_mtime > _UNFINISHED:
                path.unlink()
