"""Files that are whole or absent: written beside their place, flushed to the disk, and renamed into it."""

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from orchestrator.core.errors import InputError, ResultsError

inputs: set[Path] = set()  # real paths of the files that the command in force reads
# begins the names of files that are not finished, and stands in those of folders that are not
PARTIAL = ".part-"


def made_folder(
    given: str | Path, label: str = "", what: str = "results cannot be written there"
) -> Path:
    """A folder, made where it is missing, before anything is computed for it."""
    if not isinstance(given, str | Path) or not given:
        raise InputError(f"{label or 'folder'} = {given!r}; give the path of a folder")
    path = Path(given)
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        place = f"{label} {path}" if label else str(path)
        raise InputError(f"{place}: {what}: {error.strerror}; choose another folder") from error
    return path


def spare_input(path: Path) -> None:
    if inputs and path.resolve() in inputs:
        raise InputError(
            f"{path}: the command reads this file and would write over it; name another one to write"
        )


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A path to write to; the file there gets the name ``path`` at the end, or is removed if something fails."""
    spare_input(path)
    partial = path.with_name(f"{PARTIAL}{os.getpid()}-{path.name}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        yield partial
        flush(partial)
        partial.replace(path)
        flush(path.parent)
    except OSError as error:
        raise not_written(path, error) from error
    finally:
        with suppress(OSError):
            partial.unlink(missing_ok=True)


def write_bytes(path: Path, content: bytes) -> None:
    with replacing(path) as partial:
        partial.write_bytes(content)


def check_page(path: Path) -> None:
    if path.suffix.lower() not in (".html", ".htm"):
        raise InputError(f"{path}: a page in HTML is written there; give a name that ends in .html")


def write_page(path: Path, text: str) -> None:
    check_page(path)
    write_text(path, text)


def write_text(path: Path, text: str) -> None:
    """Write a text file at once, in UTF-8 and with the lines' ends as they are."""
    write_bytes(path, text.encode("utf-8"))


def flush(path: Path) -> None:
    """Have the system put a file or the entries of a folder on the disk; a system that cannot do it for folders may."""
    try:
        handle = os.open(path, os.O_RDONLY if path.is_dir() or os.name != "nt" else os.O_RDWR)
    except PermissionError:
        if path.is_dir():
            return  # Windows opens no folders
        raise
    try:
        os.fsync(handle)
    except OSError as error:
        if error.errno not in (errno.EINVAL, errno.ENOTSUP, errno.EBADF):
            raise
    finally:
        os.close(handle)


def not_written(path: Path, error: OSError) -> ResultsError:
    remedy = {
        errno.ENOSPC: "make room there, or choose another folder",
        errno.EDQUOT: "make room there, or choose another folder",
        errno.EFBIG: "raise the limit of a file's size (ulimit -f), or write less",
        errno.ENOENT: "the folder was removed meanwhile; leave it in place while the command runs",
    }.get(error.errno or 0, "choose a folder in which you may write")
    return ResultsError(f"{path}: it cannot be written: {error.strerror or error}; {remedy}")
