"""A worker of pytest-xdist reports of each test what somebody reads."""

from collections.abc import Iterator

import pytest
from _pytest.runner import runtestprotocol


def asks_for_seconds(config: pytest.Config) -> bool:
    """Whether a test's set-up and teardown are asked for though they pass: by their seconds, or by name."""
    option = config.option
    return option.durations is not None or bool(option.xmlpath) or option.verbose > 0


def told(reports: list[pytest.TestReport]) -> Iterator[pytest.TestReport]:
    """The report of the test itself, and those of a set-up or a teardown that did not pass."""
    return (report for report in reports if report.when == "call" or not report.passed)


class FewReports:
    """Sends one message of a test that passes, where pytest-xdist sends five.

    To pack, send and read those takes as long as pytest takes for a test that does nothing.
    """

    @pytest.hookimpl
    def pytest_runtest_protocol(self, item: pytest.Item, nextitem: pytest.Item | None) -> bool:
        for report in told(runtestprotocol(item, log=False, nextitem=nextitem)):
            item.ihook.pytest_runtest_logreport(report=report)
        return True
