"""Foreign FMUs that do harm on purpose: nothing outside of their own folder notices.

Each is tried with every protection that this machine has, and again without namespaces, as in a container that forbids
them. `pytest tests/devices/sandbox/test_sandbox.py -s -k lists` prints what this machine lacks.
"""

import errno
import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from contextlib import ExitStack
from pathlib import Path

import pytest

from orchestrator.core.errors import ComponentError
from orchestrator.devices.acceptance.runner import check_fmu
from orchestrator.devices.fmi.component import RealBatch
from orchestrator.devices.fmi.description import read_description
from orchestrator.devices.fmi.isolated_component import IsolatedComponent
from orchestrator.devices.sandbox import (
    foreign_process,
    process_tree,
    protections_in_force,
    system_call_filter,
)
from orchestrator.devices.sandbox.access_restriction import LAYERS, Means, protections
from orchestrator.devices.sandbox.copied_process import template_processes
from orchestrator.devices.sandbox.process_tree import descendants, started_by_fmu
from orchestrator.devices.sandbox.protections_in_force import (
    ATTRIBUTES,
    NAMES,
    NETWORK,
    PROCESSES,
    READING,
    WRITING,
    missing,
)
from orchestrator.devices.sandbox.resource_limits import Limits
from tests.devices.acceptance.gallery.build import build
from tests.devices.sandbox.evil import evil

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the sandbox is Linux's")

WITHOUT_NAMESPACES = tuple(layer for layer in LAYERS if layer != "namespaces")


@pytest.fixture(params=[LAYERS, WITHOUT_NAMESPACES], ids=["all", "without namespaces"])
def layers(request, monkeypatch):
    monkeypatch.setattr(foreign_process, "LAYERS", request.param)
    return request.param


@pytest.fixture(scope="module")
def fmu(tmp_path_factory):
    folder = tmp_path_factory.mktemp("evil")
    return lambda act, **defines: read_description(build(evil(act, **defines), folder))


@pytest.fixture
def act():
    """Have an FMU act, in its first step: what it did, the last reason why it could not, and the component."""
    with ExitStack() as stack:

        def step(description, limits=None, needs=()):
            component = stack.enter_context(IsolatedComponent("evil", description, limits=limits))
            lacking = {p.name: p.how for p in component.protections if not p.in_force}
            for name in needs:
                if name in lacking:
                    pytest.skip(f"this machine lacks: {name} ({lacking[name]})")
            initialised(component)
            outputs = RealBatch(component, ["done", "refused"])
            component.step(0.0, 1e-2)
            done, refused = outputs.read()
            return int(done), int(refused), component

        yield step


def supervisor(component):
    return component._process._process.pid


def is_there(process):
    try:
        return (
            Path(f"/proc/{process}/stat").read_text(encoding="ascii").rpartition(")")[2].split()[0]
            != "Z"
        )
    except OSError:
        return False


def all_end(processes, seconds=60.0):
    end = time.monotonic() + seconds
    while any(map(is_there, processes)) and time.monotonic() < end:
        time.sleep(0.02)
    return not any(map(is_there, processes))


# -- what is in force ----------------------------------------------------------------------------------


def test_the_machine_lists_what_protects_it_and_what_it_lacks(act, fmu, capsys):
    *_, component = act(fmu("OWN_FILES"))
    assert tuple(protection.name for protection in component.protections) == NAMES
    assert all(protection.how for protection in component.protections)
    with capsys.disabled():
        for text in missing(component.protections):
            print(f"\nthis machine lacks: {text}", end="")


def test_what_is_left_out_is_named(act, fmu, monkeypatch):
    monkeypatch.setattr(foreign_process, "LAYERS", ())
    *_, component = act(fmu("THREADS", value=1))
    assert {PROCESSES, NETWORK, WRITING, ATTRIBUTES, READING} == {
        protection.name for protection in component.protections if not protection.in_force
    }


def test_what_an_honest_fmu_does_it_may(layers, act, fmu):
    done, refused, component = act(fmu("OWN_FILES"))
    everything = 10
    if component.protections[0].how == "a process namespace":
        assert (done, refused) == (everything, 0)
    else:  # neither modes nor times of its own files, nor shared memory by name
        assert done >= everything - 5
    assert act(fmu("THREADS", value=16))[:2] == (16, 0)


# -- outside of its folder ------------------------------------------------------------------------------


