"""A skip that is not on the list fails the session in CI, on one process and on several."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.skips import LIST, read_list

ROOT = Path(__file__).parents[1]
TESTS = """
import pytest

def test_a(): pass

@pytest.mark.skipif(True, reason="wine is not installed")
def test_b(): pass

@pytest.mark.parametrize("k", [1, 2])
def test_c(k):
    if k == 2:
        pytest.skip(f"number {k} cannot run")

@pytest.mark.xfail
def test_d(): assert False
"""
CONFTEST = """
from pathlib import Path
from tests.support.skips import Skips, in_ci

def pytest_configure(config):
    if in_ci() and not hasattr(config, "workerinput"):
        config.pluginmanager.register(Skips(Path(__file__).with_name("allowed.txt")))
"""
BOTH = "test_it.py::test_b | wine is*  # no wine\n\ntest_it.py::test_c | number * cannot run\n"


@pytest.fixture
def session(tmp_path):
    """Run some tests with a list; returns the exit code and what is printed."""

    def run(allowed, *arguments, ci="true", tests=TESTS):
        for name, text in (
            ("test_it.py", tests),
            ("conftest.py", CONFTEST),
            ("allowed.txt", allowed),
        ):
            (tmp_path / name).write_text(text, encoding="utf-8")
        (tmp_path / "pytest.ini").write_text("[pytest]\n", encoding="utf-8")
        environment = os.environ | {
            "CI": ci,
            "PYTHONPATH": str(ROOT),
            "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1",
        }
        for name in ("PYTEST_ADDOPTS", "PYTEST_XDIST_WORKER"):
            environment.pop(name, None)
        done = subprocess.run(
            [sys.executable, "-m", "pytest", *arguments],
            cwd=tmp_path,
            env=environment,
            capture_output=True,
            text=True,
            check=False,
        )
        return done.returncode, done.stdout + done.stderr

    return run


@pytest.mark.parametrize("workers", ["0", "2"])
def test_a_skip_that_is_not_on_the_list_fails_the_session(session, workers):
    code, text = session(BOTH, "-p", "xdist", "-n", workers)
    assert code == 0, text
    code, text = session(BOTH.partition("\n")[0], "-p", "xdist", "-n", workers)
    assert code == 1
    assert "test_it.py::test_c[2] | number 2 cannot run" in text
    assert "test_it.py::test_b |" not in text


def test_the_reason_counts_and_so_does_a_whole_file(session):
    assert session(BOTH.replace("wine is*", "valgrind is*"))[0] == 1
    code, text = session(BOTH, tests="import pytest\npytest.importorskip('no_such_module')\n")
    assert code == 1
    assert "could not import 'no_such_module'" in text


def test_outside_ci_nothing_is_asked(session):
    assert session("", ci="")[0] == 0
    assert session("", ci="false")[0] == 0


def test_what_the_list_names_exists():
    for test, _ in read_list(LIST):
        file, _, name = test.partition("::")
        text = (ROOT / file).read_text(encoding="utf-8")
        assert name == "*" or f"def {name.removesuffix('*')}(" in text, test


def test_a_line_that_is_none_is_said(tmp_path):
    path = tmp_path / "allowed.txt"
    path.write_text("tests/test_x.py::test_y\n", encoding="utf-8")
    with pytest.raises(
        pytest.UsageError, match=r"allowed\.txt:1: .* is not of the form FILE::TEST \| REASON"
    ):
        read_list(path)
