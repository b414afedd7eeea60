"""Several threads against one: the same numbers to the last bit, whoever did what, also where something fails."""

import ctypes
import ctypes.util
import hashlib
import os
import signal
import subprocess
import sys
import threading
import time
from functools import cache

import numpy as np
import pytest

from fmus.toolchain.exporter import cached
from fmus.toolchain.native_fmu import NativeFmu
from orchestrator.core.errors import ComponentError, NotFiniteError
from orchestrator.devices.fmi.description import read_description
from orchestrator.devices.fmi.loaded_component import LoadedComponent
from orchestrator.systems.coupling import compiled_loop
from orchestrator.systems.coupling.events import ParameterChange
from orchestrator.systems.coupling.master import Master
from orchestrator.systems.coupling.recorder import Recorder
from orchestrator.systems.coupling.schedule import gauss_seidel, jacobi
from orchestrator.systems.coupling.sharing import Trial, best_number, shares
from orchestrator.systems.coupling.system import System
from tests.devices.acceptance.gallery.build import Source, Variable, build
from tests.support.scenarios import prepare_one
from tests.systems.coupling.small_fmus import MODELS, small_fmu

H = 1e-3
NAMES = tuple("abcdefgh")

pytestmark = pytest.mark.skipif(
    compiled_loop.loop_library() is None, reason="no compiler for this platform"
)


@cache
def native(name):
    return read_description(cached(NativeFmu(MODELS[name]())))


@pytest.fixture(scope="session")
def busy(tmp_path_factory):
    """An FMU of others that says which thread stepped it."""
    variables = (
        Variable("u", 0, "input", 0, "1"),
        *(Variable(n, k, "output") for k, n in enumerate(("thread", "sum"), 1)),
    )
    source = Source("busy", "../../../systems/coupling/busy.c", {}, variables)
    return read_description(build(source, tmp_path_factory.mktemp("busy")))


@pytest.fixture
def trusted(monkeypatch):
    """FMUs of others count as ours: any thread may step them."""
    monkeypatch.setattr(LoadedComponent, "one_thread", None)


def neighbours(model="lag", first=None):
    """Eight FMUs, each fed by the one before it."""
    system = System()
    for k, name in enumerate(NAMES):
        system.add(
            name,
            (first or {}).get(name, native(model)),
            {"x_0": 1.0 + 0.1 * k} if model != "blow_up" else {},
        )
    for one, other in zip(NAMES, (*NAMES[1:], NAMES[0]), strict=True):
        system.connect(f"{one}.y", f"{other}.u")
    return system


def both(make, threads, **run):
    """What two masters have recorded, one thread and several, with tracks and states at the end."""
    found = []
    for number in (1, threads):
        recorder = Recorder(run["names"], 7)
        with Master(*make, threads=number) as master:
            statistics = master.run(run["stop"], run.get("events", ()), [recorder])
            states = [c.serialize_state(c.save_state()) for c in master.components.values()]
            all_of_it = (
                recorder.values.tobytes(),
                master.y.tobytes(),
                master.tracks.saved().tobytes(),
                *states,
            )
            found.append([hashlib.sha256(part).hexdigest() for part in all_of_it])
            assert np.isfinite(recorder.values).all()
    assert statistics.threads == threads
    return found


# -- the same numbers ------------------------------------------------------------------------------


@pytest.mark.parametrize("threads", [2, 3, 9])
@pytest.mark.parametrize(
    "schedule", [jacobi(NAMES), gauss_seidel((NAMES[:5], NAMES[5:]))], ids=lambda s: s.name
)
def test_neighbours_within_a_group_see_nothing_new(schedule, threads):
    """Ten of them for a core each, where threads lose theirs at any moment."""
    one, several = both(
        (neighbours("integrator"), schedule, H),
        threads,
        names=[f"{n}.y" for n in NAMES],
        stop=2.0,
        events=[ParameterChange(0.505, "c", "gain", -2.0)],
    )
    assert one == several


@pytest.mark.parametrize("case", ["two_area", pytest.param("ieee118", marks=pytest.mark.slow)])
def test_a_case_with_its_event(case):
    ready = prepare_one(case, "pod_pq", {"*.native": True})
    (grid, changes), *_ = ready.events[0].changes().items()
    events = [ParameterChange(0.1, grid, name, value) for name, value in changes.items()]
    names = [n for n in ready.record if n.endswith((".omega", ".v"))][:20]
    one, several = both(
        (ready.system, ready.schedule, ready.step_size), 2, names=names, stop=0.3, events=events
    )
    assert one == several


def test_a_state_that_is_restored_goes_on_alike():
    ends = []
    for threads in (1, 3):
        with Master(neighbours(), jacobi(NAMES), H, threads=threads) as master:
            master.advance(500)
            states, y = {n: c.save_state() for n, c in master.components.items()}, master.y.copy()
            master.advance(300)
            ends.append(master.y.tobytes())
            for name, state in states.items():
                master.components[name].restore_state(state)
                master.components[name].free_state(state)
            master.y[:], master.index = y, 500
            master.advance(300)
            ends.append(master.y.tobytes())
    assert len(set(ends)) == 1