def test_it_changes_nothing_of_a_file_outside(layers, act, fmu, tmp_path):
    outside = tmp_path / "outside"
    outside.write_text("mine")
    outside.chmod(0o640)
    before = outside.stat()
    done, refused, _ = act(fmu("ATTRIBUTES", value=f'"{outside}"'), needs=[WRITING, ATTRIBUTES])
    assert done == 0
    assert refused
    after = outside.stat()
    assert outside.read_text() == "mine"
    assert [
        getattr(before, name) for name in ("st_mode", "st_uid", "st_gid", "st_mtime_ns", "st_nlink")
    ] == [
        getattr(after, name) for name in ("st_mode", "st_uid", "st_gid", "st_mtime_ns", "st_nlink")
    ]


def test_it_reads_neither_the_users_files_nor_the_environment(
    layers, act, fmu, tmp_path, monkeypatch
):
    key = tmp_path / ".ssh" / "id_ed25519"
    key.parent.mkdir()
    key.write_text("PRIVATE KEY")
    monkeypatch.setenv("A_PASSWORD", "secret")
    description = fmu("READ", value=f'"{key}"', FOLDER=f'"{key.parent}"', PROCESS=os.getpid())
    done, _, _ = act(description, needs=[READING])
    assert done == 0


def test_an_environment_variable_is_passed_on_where_the_user_names_it(
    act, fmu, tmp_path, monkeypatch
):
    monkeypatch.setenv("A_PASSWORD", "secret")
    monkeypatch.setenv("GFOR_COSIM_FMU_ENVIRONMENT", "OTHER, A_PASSWORD")
    description = fmu("READ", value=f'"{tmp_path / "x"}"', FOLDER=f'"{tmp_path / "y"}"', PROCESS=1)
    assert act(description)[0] == 1


def test_no_signal_handler_of_another_thread_writes_outside(layers, act, fmu, tmp_path):
    outside = tmp_path / "escaped"
    done, _, _ = act(fmu("HANDLER", value=f'"{outside}"'), needs=[WRITING])
    assert done >= 1  # at least its own thread heard
    assert not outside.exists()


def test_its_bars_cannot_be_bent(layers, act, fmu):
    assert act(fmu("UNLOCK"), needs=[NETWORK])[:2] == (0, errno.EPERM)


# -- network -------------------------------------------------------------------------------------------


def test_nothing_is_sent_over_the_network(layers, act, fmu):
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(0.2)
        done, _, _ = act(fmu("TCP", value=server.getsockname()[1]), needs=[NETWORK])
        assert done == 0
        with pytest.raises(TimeoutError):
            server.accept()


def test_no_unix_socket_outside_is_reached(layers, act, fmu, tmp_path):
    name = str(tmp_path / "s")
    with ExitStack() as stack:
        for address in (name, "\0" + name[1:]):
            server = stack.enter_context(socket.socket(socket.AF_UNIX, socket.SOCK_STREAM))
            server.bind(address)
            server.listen()
        done, _, _ = act(fmu("UNIX", value=f'"{name}"'), needs=[NETWORK])
    assert done == 0


# -- processes -----------------------------------------------------------------------------------------


def test_a_signal_reaches_neither_gfor_nor_a_process_of_the_user(layers, act, fmu):
    done, _, _ = act(fmu("KILL", value=os.getpid()), needs=[PROCESSES])
    assert done == 0  # and this test goes on


def test_limits_and_priority_of_others_stay(layers, act, fmu):
    """In another process than this one, which would keep what it was given."""
    with subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE) as other:
        before = Path(f"/proc/{other.pid}/limits").read_text()
        done, _, _ = act(fmu("LIMIT", value=other.pid), needs=[NETWORK])
        assert done == 0
        assert Path(f"/proc/{other.pid}/limits").read_text() == before
        assert os.getpriority(os.PRIO_PROCESS, other.pid) == os.getpriority(os.PRIO_PROCESS, 0)
        other.stdin.close()


@pytest.mark.parametrize("alone", [("seccomp",), ("landlock",)])
def test_either_keeps_signals_inside_alone(alone, act, fmu, monkeypatch):
    monkeypatch.setattr(foreign_process, "LAYERS", alone)
    assert act(fmu("KILL", value=os.getpid()), needs=[PROCESSES])[:2] == (0, errno.EPERM)
    with pytest.raises(ComponentError, match="SIGABRT"):  # its own reach it
        act(fmu("ABORT"))


