"""A signal that comes while a library is at work: what libraries make of an exception does not happen."""

import signal
import subprocess
import sys
import threading
import time
from importlib import import_module

import pytest

from orchestrator.core import interrupts as deferral
from orchestrator.core.errors import ResultsError
from orchestrator.core.interrupts import calls
from orchestrator.face.cli import info

LIBRARY = """
import signal, time

def at_work(number):
    signal.raise_signal(number)
    for _ in range(3):
        pass
    return "done"

def turns(number):  # Matplotlib's converters of arguments
    try:
        return at_work(number)
    except BaseException:
        raise TypeError("incompatible function arguments") from None

def clears(number):  # PyErr_Clear
    try:
        return at_work(number)
    except BaseException:
        return "cleared"

class Ending:
    def __init__(self, number):
        self.number = number
    def __del__(self):
        signal.raise_signal(self.number)

def ends(number):  # Python lets no error out of its end
    Ending(number)
    return "done"

def calls_back(number, function):
    signal.raise_signal(number)
    function()
    return "done"

def hangs(number, how=turns):
    def at_work():
        signal.raise_signal(number)
        time.sleep(60)
    try:
        at_work()
    except BaseException:
        raise TypeError("incompatible function arguments") from None
"""

USER = """
def study(library, reached, *arguments):
    reached.append(library(*arguments))
    reached.append("the next line")

def wraps(library, error, *arguments):
    try:
        library(*arguments)
    except Exception as caught:
        raise error from caught
"""


@pytest.fixture
def library(tmp_path, monkeypatch):
    folder = tmp_path / "site-packages"
    folder.mkdir()
    (folder / "hasty_library.py").write_text(LIBRARY, encoding="utf-8")
    monkeypatch.syspath_prepend(folder)
    monkeypatch.delitem(sys.modules, "hasty_library", raising=False)
    yield import_module("hasty_library")
    sys.modules.pop("hasty_library", None)


@pytest.fixture
def ours():
    """Code that belongs to the packages."""
    names = {"__name__": "orchestrator.planted"}
    exec(compile(USER, "/orchestrator/planted.py", "exec"), names)
    return names


SIGNALS = pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])


@pytest.fixture(autouse=True)
def _python_takes_ctrl_c():
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@SIGNALS
@pytest.mark.parametrize("how", ["at_work", "turns", "clears", "ends"])
def test_it_is_raised_when_the_library_has_come_back(library, ours, number, how):
    reached, tracer = [], sys.gettrace()
    with calls.terminable(), pytest.raises(KeyboardInterrupt):
        ours["study"](getattr(library, how), reached, number)
    assert reached == ["done"]
    assert sys.gettrace() in (tracer, None)


@SIGNALS
def test_it_is_raised_in_our_function_that_a_library_calls(library, ours, number):
    reached = []
    with calls.terminable(), pytest.raises(KeyboardInterrupt):
        ours["study"](
            library.calls_back, reached, number, lambda: ours["study"](len, reached, "two")
        )
    assert reached == []


def test_it_is_raised_at_once_in_a_program_of_the_users(library):
    """There Ctrl-C does what it does in any program."""
    with calls.terminable():
        assert library.clears(signal.SIGINT) == "cleared"
        with pytest.raises(TypeError):
            library.turns(signal.SIGINT)


def test_it_does_not_wait_for_a_library_for_ever(library, ours, monkeypatch):
    monkeypatch.setattr(deferral, "_LONGEST", 0.2)
    begun = time.monotonic()
    with calls.terminable(), pytest.raises(TypeError):
        ours["study"](library.hangs, [], signal.SIGTERM)
    assert time.monotonic() - begun < 30


def test_a_wait_for_others_is_ended_at_once(ours):
    """As Python does: what is waited for may never come."""
    never = threading.Event()
    begun = time.monotonic()
    timer = threading.Timer(
        0.3, signal.pthread_kill, (threading.main_thread().ident, signal.SIGINT)
    )
    with calls.terminable():
        timer.start()
        with pytest.raises(KeyboardInterrupt):
            ours["study"](never.wait, [], 60)
    assert time.monotonic() - begun < 30


