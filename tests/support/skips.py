"""In CI a skipped test fails the session, unless it is on a list: a test that no longer runs guards nothing."""

import os
from fnmatch import fnmatchcase
from pathlib import Path

import pytest

LIST = Path(__file__).parents[1] / "allowed_skips.txt"
"""A line is ``FILE::TEST | REASON``, the reason with * for anything; what follows # is a remark."""


def in_ci() -> bool:
    """As the environment says: CI is set, and not to 0 or false."""
    return os.environ.get("CI", "").lower() not in ("", "0", "false")


def read_list(path: Path) -> list[tuple[str, str]]:
    """Test and reason of every line."""
    entries = []
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), start=1):
        text = line.partition("#")[0].strip()
        if text:
            test, bar, reason = (part.strip() for part in text.partition("|"))
            if not (test and bar and reason):
                raise pytest.UsageError(
                    f"{path}:{number}: {text!r} is not of the form FILE::TEST | REASON"
                )
            entries.append((test, reason))
    return entries


class Skips:
    """Collects what was skipped, from all workers, and fails the session for what is not on the list."""

    def __init__(self, path: Path = LIST) -> None:
        self._allowed = read_list(path)
        self._path = path
        self.unexpected: list[str] = []

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        self._look_at(report)

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        self._look_at(report)

    def _look_at(self, report: pytest.TestReport | pytest.CollectReport) -> None:
        if not report.skipped or hasattr(report, "wasxfail"):
            return
        reason = report.longrepr[2] if isinstance(report.longrepr, tuple) else str(report.longrepr)
        reason = reason.removeprefix("Skipped: ")
        test = report.nodeid.partition("[")[0]
        if not any(
            fnmatchcase(test, name) and fnmatchcase(reason, why) for name, why in self._allowed
        ):
            self.unexpected.append(f"{report.nodeid} | {reason}")

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        if self.unexpected:
            terminalreporter.section("skipped, and not on the list")
            for line in self.unexpected:
                terminalreporter.write_line(line)
            terminalreporter.write_line(
                f"install what these tests need; if they cannot run in CI at all, add a line to {self._path.name}"
            )

    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        if self.unexpected and session.exitstatus in (
            pytest.ExitCode.OK,
            pytest.ExitCode.NO_TESTS_COLLECTED,
        ):
            session.exitstatus = pytest.ExitCode.TESTS_FAILED