def test_the_filter_of_calls_protects_attributes_alone(act, fmu, tmp_path, monkeypatch):
    monkeypatch.setattr(foreign_process, "LAYERS", ("seccomp",))
    outside, kept = tmp_path / "outside", tmp_path / "kept"
    outside.write_text("mine")
    kept.hardlink_to(outside)
    before = kept.stat()
    done, _, _ = act(fmu("ATTRIBUTES", value=f'"{outside}"'), needs=[ATTRIBUTES])
    assert done == 2  # it truncates and removes the file; Landlock is left out
    after = kept.stat()
    assert (before.st_mode, before.st_uid, before.st_gid) == (
        after.st_mode,
        after.st_uid,
        after.st_gid,
    )


def test_two_hundred_daemons_end_with_it(layers, act, fmu):
    try:
        done, _, component = act(fmu("DAEMONS"), Limits(tasks=60, seconds=10.0))
        others = descendants(supervisor(component))
        assert done > 0
    except ComponentError as error:
        assert "too many processes: more than 60 processes and threads" in str(error)  # noqa: PT017
        return
    component.close()
    assert others
    assert all_end(others)


def test_what_it_started_ends_with_it(layers, fmu):
    """It hangs after a daemon left its session: the call ends in an error, and both end."""
    with IsolatedComponent("evil", fmu("ONE_DAEMON"), limits=Limits(seconds=2.0)) as component:
        initialised(component)
        seen = []
        look = threading.Timer(1.0, lambda: seen.extend(descendants(supervisor(component))))
        look.start()
        with pytest.raises(ComponentError, match="hang: no answer within 2 s"):
            component.step(0.0, 1e-2)
        look.join()
        assert len(seen) >= 3  # keeper, worker, daemon
        assert all_end(seen)


def test_what_it_starts_runs_only_while_nobody_else_wants_to(layers, act, fmu):
    done, _, component = act(fmu("LEFT_CHILD"))
    assert done == 1
    (child,) = started_by_fmu(supervisor(component))
    end = time.monotonic() + 60.0
    while os.sched_getscheduler(child) != os.SCHED_IDLE and time.monotonic() < end:
        time.sleep(0.02)
    assert os.sched_getscheduler(child) == os.SCHED_IDLE
    worker = descendants(supervisor(component))[1]
    assert os.sched_getscheduler(worker) == os.sched_getscheduler(0)  # gfor waits for it


def test_it_takes_nothing_that_is_counted_for_all(layers, act, fmu):
    """64,512 contexts of `io_setup` were all of a machine's; inotify told names in folders that it must not list."""
    assert act(fmu("OTHERS_RESOURCES"), needs=[NETWORK])[0] == 0


# -- how much ------------------------------------------------------------------------------------------


def test_memory_counts_for_all_its_processes_together(layers, act, fmu):
    with pytest.raises(
        ComponentError, match="memory: its processes used more than 400000000 bytes together"
    ):
        act(fmu("MEMORY", value=150_000_000), Limits(memory=400_000_000))


@pytest.mark.parametrize(
    "kept", [LAYERS, WITHOUT_NAMESPACES, ("namespaces",)], ids=["all", "two", "no filter"]
)
def test_memory_counts_where_a_process_hides_it(kept, act, fmu, monkeypatch):
    monkeypatch.setattr(foreign_process, "LAYERS", kept)
    with pytest.raises(
        ComponentError, match="memory: its processes used more than 400000000 bytes together"
    ):
        act(fmu("MEMORY", value=150_000_000, HIDDEN=1), Limits(memory=400_000_000))


def test_memory_counts_for_a_process_of_which_only_the_size_can_be_read(tmp_path, monkeypatch):
    """Its share is hidden, and its first thread has ended."""
    for task, pages in (("7", 0), ("8", 1000)):
        (tmp_path / "7" / "task" / task).mkdir(parents=True)
        (tmp_path / "7" / "task" / task / "statm").write_text(f"5000 {pages} 0 0 0 0 0")
    monkeypatch.setattr(process_tree, "_PROC", tmp_path)
    found = process_tree.usage([7], 1)
    assert (found.memory, found.tasks) == (1000 * os.sysconf("SC_PAGE_SIZE"), 2)


def test_memory_that_counts_for_no_process_is_refused(layers, act, fmu):
    assert act(fmu("OUTER_MEMORY"), needs=[NETWORK])[:2] == (0, errno.EPERM)


@pytest.mark.slow
def test_folders_in_folders_go_with_it(layers, act, fmu):
    try:
        *_, component = act(fmu("DEEP", value=3000))
    except ComponentError as error:
        assert "disk" in str(error)  # noqa: PT017
        return
    component.close()
    assert not component._process.folder.exists()


