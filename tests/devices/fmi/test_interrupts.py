"""Ctrl-C, sent for real and while FMUs with Python inside are being called: a process of its own may die of it."""

import os
import signal
import subprocess
import sys
import threading
import time
from dataclasses import replace

import pytest

from orchestrator.core.interrupts import calls
from tests.devices.acceptance.gallery.build import build
from tests.devices.acceptance.gallery.members import LAG, small

pytestmark = pytest.mark.skipif(
    sys.platform == "win32", reason="no process can send itself Ctrl-C there"
)

_RUNS = """
import os, signal, threading
from orchestrator.cases.case import load_case
from orchestrator.systems.coupling import compiled_loop
from orchestrator.systems.coupling.master import Master

{patch}
(ready,) = load_case("two_area").prepare(["pod_pq"])
for delay in (0.02, 0.05, 0.09, 0.2):
    with Master(ready.system, ready.schedule, ready.step_size) as master:
        signal.signal(signal.SIGINT, signal.default_int_handler)  # as a notebook does between two cells
        try:
            threading.Timer(delay, os.kill, (os.getpid(), signal.SIGINT)).start()
            master.run(1000.0)
        except KeyboardInterrupt:
            done = master.index
        master.advance(10)  # the FMUs are as well as before
        assert master.index == done + 10
        print("interrupted", flush=True)
"""


@pytest.mark.parametrize(
    "patch", ["", "compiled_loop.loop_library = lambda: None"], ids=["compiled loop", "python loop"]
)
def test_a_run_can_be_interrupted_at_any_time(patch):
    result = subprocess.run(
        [sys.executable, "-c", _RUNS.format(patch=patch)],
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert (result.returncode, result.stderr) == (0, "")
    assert result.stdout.split() == ["interrupted"] * 4


_WAITS = """
import signal, sys, time
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background jobs are started without it
from orchestrator.devices.fmi.description import read_description
from orchestrator.devices.fmi.instance import open_component

component = open_component("vendor", read_description(sys.argv[1]), isolated=True)
component.setup(0.0, None)
component.enter_initialization_mode()
component.exit_initialization_mode()
print("stepping", flush=True)
start = time.perf_counter()
try:
    for k in range(100):
        component.step(0.01 * k, 0.01)
except KeyboardInterrupt:
    print("interrupted" if time.perf_counter() - start < 10 else "late")
component.close()
"""


def test_a_foreign_fmu_that_hangs_does_not_hold_it_up(tmp_path):
    """By itself it would be given 30 s."""
    source = small("hangs", "LAG", LAG, step_size="1e-2", stop_time="2")
    fmu = build(replace(source, defines={**source.defines, "FAULT_HANG_AT": 0.055}), tmp_path)
    call = [sys.executable, "-c", _WAITS, str(fmu)]
    with subprocess.Popen(
        call, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout.readline() == "stepping\n"
        # the process holds Python's lock by now: no thread of its own could send this
        time.sleep(0.5)
        process.send_signal(signal.SIGINT)
        output, error = process.communicate(timeout=60)
    assert (process.returncode, output, error) == (0, "interrupted\n", "")


# -- the rule ----------------------------------------------------------------------------------------


@pytest.fixture
def taken():
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    calls.watch()
    yield
    signal.signal(signal.SIGINT, before)


def ctrl_c():
    signal.raise_signal(signal.SIGINT)


def test_it_waits_for_the_end_of_the_outermost_call(taken):
    reached = []

    def outer():
        with calls:
            with calls:
                ctrl_c()
                reached.append("inner")
            reached.append("outer")

    with pytest.raises(KeyboardInterrupt):
        outer()
    assert reached == ["inner", "outer"]
    with calls:
        pass  # and is then forgotten


def test_between_calls_it_is_as_ever(taken):
    with pytest.raises(KeyboardInterrupt):
        ctrl_c()


def test_a_second_one_does_not_wait(taken):
    reached = []

    def call():
        with calls:
            ctrl_c()
            reached.append("first")
            ctrl_c()
            reached.append("second")

    with pytest.raises(KeyboardInterrupt):
        call()
    assert reached == ["first"]
    with calls:
        pass


def test_other_threads_do_not_hold_it_up(taken):
    inside, go_on = threading.Event(), threading.Event()

    def call():
        with calls:
            inside.set()
            go_on.wait()

    thread = threading.Thread(target=call)
    thread.start()
    inside.wait()
    with pytest.raises(KeyboardInterrupt):
        ctrl_c()
    go_on.set()
    thread.join()


def test_the_handler_of_others_stays(taken):
    heard = []
    signal.signal(signal.SIGINT, lambda *_: heard.append(os.getpid()))
    calls.watch()
    with calls:
        ctrl_c()
    assert heard == [os.getpid()]


# -- SIGTERM -----------------------------------------------------------------------------------------


def test_sigterm_does_what_ctrl_c_does():
    reached = []

    def command():
        with calls:
            signal.raise_signal(signal.SIGTERM)
            reached.append("end of the call")

    before = signal.getsignal(signal.SIGTERM)
    with calls.terminable():
        with pytest.raises(KeyboardInterrupt):
            command()
        assert calls.terminated
    assert reached == ["end of the call"]
    assert signal.getsignal(signal.SIGTERM) == before


_TWICE = """
import signal
from orchestrator.core.interrupts import calls

with calls.terminable(), calls:
    signal.raise_signal(signal.SIGTERM)
    print("still here", flush=True)
    signal.raise_signal(signal.SIGTERM)
    print("and here", flush=True)
"""


def test_a_second_sigterm_ends_the_process_at_once():
    result = subprocess.run(
        [sys.executable, "-c", _TWICE], capture_output=True, text=True, check=False, timeout=60
    )
    assert (result.returncode, result.stdout) == (-signal.SIGTERM, "still here\n")


_DEAF = """
import signal
signal.signal(signal.SIGINT, signal.SIG_IGN)
from orchestrator.core.interrupts import calls

with calls.terminable():
    signal.raise_signal(signal.SIGINT)
    print("still here", flush=True)
    try:
        signal.raise_signal(signal.SIGTERM)
    except KeyboardInterrupt:
        print(calls.how)
"""


def test_a_process_of_a_scripts_background_hears_sigterm_alone():
    """As every program does that a shell has started deaf to Ctrl-C."""
    result = subprocess.run(
        [sys.executable, "-c", _DEAF], capture_output=True, text=True, check=True, timeout=60
    )
    assert result.stdout == "still here\nended by SIGTERM\n"


def test_the_suite_hears_ctrl_c_however_it_was_started():
    assert signal.getsignal(signal.SIGINT) is not signal.SIG_IGN


def test_the_command_line_ends_with_the_code_of_sigterm(gfor, monkeypatch):
    from orchestrator.face.cli import info  # noqa: PLC0415

    monkeypatch.setattr(info, "run", lambda options: signal.raise_signal(signal.SIGTERM))
    assert gfor("fmu", "info", "a.fmu") == (143, "", "ended by SIGTERM\n")


@pytest.fixture(params=["a command", "a run in Python"])
def taken_over(request, taken):
    if request.param == "a command":
        with calls.terminable():
            yield
    else:
        calls.watch()
        yield


def test_an_interrupt_that_python_swallows_comes_again_at_the_next_line(taken_over):
    class Ending:
        def __del__(self):
            signal.raise_signal(signal.SIGINT)

    def command():
        Ending()  # Python lets no error out of its end
        reached.append("after it")
        with calls:
            reached.append("in a call")

    reached = []
    with pytest.raises(KeyboardInterrupt):
        command()
    assert reached == []
