"""What takes long to make and is only read is made once, not by each worker of pytest-xdist."""

import fcntl
import hashlib
import os
import pickle
from collections.abc import Callable
from functools import cache, wraps
from pathlib import Path
from tempfile import mkdtemp
from typing import ParamSpec, TypeVar

import pytest

Given = ParamSpec("Given")
Result = TypeVar("Result")

_of_session: list[Path] = []


def share_in(factory: pytest.TempPathFactory) -> None:
    """Let the workers of a session share its folder."""
    base = factory.getbasetemp()
    _of_session[:] = [base.parent if "PYTEST_XDIST_WORKER" in os.environ else base]


@cache
def shared_folder() -> Path:
    """The folder of all workers of this session; a new one where no session runs."""
    return Path(_of_session[0] if _of_session else mkdtemp())


def made_once(name: str, make: Callable[[Path], None]) -> Path:
    """The folder that ``make`` filled, in this worker or in another, for which this one waited."""
    folder = shared_folder() / name
    with folder.with_suffix(".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not folder.exists():
            part = folder.with_suffix(".part")
            part.mkdir(exist_ok=True)
            make(part)
            part.rename(folder)
    return folder


def computed_once(compute: Callable[Given, Result]) -> Callable[Given, Result]:
    """The function, which one worker computes for each set of arguments, and the others read.

    Arguments have a ``repr`` that says all of them, and the result can be pickled.
    """

    @cache
    @wraps(compute)
    def found(*given: Given.args, **named: Given.kwargs) -> Result:
        asked = f"{compute.__module__}.{compute.__qualname__} {given} {sorted(named.items())}"

        def make(folder: Path) -> None:
            (folder / "result").write_bytes(pickle.dumps(compute(*given, **named)))

        kept = made_once(hashlib.sha256(asked.encode()).hexdigest(), make)
        return pickle.loads((kept / "result").read_bytes())

    return found
