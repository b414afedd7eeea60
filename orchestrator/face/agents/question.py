"""One command of gfor, asked in a process of its own that ends within a time."""

import json
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from orchestrator.core.errors import InputError

LARGEST_ANSWER = 64 * 1024**2
"""Bytes of JSON that a command may print: beyond, a question was too wide for any agent."""


class NoAnswerError(InputError):
    """A command ended without an answer; the text is what it said."""


@dataclass(frozen=True)
class Allowance:
    """The folders and the time that questions may use.

    Attributes
    ----------
    roots
        Folders that may be read.
    results
        The folder that may be written; commands run there.
    seconds
        How long a question may take [s].
    """

    roots: tuple[Path, ...]
    results: Path
    seconds: float


def ask(words: Sequence[str], allowance: Allowance) -> Any:
    """Ask a command for its JSON.

    Parameters
    ----------
    words
        The command without ``gfor``, with its ``--json``.
    allowance
        Folders and time.

    Returns
    -------
    Any
        What the command printed, read.

    Raises
    ------
    NoAnswerError
        If the command refuses its input, fails, takes too long or prints too much.
    """
    allowance.results.mkdir(parents=True, exist_ok=True)
    task = {
        "roots": [str(root) for root in allowance.roots],
        "results": str(allowance.results),
        "words": list(words),
    }
    with tempfile.TemporaryDirectory(prefix="gfor-") as own:
        out, err = _run(task, allowance, Path(own))
    if len(out) > LARGEST_ANSWER:
        raise NoAnswerError(
            f"gfor {' '.join(words)}: the answer has {len(out)} bytes, more than {LARGEST_ANSWER}; ask for less"
        )
    try:
        return json.loads(out)
    except ValueError:
        said = err.decode(errors="replace").strip().removeprefix("error: ")
        raise NoAnswerError(said or f"gfor {' '.join(words)} printed no JSON") from None


def _run(task: dict[str, Any], allowance: Allowance, temporary: Path) -> tuple[bytes, bytes]:
    """Run a task in a process of its own; returns what it printed and what it said."""
    process = subprocess.Popen(
        [sys.executable, "-m", "orchestrator.face.cli.within", json.dumps(task)],
        cwd=allowance.results,
        env=os.environ | {"TMPDIR": str(temporary), "TEMP": str(temporary)},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        start_new_session=True,
    )
    try:
        return process.communicate(timeout=allowance.seconds)
    except subprocess.TimeoutExpired:
        raise NoAnswerError(
            f"gfor {' '.join(task['words'])}: no answer within {allowance.seconds:g} s; ask for less (one "
            "scenario, fewer points), or start gfor mcp with a larger --seconds"
        ) from None
    finally:
        _end(process)


def _end(process: "subprocess.Popen[bytes]") -> None:
    """End a command, and what it has left behind."""
    if process.poll() is None:
        process.kill()
    process.wait()
    if hasattr(os, "killpg"):
        with suppress(ProcessLookupError, PermissionError):  # nothing is left of it
            os.killpg(process.pid, signal.SIGKILL)