def test_threads_round_as_the_caller_does(busy, trusted):
    """A library that changes rounding, or drops the smallest numbers, does so on its caller's thread alone."""
    library = ctypes.CDLL(ctypes.util.find_library("m"))
    upward = {"x86_64": 0x800, "AMD64": 0x800, "aarch64": 0x400000, "arm64": 0x400000}[
        os.uname().machine
    ]
    ends, blocks = {}, 0
    for threads, mode in ((3, upward), (1, upward), (1, 0)):
        with busy_master(busy, threads) as master:
            master.advance(100)
            library.fesetround(mode)
            try:
                if threads > 1:
                    blocks = until_shared(master)
                else:
                    master.advance(10 * blocks)
            finally:
                library.fesetround(0)
            ends[mode, threads] = sums(master)
    assert ends[upward, 3] == ends[upward, 1] != ends[0, 1]


# -- who steps what --------------------------------------------------------------------------------


def busy_master(description, threads, names=NAMES[:6], **more):
    system = System()
    for name in names:
        system.add(name, description, inputs={"u": 1.0}, isolated=False)
    for name, other in more.items():
        system.add(name, other, inputs={"u": 1.0})
    return Master(system, jacobi((*names, *more)), H, threads=threads)


def threads_of(master):
    return {c.get(["thread"])["thread"] for n, c in master.components.items() if n in NAMES[:6]}


def until_shared(master):
    """Step until two threads were seen to step; ten steps each time, how often."""
    seen, blocks, end = set(), 0, time.monotonic() + 60
    while len(seen) < 2 and time.monotonic() < end:
        master.advance(10)
        blocks += 1
        seen |= threads_of(master)
    assert len(seen) > 1
    return blocks


def sums(master):
    return [c.get(["sum"])["sum"] for n, c in master.components.items() if n in NAMES[:6]]


def test_fmus_of_others_stay_on_one_thread(busy):
    """Their instances may share data, which two threads would spoil in silence."""
    with busy_master(
        busy, 3, x=native("integrator"), y=native("lag"), z=small_fmu("gain")
    ) as master:
        seen = set()
        for _ in range(10):
            master.advance(50)
            seen |= threads_of(master)
        statistics = master.run(0.6)
    assert len(seen) == 1
    assert statistics.threads == 3
    others = "an FMU of others, whose instances may share data"
    assert statistics.one_thread == {**dict.fromkeys(NAMES[:6], others), "z": "Python-backed"}


def test_several_threads_step_what_any_may(busy, trusted):
    with busy_master(busy, 1) as alone, busy_master(busy, 3) as master:
        master.advance(100)
        alone.advance(100 + 10 * until_shared(master))
        assert sums(master) == sums(alone)


def test_where_all_fmus_have_python_inside_no_thread_is_started():
    system = System()
    for name in "ab":
        system.add(name, small_fmu("integrator"), inputs={"u": 1.0})
    before = threading.active_count()
    with Master(system, jacobi(("a", "b")), H, threads=4) as master:
        statistics = master.run(0.5)
        assert threading.active_count() == before
    assert (statistics.threads, set(statistics.one_thread)) == (1, {"a", "b"})


def test_costly_calls_are_shared_out_first_and_those_of_the_caller_count():
    costs, bound = np.array([5.0, 1.0, 1.0, 3.0, 4.0, 2.0]), np.array([0, 0, 0, 0, 1, 0], bool)
    found = shares(range(6), bound, costs, 2)
    assert found.own == (4,)
    assert sorted(sum(found.of, ())) == [0, 1, 2, 3, 5]
    assert found.seconds == 8.0  # of 16 in all
    assert 4.0 + costs[list(found.of[0])].sum() == costs[list(found.of[1])].sum() == 8.0


@pytest.mark.parametrize(
    ("costs", "group", "best"),
    [
        ([1e-6] * 4, 3, 1),
        ([1e-3] * 8, 8, 8),
        ([1e-3, 1e-6, 1e-6], 3, 1),
        ([4e-6, 4e-6, 1e-3], 2, 2),
    ],
)
def test_as_many_threads_as_make_a_step_shortest(costs, group, best):
    groups = [range(group), range(group, len(costs))]
    assert best_number(groups, np.zeros(len(costs), bool), np.array(costs), 8) == best


def test_small_systems_keep_one_thread(monkeypatch):
    monkeypatch.setattr(compiled_loop, "number_of_cores", lambda: 8)
    system = System()
    for name in "ab":
        system.add(name, native("integrator"), inputs={"u": 1.0})
    before = threading.active_count()
    with Master(system, jacobi(("a", "b")), H, threads=None) as master:
        assert master.run(3.0).threads == 1
        assert threading.active_count() == before


@pytest.mark.parametrize(("together", "wins"), [(0.9, True), (1.1, False)])
def test_threads_that_are_slower_than_one_are_left_alone_and_tried_again(together, wins):
    trial, log = Trial(), []
    for _ in range(1000):
        steps = min(trial.most, 30)
        trial.took(steps, steps * (together if trial.together else 1.0))
        log += [trial.together] * steps
    assert np.mean(log[1000:5000]) == wins
    assert 0 < np.mean(log == np.True_ if wins else log) < 1 or wins
    assert sum(log) > 0 if wins else 0 < sum(log) < len(log) / 10