@SIGNALS
@pytest.mark.parametrize(
    "error", [TypeError("a converter"), ResultsError("a file"), OSError("a disk"), SystemError()]
)
def test_at_a_command_s_end_the_signal_wins_over_any_error(gfor, ours, monkeypatch, number, error):
    """Also over one that a library made of it."""

    def library(number):
        try:
            signal.raise_signal(number)
        except BaseException:
            raise TypeError("incompatible function arguments") from None

    monkeypatch.setattr(info, "run", lambda options: ours["wraps"](library, error, number))
    code, words = {signal.SIGINT: (130, "interrupted"), signal.SIGTERM: (143, "ended by SIGTERM")}[
        number
    ]
    assert gfor("fmu", "info", "a.fmu") == (code, "", f"{words}\n")


@SIGNALS
def test_at_a_command_s_end_a_signal_that_was_cleared_is_not_lost(gfor, monkeypatch, number):
    def cleared(options):
        try:
            signal.raise_signal(number)
        except BaseException:
            return 0

    monkeypatch.setattr(info, "run", cleared)
    assert gfor("fmu", "info", "a.fmu")[0] == (143 if number == signal.SIGTERM else 130)


def test_an_error_without_a_signal_stays_what_it_is(gfor, monkeypatch):
    def fails(options):
        raise ResultsError("a file")

    monkeypatch.setattr(info, "run", fails)
    code, _, error = gfor("fmu", "info", "a.fmu")
    assert (code, error) == (1, "error: a file\n")
    monkeypatch.setattr(info, "run", lambda options: len(1))
    with pytest.raises(TypeError):
        gfor("fmu", "info", "a.fmu")


_TWICE = """
import signal
from orchestrator.core.interrupts import calls

library, ours = {"__name__": "library", "signal": signal}, {"__name__": "orchestrator.planted"}
twice = "def twice():\\n for k in range(2):\\n  signal.raise_signal(signal.SIGTERM)\\n  print(k, flush=True)"
exec(compile(twice, "/site-packages/library.py", "exec"), library)
exec("def study(function):\\n function()\\n print('the next line')", ours)
with calls.terminable():
    ours["study"](library["twice"])
"""


def test_a_second_sigterm_ends_a_process_in_which_the_first_one_waits():
    result = subprocess.run(
        [sys.executable, "-c", _TWICE], capture_output=True, text=True, check=False
    )
    assert (result.returncode, result.stdout) == (-signal.SIGTERM, "0\n"), result.stderr


@pytest.mark.parametrize(
    ("waits", "event", "count"), [(True, "line", 1), (True, "call", 0), (False, "line", 0)]
)
def test_it_is_delivered_at_a_line_while_it_waits(waits, event, count, monkeypatch):
    delivered = []
    waiting = deferral.Deferral(lambda: delivered.append(1))
    if waits:
        frame = sys._getframe()
        monkeypatch.setattr(waiting, "_frame", frame)
        monkeypatch.setattr(waiting, "_before", sys.gettrace())
        frame.f_trace = None
    waiting._at_line(sys._getframe(), event, None)
    assert len(delivered) == count


@pytest.mark.parametrize(
    ("waits", "asked", "comes"), [(True, 3, True), (True, 2, False), (False, 3, False)]
)
def test_a_signal_comes_a_second_time_only_while_the_same_one_waits(
    waits, asked, comes, monkeypatch
):
    sent = []
    monkeypatch.setattr(deferral.time, "sleep", lambda seconds: None)
    monkeypatch.setattr(deferral.sys, "platform", "linux")
    monkeypatch.setattr(
        deferral.signal, "pthread_kill", lambda *what: sent.append(what), raising=False
    )
    one = deferral.Deferral(lambda: None)
    one._frame, one._number = (object() if waits else None), 3
    one._ask_again(asked)
    assert bool(sent) is one._repeats is comes
