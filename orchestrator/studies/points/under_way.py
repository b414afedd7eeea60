"""How far what is under way is, for whoever waits: in words, as a part of what is counted next, and in parts done.

A task of many parts, such as a stretch of a screening, takes minutes, and its record comes at its end: each done part
adds a byte to one file, across processes. Appending a byte needs no lock that a worker which is ended could hold. On
other machines nobody counts, and nothing is told."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory


class _UnderWay:
    doing = "", 0.0
    tally: Path | None = None  # None where nobody counts


@contextmanager
def counting() -> Iterator[None]:
    """Inside, parts that this process and its workers do are counted; what was done before is not told any more."""
    with TemporaryDirectory() as folder:
        tell_doing()
        _UnderWay.tally = Path(folder) / "done"
        _UnderWay.tally.touch()
        try:
            yield
        finally:
            tell_doing()
            _UnderWay.tally = None


def tell_doing(text: str = "", part: float = 0.0) -> None:
    """Tell what this process is doing from now on, and the part of what is counted next that is done before it."""
    _UnderWay.doing = text, part


def doing() -> tuple[str, float]:
    """Return what was told last: a stage of a study in words, "" where nobody tells, and the part, 0 to 1."""
    return _UnderWay.doing


def tally() -> Path | None:
    """The file that a worker is to `join`."""
    return _UnderWay.tally


def join(file: Path | None) -> None:
    """Count in this process's part with others that have the same file."""
    _UnderWay.tally = file


def tell_part() -> None:
    """Tell that one more part is done; a count that cannot be kept is none, and ends nothing."""
    if _UnderWay.tally is None:
        return
    try:
        target = os.open(_UnderWay.tally, os.O_WRONLY | os.O_APPEND)
    except OSError:  # nobody counts any more
        return
    try:
        os.write(target, b".")
    finally:
        os.close(target)


def parts_done() -> int:
    """Number of parts that are done since `counting` began."""
    try:
        return 0 if _UnderWay.tally is None else _UnderWay.tally.stat().st_size
    except OSError:
        return 0
