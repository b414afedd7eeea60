"""A line now and then of a command that is at work, for whoever waits where no terminal shows a bar."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Event, Thread
from time import monotonic
from typing import TextIO

EVERY = 30.0  # from one line to the next [s]: a log of a night has some hundred
_MINUTE = 60.0  # [s]
_IN_SECONDS = 2 * _MINUTE  # times below this are told in seconds [s]
_IN_WHOLE_MINUTES = 10 * _MINUTE  # below this a line and the next would tell the same minute [s]

_SERVERS = ("explore", "mcp")
"""Commands that wait for questions, and end when they are told to."""

_telling: list[object] = []
"""Tellers of how far the command is, which tell more than that it is at work."""

_told: list[float] = []
"""Times at which the command under way began and told a line [s]; empty where none is under way."""

LOOK = 1.0  # least wait for a line: until then somebody who begins has something to tell [s]


def silence() -> float:
    """Return for how long the command has told no line [s]; 0 outside of commands."""
    return monotonic() - _told[-1] if _told else 0.0


def end_silence() -> None:
    """Note that a line is told now."""
    if _told:
        _told[:] = [monotonic()]


@contextmanager
def tell_instead(teller: object) -> Iterator[None]:
    """Inside, somebody else tells how far the command is."""
    _telling.append(teller)
    try:
        yield
    finally:
        _telling.remove(teller)


@contextmanager
def saying_that_it_is_at_work(command: str | None) -> Iterator[None]:
    """Inside, say every `EVERY` seconds that a command is at work, unless somebody tells more."""
    if command is None or command in _SERVERS:
        yield
        return
    _told[:] = [monotonic()]
    ended = Event()
    thread = Thread(target=_say_now_and_then, args=(command, ended), daemon=True)
    shown = _somebody_reads_lines()
    if shown:
        thread.start()
    try:
        yield
    finally:
        ended.set()
        if shown:
            thread.join()
        _told.clear()


def _somebody_reads_lines() -> bool:
    """Return whether lines on standard error are wanted: a terminal shows a bar; what is closed is None here."""
    streams: tuple[TextIO | None, TextIO | None] = sys.stdout, sys.stderr
    shown, told = streams
    return told is not None and (shown is None or not shown.isatty())


def _say_now_and_then(command: str, ended: Event) -> None:
    began = monotonic()
    while not ended.wait(max(LOOK, EVERY - silence())):
        if not _telling:
            end_silence()
            print(
                f"{command}: at work, {in_words(monotonic() - began)}", file=sys.stderr, flush=True
            )


def in_words(seconds: float) -> str:
    """``90 s``, ``4.5 min``, ``25 min``."""
    if seconds < _IN_SECONDS:
        return f"{seconds:.0f} s"
    digits = 1 if seconds < _IN_WHOLE_MINUTES else 0
    return f"{seconds / _MINUTE:.{digits}f} min"
