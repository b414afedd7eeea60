"""Which tests take long: a list, measured by `python -m tests.benchmarks.durations`, marks them as slow.

A newcomer's tests (``-m "not slow"``) so stay within minutes, without a mark at each of hundreds of tests. A test that
is not on the list, for example a new one, counts as quick.
"""

import os
import re
from collections import Counter
from collections.abc import Generator, Iterable
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]

LIST = ROOT / "tests" / "slow_tests.txt"
"""A line is ``SECONDS TEST``: seconds of processor, and what pytest calls the test."""

NIGHTLY = ROOT / "tests" / "nightly_tests.txt"
"""How the names begin of tests that `.ci/nightly` runs: other published systems, long searches, and the second and
third of rows that differ in a setting. The paper's tables are not among them.
"""

LONGEST = 0.3
"""Seconds of processor from which on a test stands on the list."""

LONGEST_THAT_CATCHES = 0.6
"""The same for a test that caught a mistake of `tests/benchmarks`: the quick tests must find as many as before."""

MEASURED = "GFOR_TEST_SECONDS"
"""Environment variable with the file to which `Measure` adds a line for each test."""


def read_list(path: Path = LIST) -> dict[str, float]:
    """Seconds by test."""
    lines = path.read_text(encoding="utf-8").splitlines() if path.exists() else []
    return {
        test: float(seconds) for seconds, _, test in (line.partition(" ") for line in lines if line)
    }


def mark(items: list[pytest.Item]) -> None:
    """Mark as slow what is on the list; the paper's tables are among the quick ones whatever they take."""
    listed, nightly = read_list(), tuple(NIGHTLY.read_text(encoding="utf-8").split("\n")[:-1])
    for item in items:
        if item.nodeid.startswith(nightly):
            item.add_marker("nightly")
            item.add_marker("slow")
        if item.nodeid in listed and not item.get_closest_marker("quick"):
            item.add_marker("slow")


_OF_SLOW_TESTS = ("slow", "nightly", "wheel")
"""Marks that no quick test has."""

_SLOW_IN_ITSELF = re.compile(rf"\bmark\.({'|'.join(_OF_SLOW_TESTS)})\b")


@cache
def _files() -> frozenset[str]:
    names = (*read_list(), *NIGHTLY.read_text(encoding="utf-8").split("\n")[:-1])
    return frozenset(_file_of(name) for name in names)


def may_hold_slow_tests(path: Path) -> bool:
    """Say whether a file of tests is named in a list, or marks a test in its own text."""
    return path.relative_to(ROOT).as_posix() in _files() or bool(
        _SLOW_IN_ITSELF.search(path.read_text(encoding="utf-8"))
    )


def may_be_chosen(path: Path, expression: str) -> bool:
    """Say whether a file of tests may have one that ``-m`` chooses.

    Where it chooses slow tests alone, as ``slow and not nightly`` does, half of the files need not be read, which is
    11 s of processor for each worker."""
    alone = re.fullmatch(rf"({'|'.join(_OF_SLOW_TESTS)})( and (not )?\w+)*", expression.strip())
    return not alone or may_hold_slow_tests(path)


def require_readable(items: Iterable[pytest.Item]) -> None:
    """Raise if a test is slow without a list or its own file to say so: `may_be_chosen` would leave it out."""
    slow = {item.path for item in items if any(map(item.get_closest_marker, _OF_SLOW_TESTS))}
    for path in slow:
        if not may_hold_slow_tests(path):
            raise pytest.UsageError(
                f"{path}: a test is slow by a mark from elsewhere; write pytest.mark.slow in this file"
            )


def longest_first(items: list[pytest.Item]) -> None:
    """Where all are slow, the longest file comes first: with ``--dist loadfile`` no worker ends alone with one."""
    seconds: Counter[str] = Counter()
    for test, of_test in read_list().items():
        seconds[_file_of(test)] += of_test
    if all(item.get_closest_marker("slow") for item in items):
        items.sort(key=lambda item: -seconds[_file_of(item.nodeid)])


def _file_of(test: str) -> str:
    return test.partition("::")[0]


elsewhere = Counter[object]()
"""Seconds of processor of commands of which another process waits for the end, by that process, until it has ended."""


class Measure:
    """Writes the seconds of processor of each test, with those of the processes that it waited for."""

    def __init__(self, path: Path) -> None:
        self._path = path

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Generator[None, object, object]:
        before = _processor()
        try:
            return (yield)
        finally:
            with self._path.open("a", encoding="utf-8") as file:
                file.write(f"{_processor() - before:.2f} {item.nodeid}\n")


def _processor() -> float:
    return sum(os.times()[:4]) + elsewhere.total()
