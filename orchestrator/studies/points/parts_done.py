"""How many parts of the tasks under way are done, told across processes: each done part adds a byte to one file.

A task of many parts, such as a stretch of a screening, takes minutes, and its record comes at its end. Appending a byte
needs no lock that a worker which is ended could hold. On other machines nobody counts, and nothing is told."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory


class _Tally:
    file: Path | None = None  # None where nobody counts


@contextmanager
def counting() -> Iterator[None]:
    """Inside, parts that this process and its workers do are counted."""
    with TemporaryDirectory() as folder:
        _Tally.file = Path(folder) / "done"
        _Tally.file.touch()
        try:
            yield
        finally:
            _Tally.file = None


def tally() -> Path | None:
    """The file that a worker is to `join`."""
    return _Tally.file


def join(file: Path | None) -> None:
    """Count in this process's part with others that have the same file."""
    _Tally.file = file


def tell_part() -> None:
    """Tell that one more part is done; a count that cannot be kept is none, and ends nothing."""
    if _Tally.file is None:
        return
    try:
        target = os.open(_Tally.file, os.O_WRONLY | os.O_APPEND)
    except OSError:  # nobody counts any more
        return
    try:
        os.write(target, b".")
    finally:
        os.close(target)


def parts_done() -> int:
    """Number of parts that are done since `counting` began."""
    try:
        return 0 if _Tally.file is None else _Tally.file.stat().st_size
    except OSError:
        return 0
