"""A process that answers questions, from the side of the server: one at a time, the last of each asker goes first."""

import json
import subprocess
import tempfile
import threading
import time
from collections.abc import Callable, Mapping
from itertools import count
from pathlib import Path
from typing import Any

from fmus.toolchain.temporary import sweep
from orchestrator.core.errors import ErrorKind
from orchestrator.face.explore.copies import UNKNOWN, Copy, Process, begun

Answer = dict[str, Any]

Asker = tuple[str, str]  # a page, and the kind of its question
LONGEST = 3600.0  # a computation that takes longer is ended [s]
_RESTART = 3.0  # to start the process anew takes about so long [s]
_TO_LEAVE = 1.0  # until a process that was asked to end is killed [s]


class Computing:
    """A worker process, begun when it is first needed, and again after it died or was ended."""

    def __init__(
        self,
        case: str,
        *,
        trust_fmus: bool = False,
        longest: float = LONGEST,
        recorded: Mapping[str, str] | None = None,
    ) -> None:
        self._given = {"case": case, "trust_fmus": trust_fmus, "recorded": recorded}
        self._longest = longest
        self._state = threading.Condition()
        self._numbers = count(1)
        self._newest: dict[Asker, int] = {}
        self._cancelled: dict[str, float] = {}  # of each page, the number of its last cancel
        self._at_work: tuple[Asker, float] | None = None  # and when it began
        self._took: dict[str, float] = {}
        self._process: Process | None = None
        self._why = ""
        self._closed = False
        self._ending: list[threading.Thread] = []  # each sees to the end of a process

    def ask(self, page: str, question: Mapping[str, Any], say: Callable[[Answer], None]) -> Answer:
        """The answer; ``superseded`` where the page asked the same anew meanwhile, ``cancelled`` where it was ended."""
        asker, number = (page, str(question.get("ask"))), question.get("number", float("inf"))
        with self._state:
            if number < self._cancelled.get(page, 0):  # it was overtaken on its way
                return {"cancelled": True}
            ticket = self._newest[asker] = next(self._numbers)
            self._end_what_is_outdated(asker)
            self._state.notify_all()
            while self._at_work is not None and self._newest.get(asker) == ticket:
                self._state.wait()
            if self._newest.get(asker) != ticket:
                return self._overtaken(page, number)
            begin = time.monotonic()
            self._at_work = (asker, begin)
            self._why = ""
        try:
            found = self._answered(question, say)
        finally:
            with self._state:
                self._took[asker[1]] = time.monotonic() - begin
                self._at_work = None
                newest = self._newest.get(asker) == ticket
                if newest:
                    del self._newest[asker]
                self._state.notify_all()
        return found if newest else self._overtaken(page, number)

    def _overtaken(self, page: str, number: float) -> Answer:
        return {"cancelled" if number < self._cancelled.get(page, 0) else "superseded": True}

    def _end_what_is_outdated(self, asker: Asker) -> None:
        """End a computation that its own asker no longer wants, where that is sooner than to wait for its end."""
        if self._at_work is None or self._at_work[0] != asker:
            return
        _, begin = self._at_work
        if self._took.get(asker[1], 0.0) - (time.monotonic() - begin) > _RESTART:
            self._end("superseded")

    def cancel(self, page: str, number: float) -> None:
        with self._state:
            self._cancelled[page] = number
            for asker in [one for one in self._newest if one[0] == page]:
                del self._newest[asker]
            if self._at_work is not None and self._at_work[0][0] == page:
                self._end("cancelled")
            self._state.notify_all()

    def welcome(self, page: str) -> None:
        """A page that was left may be there again, by another stream of events."""
        with self._state:
            self._cancelled.pop(page, None)

    def close(self) -> None:
        with self._state:
            self._closed = True
            self._newest.clear()
            self._end("closed")
            self._state.notify_all()

    def wait_for_its_end(self) -> None:
        """Wait until the processes that were asked to end have, or were killed."""
        for thread in self._ending:
            thread.join()

    def _answered(self, question: Mapping[str, Any], say: Callable[[Answer], None]) -> Answer:
        try:
            process = self._running()
            assert process.stdin is not None
            assert process.stdout is not None
            watch = threading.Timer(self._longest, self._end, ("too long",))
            watch.start()
            try:
                process.stdin.write(json.dumps(question) + "\n")
                process.stdin.flush()
                for line in process.stdout:
                    content: Answer = json.loads(line)
                    if "answer" in content or "error" in content:
                        return content
                    say(content)
            finally:
                watch.cancel()
        except (OSError, ValueError) as error:
            return {"error": self._lost(f" ({error})"), "kind": ErrorKind.WORKER_LOST}
        if self._why in ("cancelled", "superseded", "closed"):
            return {self._why: True}
        return {"error": self._lost(""), "kind": ErrorKind.WORKER_LOST}

    def _lost(self, detail: str) -> str:
        """The process is gone; the next question begins another."""
        process, self._process = self._process, None
        if process is not None:
            process.kill()
        code = process.wait() if process is not None else 0
        how = f"signal {-code}" if code < 0 else f"exit code {code}"
        if isinstance(process, Copy) and code == UNKNOWN:
            how = "how is not known"
        if self._why == "too long":
            return f"the computation took more than {self._longest:g} s and was ended; ask again with fewer values"
        text = (
            "an FMU may have died in it; nothing else is lost, and the next question starts it anew"
        )
        return f"the process that computes ended by itself ({how}){detail}: {text}"

    def _running(self) -> Process:
        with self._state:
            if self._closed or self._why:  # it was ended before it began
                raise OSError("nobody waits for it")
            if self._process is not None and self._process.poll() is None:
                return self._process
            self._process = begun()
            assert self._process.stdin is not None
            self._process.stdin.write(json.dumps(self._given) + "\n")
            self._process.stdin.flush()
            return self._process

    def _end(self, why: str) -> None:
        self._why = why
        process, self._process = self._process, None
        if process is not None:
            is_there = not isinstance(process, Copy) or process.is_there
            if is_there:
                process.terminate()
            thread = threading.Thread(target=_killed, args=(process, is_there), daemon=True)
            thread.start()
            # nobody waits for one that is yet to be copied: it ends with the process it is made from
            self._ending = [one for one in self._ending if one.is_alive()] + [thread] * is_there


def _killed(process: Process, was_asked: bool) -> None:
    """See to it that a process that was asked to end does; one that is yet to begin is asked once it has."""
    if not was_asked:
        process.terminate()
    try:
        process.wait(_TO_LEAVE)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
        sweep(Path(tempfile.gettempdir()))  # its folders, which it could not remove
