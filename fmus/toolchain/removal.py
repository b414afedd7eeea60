"""Remove a folder whatever a foreign FMU left in it: as deep as it likes, with any names and without permissions."""

import contextlib
import os
import sys
from pathlib import Path
from shutil import rmtree

_FOLDER = getattr(os, "O_DIRECTORY", 0) | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_CLOEXEC", 0)


def remove_tree(folder: Path) -> None:
    """Remove a folder and all below it; what the system refuses to remove stays.

    No path is longer than one name, and nothing recurses: each folder below is moved to the top before it is emptied.
    A symbolic link is removed, and never followed."""
    if not (
        {os.open, os.rename, os.rmdir, os.unlink} <= os.supports_dir_fd
        and os.scandir in os.supports_fd
    ):
        with contextlib.suppress(OSError, RecursionError, ValueError):
            rmtree(folder, ignore_errors=True)
        return
    with contextlib.suppress(OSError):
        top = _opened(os.fspath(folder), None)
        try:
            pending = _emptied(top, top)
            while pending:
                _remove_one(pending.pop(), top, pending)
        finally:
            os.close(top)
        os.rmdir(folder)


def _remove_one(name: str, top: int, pending: list[str]) -> None:
    """Remove a folder in ``top``; the folders in it are moved to ``top`` and added to ``pending``."""
    with contextlib.suppress(OSError):
        directory = _opened(name, top)
        try:
            pending += _emptied(directory, top)
        finally:
            os.close(directory)
        os.rmdir(name, dir_fd=top)


def _emptied(directory: int, top: int) -> list[str]:
    """Remove the files of an open folder and move its folders to ``top``; returns the names they have there."""
    with os.scandir(directory) as scanned:
        entries = list(scanned)
    folders = []
    for entry in entries:
        with contextlib.suppress(OSError):
            if not entry.is_dir(follow_symlinks=False):
                os.unlink(entry.name, dir_fd=directory)
                continue
            name = entry.name
            if directory != top:
                name = os.urandom(12).hex()
                # a folder that may not be written to cannot be moved
                os.close(_opened(entry.name, directory))
                os.rename(entry.name, name, src_dir_fd=directory, dst_dir_fd=top)
            folders.append(name)
    return folders


def _opened(name: str, parent: int | None) -> int:
    """A descriptor of a folder, which is given its owner's permissions first where it lacks them."""
    try:
        descriptor = os.open(name, os.O_RDONLY | _FOLDER, dir_fd=parent)
        if os.fstat(descriptor).st_mode & 0o700 != 0o700:
            os.fchmod(descriptor, 0o700)
    except PermissionError:
        _permit(name, parent)
        return os.open(name, os.O_RDONLY | _FOLDER, dir_fd=parent)
    return descriptor


def _permit(name: str, parent: int | None) -> None:
    """Give the owner all permissions of a folder that cannot be opened; of no file behind a link."""
    if sys.platform != "linux":
        os.chmod(name, 0o700, dir_fd=parent, follow_symlinks=False)
        return
    place = os.open(name, os.O_PATH | _FOLDER, dir_fd=parent)
    try:
        os.chmod(f"/proc/self/fd/{place}", 0o700)
    finally:
        os.close(place)
