"""Which tests take long: a list, measured by `python -m tests.benchmarks.durations`, marks them as slow.

A newcomer's tests (``-m "not slow"``) so stay within minutes, without a mark at each of hundreds of tests. A test that
is not on the list, for example a new one, counts as quick.
"""

import os
from collections import Counter
from collections.abc import Generator
from pathlib import Path

import pytest

LIST = Path(__file__).parents[1] / "slow_tests.txt"
"""A line is ``SECONDS TEST``: seconds of processor, and what pytest calls the test."""

NIGHTLY = Path(__file__).parents[1] / "nightly_tests.txt"
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
