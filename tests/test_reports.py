"""What a worker of the tests reports of each: nothing that fails or is skipped is kept back."""

import os
import subprocess
import sys
from pathlib import Path
from textwrap import dedent

ROOT = Path(__file__).parents[1]

OPTIONS = ["-qs", "--tb=no", "-p", "no:cacheprovider"]

PLUGIN = dedent(
    """
    from tests.support.reports import FewReports

    def pytest_configure(config):
        config.pluginmanager.register(FewReports())

    def pytest_runtest_logreport(report):
        print("\\n@", report.nodeid.partition("::test_")[2], report.when, report.outcome)
    """
)

TESTS = dedent(
    """
    import pytest

    @pytest.fixture
    def broken():
        raise ValueError

    @pytest.fixture
    def broken_later():
        yield
        raise ValueError

    def test_good(): ...
    def test_bad(): raise ValueError
    def test_without_set_up(broken): ...
    def test_without_teardown(broken_later): ...
    def test_left_out(): pytest.skip("by itself")
    @pytest.mark.skip
    def test_marked(): ...
    @pytest.mark.xfail
    def test_known(): raise ValueError
    """
)


def test_a_set_up_or_teardown_is_told_only_if_it_does_not_pass(tmp_path):
    """In its own process: a pytest within this one would take the modules that it imports back, and leave anyio in two
    copies."""
    (tmp_path / "conftest.py").write_text(PLUGIN, encoding="utf-8")
    (tmp_path / "test_kinds.py").write_text(TESTS, encoding="utf-8")
    ran = subprocess.run(
        [sys.executable, "-m", "pytest", *OPTIONS, "--rootdir", tmp_path, tmp_path],
        cwd=ROOT,
        env={**os.environ, "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1", "PYTEST_ADDOPTS": ""},
        capture_output=True,
        check=False,
        text=True,
    )
    told = [line.split()[1:] for line in ran.stdout.splitlines() if line.startswith("@")]
    assert told == [
        ["good", "call", "passed"],
        ["bad", "call", "failed"],
        ["without_set_up", "setup", "failed"],
        ["without_teardown", "call", "passed"],
        ["without_teardown", "teardown", "failed"],
        ["left_out", "call", "skipped"],
        ["marked", "setup", "skipped"],
        ["known", "call", "skipped"],
    ]