# -- failures --------------------------------------------------------------------------------------


def failing(threads, constants, model="blow_up", steps=3000):
    """Where a run of eight ends that are fed constants, its error, and all outputs then."""
    system = System()
    for name, value in zip(NAMES, constants, strict=True):
        system.add(name, native(model), inputs={"u": value})
        system.components[name].inputs["u"] = value
    system.add("sum", native("gain"), {"K": 1.0})
    system.connect("a.y", "sum.u")
    with Master(system, jacobi((*NAMES, "sum")), H, threads=threads) as master:
        with pytest.raises((ComponentError, NotFiniteError)) as caught:
            master.run(steps * H)
        return str(caught.value), master.index, master.y.tobytes(), master.tracks.saved().tobytes()


@pytest.mark.parametrize(
    "constants", [(1.0,) * 5 + (25.0,) + (1.0,) * 2, (9.0,) * 8, (1.0, 25.0, 1.0, 25.0) * 2]
)
def test_the_first_of_those_that_fail_in_one_step_is_named(constants):
    """Each says why on its thread, for which it needs Python's lock."""
    alone = failing(1, constants)
    assert "is no longer finite" in alone[0]
    for _ in range(5):
        assert failing(3, constants) == alone


def test_an_output_that_is_no_number_is_named_alike():
    system = System()
    for name in NAMES:
        system.add(name, native("root"))
        system.add(f"{name}2", native("integrator"), inputs={"u": 0.1})
        system.add(f"{name}3", native("gain"))
        system.connect(f"{name}2.y", f"{name}.u")
        system.connect(f"{name}.y", f"{name}3.u")
    order = gauss_seidel((*(tuple(f"{n}2" for n in NAMES), NAMES), tuple(f"{n}3" for n in NAMES)))
    ends = []
    for threads in (1, 3):
        with Master(system, order, H, threads=threads) as master:
            with pytest.raises(NotFiniteError) as caught:
                master.run(2.0)
            ends.append((str(caught.value), master.index, master.y.tobytes()))
    assert ends[0] == ends[1]
    assert ends[0][1] > 200


# -- their life ------------------------------------------------------------------------------------


def stepping_threads():
    return [t for t in threading.enumerate() if t.name.startswith("gfor step")]


def test_threads_end_with_the_master():
    with Master(neighbours(), jacobi(NAMES), H, threads=3) as master:
        assert not stepping_threads()
        master.advance(200)
        assert len(stepping_threads()) == 2
    assert not stepping_threads()


def test_fewer_threads_where_the_system_starts_no_more(monkeypatch, caplog):
    start, started = threading.Thread.start, []

    def limited(thread):
        if len(started) == 1:
            raise RuntimeError("can't start new thread")
        started.append(thread)
        start(thread)

    monkeypatch.setattr(threading.Thread, "start", limited)
    with Master(neighbours(), jacobi(NAMES), H, threads=4) as master:
        assert master.run(1.0).threads == 2
    assert "4 threads were wanted, and the system starts 2: can't start new thread" in caplog.text


_RUN = """
import os, signal, sys, threading
from orchestrator.systems.coupling.master import Master
from orchestrator.systems.coupling.schedule import jacobi
from tests.systems.coupling.test_threads import H, NAMES, neighbours

signal.signal(signal.SIGINT, signal.default_int_handler)
master = Master(neighbours(), jacobi(NAMES), H, threads=3)
master.advance(1000)
"""
_INTERRUPT = """
for delay in (0.02, 0.05, 0.11):
    try:
        threading.Timer(delay, os.kill, (os.getpid(), signal.SIGINT)).start()
        master.run(1e6)
    except KeyboardInterrupt:
        done = master.index
    master.advance(10)
    assert master.index == done + 10
    print("interrupted", flush=True)
with Master(neighbours(), jacobi(NAMES), H) as alone:
    alone.advance(master.index)
    print(alone.y.tobytes() == master.y.tobytes())
"""


@pytest.mark.skipif(sys.platform == "win32", reason="no process can send itself Ctrl-C there")
def test_ctrl_c_ends_a_run_at_a_whole_step_and_python_ends_with_threads_about():
    """The master is not closed either."""
    call = [sys.executable, "-c", _RUN + _INTERRUPT]
    result = subprocess.run(call, capture_output=True, text=True, check=False, timeout=120)
    assert (result.returncode, result.stderr) == (0, "")
    assert result.stdout.split() == ["interrupted"] * 3 + ["True"]


@pytest.mark.skipif(sys.platform == "win32", reason="there are no such signals there")
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL])
def test_a_process_that_is_ended_ends_with_its_threads(number):
    call = [sys.executable, "-c", _RUN + "print('on', flush=True)\nmaster.run(1e6)"]
    with subprocess.Popen(call, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline() == "on\n"
        process.send_signal(number)
        assert process.wait(20) == -number
