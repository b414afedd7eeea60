"""One command at a time works in a folder of results: it holds a lock on a file there until it ends."""

import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from orchestrator.core.errors import InputError
from orchestrator.core.safe_files import made_folder

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

# the file's name; it holds the number of the process that has it, and its machine's name
LOCK = ".lock"


class FolderInUseError(InputError):
    """Another command works in a folder of results."""


@contextmanager
def hold_folder(folder: Path) -> Iterator[None]:
    """Hold a folder, which is made where it is missing; the lock ends with the process, whatever ends that.

    Windows, and network drives without locks, have no such lock: there nobody is refused.

    Raises
    ------
    FolderInUseError
        If another command holds it.
    InputError
        If its lock cannot be made.
    """
    made_folder(folder)
    if fcntl is None:
        yield
        return
    path = folder / LOCK
    lock = _locked(path)
    try:
        yield
    finally:
        with suppress(OSError):
            if _is_at(path, lock):
                path.unlink()
        os.close(lock)


def _locked(path: Path) -> int:
    """The open file, once its lock is held; the file of a command that ended in the meantime is gone, and made anew."""
    while True:
        try:
            lock = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW, 0o644)
        except OSError as error:
            raise InputError(
                f"{path}: this file cannot be made: {error.strerror}; results cannot be written there, so choose "
                "another folder"
            ) from error
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            holder = _holder(lock)
            os.close(lock)
            raise FolderInUseError(
                f"{path.parent}: {holder} works in this folder, and two commands would destroy each other's "
                "results; wait until it has ended, or choose another folder"
            ) from error
        except OSError:  # some network drives have no locks
            return lock
        if _is_at(path, lock):
            with suppress(OSError):  # a full disk: the lock is held without the number
                os.ftruncate(lock, 0)
                os.pwrite(lock, f"{os.getpid()} {socket.gethostname()}".encode(), 0)
            return lock
        os.close(lock)


def _holder(lock: int) -> str:
    number, _, machine = os.pread(lock, 300, 0).decode(errors="replace").partition(" ")
    where = f" on {machine}" if machine and machine != socket.gethostname() else ""
    return f"process {number}{where}" if number.isdigit() else "another command"


def _is_at(path: Path, lock: int) -> bool:
    try:
        return os.path.samestat(path.stat(), os.fstat(lock))
    except FileNotFoundError:
        return False