@pytest.mark.parametrize("defines", [{}, {"REMOVED": 1}], ids=["kept", "removed and open"])
def test_files_count_together(defines, layers, act, fmu):
    try:
        done, refused, component = act(fmu("FILES", value=2, **defines), Limits(disk=100 * 1024**2))
    except ComponentError as error:
        assert "disk: its files came to more than 104857600 bytes" in str(error)  # noqa: PT017
    else:
        assert (done, refused) == (6, errno.ENOSPC)
        assert component.protections


@pytest.mark.slow
def test_more_files_than_are_counted_are_too_many(layers, act, fmu):
    try:
        _, refused, _ = act(fmu("MANY", value=21_000))
    except ComponentError as error:
        assert "or 20000 files and folders" in str(error)  # noqa: PT017
    else:
        assert refused == errno.ENOSPC


def test_memory_shared_by_name_is_little(layers, act, fmu):
    done, refused, _ = act(fmu("SHARED_FILES"), needs=[WRITING])
    assert done <= 1
    assert refused


def test_files_that_this_process_removed_are_not_anothers(tmp_path):
    with (tmp_path / "file").open("wb", buffering=0) as file:
        file.write(bytes(100_000))
        (tmp_path / "file").unlink()
        with subprocess.Popen(["sleep", "60"], pass_fds=[file.fileno()]) as other:
            found = process_tree.size_of_removed([other.pid], 1 << 30)
            other.kill()
        assert found == 0


# -- the memory between the processes ---------------------------------------------------------------------


def initialised(component):
    component.setup(0.0, None)
    component.enter_initialization_mode()
    component.exit_initialization_mode()
    return component


@pytest.mark.parametrize("byte", [0x00, 0x01, 0x5B, 0x7F, 0xFF])
def test_rubbish_in_the_whole_mailbox_is_one_error_at_most(byte, fmu):
    with IsolatedComponent(
        "evil", fmu("SCRIBBLE", value=byte), limits=Limits(seconds=1.0)
    ) as component:
        initialised(component)
        try:
            for k in range(5):
                component.step(0.01 * k, 0.01)
                assert component.values(["gain"]) == {"gain": 1.0}
        except ComponentError as error:
            words = ("tampering", "hang", "crash", "exit", "fmi2")
            assert any(word in str(error) for word in words)  # noqa: PT017


ANSWERS = {
    "brackets": ("[", 0x5B, 1 << 24, "nested too deep"),
    "braces": ('{"a":', 0x7B, 1 << 24, ""),
    "no text": ("", 0xFF, 1 << 24, "decode"),
    "too long": ('{"result": {"gain": 1}}', 0x20, 1 << 40, "out of bounds"),
    "negative": ('{"result": {"gain": 1}}', 0x20, -1, "out of bounds"),
    "a list": ("[1, 2, 3]", 0x20, 100, "in place of an answer"),
    "another kind": ('{"verdict": "pass"}', 0x20, 100, "in place of an answer"),
    "another name": ('{"result": {"other": 1}}', 0x20, 100, "in place of values of gain"),
    "a text for a number": (
        '{"result": {"gain": "1"}}',
        0x20,
        100,
        "in place of a table of numbers",
    ),
    "a huge number": (
        '{"result": {"gain": 1' + "0" * 400 + "}}",
        0x20,
        1000,
        "in place of a table of numbers",
    ),
    "digits": ('{"result": {"gain": 1', 0x31, 1 << 24, "digits|between"),
    "an error of another form": (
        '{"component_error": 3}',
        0x20,
        100,
        "in place of a list of texts",
    ),
}


@pytest.mark.parametrize("kind", ANSWERS)
def test_a_forged_answer_is_one_clear_error(kind, fmu):
    text, byte, length, words = ANSWERS[kind]
    quoted = '"' + text.replace('"', '\\"') + '"'
    description = fmu("ANSWER", value=quoted, BYTE=byte, LENGTH=f"{length}LL")
    with IsolatedComponent("evil", description, limits=Limits(seconds=2.0)) as component:
        initialised(component)
        component.step(0.0, 0.01)
        with pytest.raises(ComponentError, match=f"tampering.*{words}") as caught:
            component.values(["gain"])
        assert len(str(caught.value)) < 500


