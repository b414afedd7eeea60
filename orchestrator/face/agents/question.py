"""One command of gfor, asked in a process of its own that ends within a time."""

import json
import os
import re
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext, suppress
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fmus.toolchain.cache import cache_directory
from orchestrator.cases.case import without_installed_folder
from orchestrator.core.errors import InputError

MOST_WORDS = 20_000
"""Characters of a question; one with a hundred values has 5,000."""

MOST_SAID = 4_000
"""Characters of a refusal that an agent gets: a screen full of it."""

LARGEST_ANSWER = 64 * 1024**2
"""Bytes of JSON that a command may print: beyond, a question was too wide for any agent."""


_REFUSAL = re.compile(r"^(?:gfor [^\n:]*: )?error: ", re.MULTILINE)
"""The begin of a refusal, after the usage, remarks and questions that a command may have printed."""

_turns = threading.BoundedSemaphore(2)
"""Questions that are answered at once: each may use all cores, but a small one is not stuck behind a large one."""

_writing = threading.BoundedSemaphore(1)
"""Questions that write take turns: they write into one folder."""


_LOOK = 0.2
"""Longest between two looks at whether a question was cancelled [s]."""

cancelled: ContextVar[threading.Event | None] = ContextVar("cancelled", default=None)
"""Set by who asks, where it may cancel its question: the command then ends, and its turn is another's."""


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
        If the command refuses its input, fails, takes too long or prints too much; or if the question is too long, or
        another one is still being answered.
    """
    length = sum(map(len, words))
    if length > MOST_WORDS:
        raise NoAnswerError(f"the question has {length} characters; at most {MOST_WORDS} are taken")
    until = time.monotonic() + allowance.seconds
    with (
        _turn(_writing, until, allowance) if "--out" in words else nullcontext(),
        _turn(_turns, until, allowance),
    ):
        return _ask(words, allowance)


def _check_is_wanted() -> None:
    """Raise where the question was cancelled."""
    event = cancelled.get()
    if event is not None and event.is_set():
        raise NoAnswerError("it was cancelled")


@contextmanager
def _turn(one: threading.BoundedSemaphore, until: float, allowance: Allowance) -> Iterator[None]:
    """Wait for a turn until a time; it ends with the block."""
    while not one.acquire(timeout=min(_LOOK, max(0.0, until - time.monotonic()))):
        _check_is_wanted()
        if time.monotonic() < until:
            continue
        raise NoAnswerError(
            f"other questions are being answered, for more than {allowance.seconds:g} s now; ask one after the other"
        )
    try:
        yield
    finally:
        one.release()


def _ask(words: Sequence[str], allowance: Allowance) -> Any:
    task = {
        "roots": [str(root) for root in allowance.roots],
        "results": str(allowance.results),
        "words": list(words),
    }
    with tempfile.TemporaryDirectory(prefix="gfor-") as own:
        out, err, code = _run(task, allowance, Path(own))
    if code < 0:
        raise NoAnswerError(
            f"gfor {' '.join(words)} was ended by signal {-code}: the system may have had no memory left for it, or an "
            "FMU may have died in it"
        )
    if len(out) > LARGEST_ANSWER:
        raise NoAnswerError(
            f"gfor {' '.join(words)}: the answer has {len(out)} bytes, more than {LARGEST_ANSWER}; ask for less"
        )
    try:
        return json.loads(without_installed_folder(out.decode()))
    except ValueError:
        said = _refusal(err.decode(errors="replace").strip())
        raise NoAnswerError(said or f"gfor {' '.join(words)} printed no JSON") from None


def _refusal(said: str) -> str:
    """Return why a command refused, without what it had printed before; the middle of a long text is left out."""
    begin = _REFUSAL.search(said)
    text = without_installed_folder(said[begin.end() :] if begin else said)
    if len(text) <= MOST_SAID:
        return text
    half = MOST_SAID // 2
    return f"{text[:half]}\n… {len(text) - MOST_SAID} characters …\n{text[-half:]}"


def _run(task: dict[str, Any], allowance: Allowance, temporary: Path) -> tuple[bytes, bytes, int]:
    """Run a task in a process of its own; returns what it printed, what it said, and the code that it ended with."""
    own = {"TMPDIR": str(temporary), "TEMP": str(temporary)}
    own["MPLCONFIGDIR"] = str(cache_directory("pictures").absolute())  # its list of fonts, once
    process = subprocess.Popen(
        # -P: what lies in the folder of results is no module
        [sys.executable, "-P", "-m", "orchestrator.face.cli.within", json.dumps(task)],
        # the folder of results is there once something is written
        cwd=allowance.results if allowance.results.is_dir() else temporary,
        env=os.environ | own,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        start_new_session=True,
    )
    try:
        return *_answered(process, allowance.seconds), process.returncode
    except subprocess.TimeoutExpired:
        raise NoAnswerError(
            f"gfor {' '.join(task['words'])}: no answer within {allowance.seconds:g} s; {_remedy(task['words'])}"
            f"who starts the server gives more time by gfor mcp --seconds {2 * allowance.seconds:g}"
        ) from None
    finally:
        _end(process)


def _answered(process: "subprocess.Popen[bytes]", seconds: float) -> tuple[bytes, bytes]:
    """Wait for what a command prints, as long as somebody wants it and it may take."""
    until = time.monotonic() + seconds
    while True:
        left = until - time.monotonic()
        try:
            return process.communicate(timeout=min(_LOOK, max(0.0, left)))
        except subprocess.TimeoutExpired:
            if left <= _LOOK:
                raise
            _check_is_wanted()


def _remedy(words: Sequence[str]) -> str:
    """Return how a question that took too long can be asked for less; "" where it cannot."""
    if words[0] == "screen":
        return "the same question again goes on from what is done, and fewer outages or points take less; "
    if words[:2] == ["fmu", "check"] and "--only" not in words:
        return "`only` with one check's name takes less; "
    if words[0] in ("modes", "scr") and "--scenario" not in words:
        return "name one scenario: without it all are computed; "
    if words[0] == "run":
        return "a smaller `stop` takes less; "
    return ""


def _end(process: "subprocess.Popen[bytes]") -> None:
    """End a command, and what it has left behind."""
    if process.poll() is None:
        process.kill()
    process.wait()
    if hasattr(os, "killpg"):
        with suppress(ProcessLookupError, PermissionError):  # nothing is left of it
            os.killpg(process.pid, signal.SIGKILL)
