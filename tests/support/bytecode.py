"""What Python compiles of this project and its tests is compiled once and kept.

Images of containers often set ``PYTHONDONTWRITEBYTECODE``: each of the thousands of processes that the tests start
would compile the packages anew, and each worker all the tests.
"""

import os
import sys
from collections.abc import Callable
from contextlib import suppress
from importlib import import_module
from pathlib import Path

import pytest

REFUSAL = "PYTHONDONTWRITEBYTECODE"
"""Environment variable by which Python keeps nothing of what it compiles."""

TESTS = Path(__file__).parents[1]


def keep() -> None:
    """Let this process and those that it starts keep what they compile, in the usual ``__pycache__``."""
    os.environ.pop(REFUSAL, None)
    sys.dont_write_bytecode = False


def import_share(worker: int, workers: int, is_read: Callable[[Path], bool]) -> None:
    """Import every so manieth file of tests that pytest reads before it imports all of them.

    The workers of xdist import the same files in the same order, so in a fresh checkout each would compile each file.
    An error is left for pytest to meet and to report.
    """
    for path in sorted(filter(is_read, TESTS.rglob("test_*.py")))[worker::workers]:
        with suppress(Exception, pytest.skip.Exception):
            import_module(".".join(path.relative_to(TESTS.parent).with_suffix("").parts))