@pytest.mark.parametrize("seed", range(4))
def test_forged_answers_reach_nothing(seed, fmu):
    """Numbers, lengths and statuses change at any moment: gfor goes on or says so, within the time of a call."""
    with IsolatedComponent(
        "evil", fmu("FORGE", value=seed), limits=Limits(seconds=1.0)
    ) as component:
        initialised(component)
        batch = RealBatch(component, ["done", "refused", "gain"])

        def step(k):
            component.step(0.01 * k, 0.01)
            batch.read()
            if k % 100 == 0:
                assert set(component.values(["done", "gain"])) == {"done", "gain"}

        with pytest.raises(ComponentError, match=r"tampering|hang|crash|exit|fmi2|not a number"):
            [step(k) for k in range(200_000)]


def test_the_memory_cannot_be_shrunk_under_gfor(layers, act, fmu):
    _, _, component = act(fmu("TRUNCATE"))
    assert component.values(["gain"]) == {"gain": 1.0}
    component.step(0.01, 0.01)


# -- gfor is killed --------------------------------------------------------------------------------------

_GFOR = """
import sys
from orchestrator.devices.sandbox import copied_process, foreign_process
from orchestrator.devices.fmi.description import read_description
from orchestrator.devices.fmi.instance import open_component

foreign_process.LAYERS = tuple(sys.argv[2].split())
component = open_component("evil", read_description(sys.argv[1]), isolated=True)
component.setup(0.0, None)
component.enter_initialization_mode()
component.exit_initialization_mode()
(template,) = copied_process.template_processes()
print(template, component._process._process.pid, component._process.folder, flush=True)
component.step(0.0, 0.01)
"""


def test_nothing_outlives_gfor_that_is_killed_while_an_fmu_hangs(layers, fmu):
    call = [sys.executable, "-c", _GFOR, str(fmu("ONE_DAEMON").path), " ".join(layers)]
    with subprocess.Popen(call, stdout=subprocess.PIPE, text=True) as gfor:
        template, process, folder = gfor.stdout.readline().split()
        end = time.monotonic() + 60.0
        while len(descendants(int(process))) < 3 and time.monotonic() < end:
            time.sleep(0.02)
        started = [int(process), *descendants(int(process))]
        assert len(started) >= 4  # supervisor, keeper, worker, daemon
        started.append(int(template))
        gfor.send_signal(signal.SIGKILL)
    assert all_end(started)
    assert not Path(folder).exists()


# -- gfor fmu check ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("action", "value", "fault"),
    [
        ("KILL", "gfor", None),
        ("ONE_DAEMON", 1, "hang"),
        ("ANSWER", '"[1, 2]"', "tampering"),
        ("TRUNCATE", 1, None),
        ("LEFT_CHILD", 1, "process left behind"),
    ],
)
def test_gfor_check_says_what_happened_and_goes_on(action, value, fault, layers, fmu):
    description = fmu(action, value=os.getpid() if value == "gfor" else value, BYTE=0x20, LENGTH=6)
    before = set(descendants(os.getpid()))
    report = check_fmu(description.path, limits=Limits(seconds=2.0), only=("runs",), run_for=0.2)
    assert report.faults == ([fault] if fault else [])
    assert tuple(protection.name for protection in report.protections) == NAMES
    assert set(descendants(os.getpid())) - set(template_processes()) <= before


@pytest.mark.parametrize(
    ("header", "column"), [("x86_64-linux-gnu/asm/unistd_64.h", 0), ("asm-generic/unistd.h", 1)]
)
def test_the_numbers_of_refused_calls_are_the_kernels(header, column):
    """As its headers have them, which come with the compiler; newer calls may be missing there."""
    text = (Path("/usr/include") / header).read_text(encoding="utf-8")
    lines = re.findall(r"#define __NR(?:3264)?_(\w+) (\d+)", text)
    kernel = {name: int(number) for name, number in lines}
    ours = {
        name: numbers[column]
        for group in system_call_filter._CALLS.values()
        for name, numbers in group.items()
    }
    names = ("_KILL", "_TGKILL", "_SOCKETPAIR", "_CLONE", "_CLONE3", "_PRCTL")
    ours |= {name[1:].lower(): getattr(system_call_filter, name)[column] for name in names}
    ours["seccomp"] = list(system_call_filter._SECCOMP.values())[column]
    known = ours.keys() & kernel.keys()
    assert {name: ours[name] for name in known} == {name: kernel[name] for name in known}
    assert len(known) > 70
    assert {"memfd_create", "ptrace", "clone3"} <= known


@pytest.mark.parametrize("supervised", [True, False])
def test_what_only_a_supervisor_limits_is_said_not_to_be_without_one(supervised):
    found = {
        p.name: p.in_force
        for p in protections(Means(namespaces="refused", supervised=supervised), ())
    }
    assert found[protections_in_force.TASKS] is (supervised and sys.platform == "linux")
