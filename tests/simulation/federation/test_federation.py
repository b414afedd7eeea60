"""Runs over HELICS: the local master's numbers, programs of others in a component's place, and every way to end."""

import ctypes
import os
import re
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from contextlib import nullcontext, suppress
from dataclasses import replace
from functools import cache
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from fmus.toolchain.temporary import remove, sweep
from orchestrator.core.errors import ComponentError, InputError, NotFiniteError, RunInterruptedError
from orchestrator.devices.fmi import unpacked
from orchestrator.simulation.federation import federation as processes
from orchestrator.simulation.federation import frames, helics_calls
from orchestrator.simulation.federation.choice import Federates
from orchestrator.simulation.federation.component import FederatedComponent
from orchestrator.simulation.federation.frames import JOIN, Door, Frames, call
from orchestrator.simulation.federation.hub import Hub, _FederationError
from orchestrator.simulation.federation.layout import claim_ports, make_layout
from orchestrator.studies.runs.run import run_scenario
from orchestrator.systems.coupling.master import Master
from orchestrator.systems.coupling.recorder import Recorder
from orchestrator.systems.coupling.schedule import jacobi
from tests.support.scenarios import prepare_one
from tests.systems.coupling.small_fmus import small_fmu

STAND_INS = Path(__file__).with_name("stand_ins.py")

LOOP = """\
name = "loop"
[solver]
step_size = "100 us"
stop_time = "{stop}"
record_interval = "200 us"
record = ["*"]
[components.x]
fmu = '{x}'
parameters = {{ x_0 = 1.0, gain = -50.0 }}
[components.load]
fmu = '{load}'
parameters = {{ K = 0.5, offset = 1.0 }}
[[connections]]
from = "x.y"
to = "load.u"
[[connections]]
from = "load.y"
to = "x.u"
"""


@pytest.fixture
def prepared(tmp_path):
    """A loop of an integrator and a gain; its stop time as an argument."""

    def prepare(stop="5 ms", more=""):
        path = tmp_path / "case.toml"
        text = LOOP.format(x=small_fmu("integrator").path, load=small_fmu("gain").path, stop=stop)
        path.write_text(text + more, encoding="utf-8")
        one = prepare_one(path)
        return one

    return prepare


@pytest.fixture
def temporary(tmp_path, monkeypatch):
    """Where temporary folders are made; in the end it holds what this process keeps of our FMUs, and nothing else."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    monkeypatch.setattr(unpacked, "_folders", {})
    yield folder
    for kept in unpacked._folders.values():
        assert kept.users == 0
        remove(kept.path)
    assert list(folder.iterdir()) == []


@pytest.fixture
def started(monkeypatch):
    """The processes of all federations, which must have ended in the end."""
    found = {}
    spawn = processes.Federation._spawn

    def noted(self, name, *arguments):
        spawn(self, name, *arguments)
        found[name] = self._processes[name]

    monkeypatch.setattr(processes.Federation, "_spawn", noted)
    yield found
    assert all(process.poll() is not None for process in found.values())


@pytest.fixture
def port():
    """A port for a broker, which no federation of another worker takes meanwhile."""
    number, held = claim_ports()
    with held:
        yield number


@pytest.fixture
def stand_in(tmp_path):
    """Start a federate of others at the port of a broker; where the test fails, pytest shows what it said."""
    found = []
    said = tmp_path / "stand_in.txt"

    def start(kind, port):
        words = [sys.executable, str(STAND_INS), kind, f"tcp://127.0.0.1:{port}"]
        with said.open("wb") as file:
            found.append(subprocess.Popen(words, stdout=file, stderr=file))
        return found[-1]

    yield start
    for process in found:
        print("the stand-in", "was running" if process.poll() is None else process.returncode)
        process.kill()
        process.wait()
        print(said.read_text(encoding="utf-8"))


def assert_same(one, other):
    """Equal to the last bit, and in what is recorded."""
    assert list(one.data_vars) == list(other.data_vars)
    assert one.sizes["time"] > 2
    for name in one.data_vars:
        np.testing.assert_array_equal(one[name].values, other[name].values, err_msg=name)


# -- the same numbers --------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def run_here():
    """A scenario that is ready, by its schedule, and its run by the local master; each run once.

    A value that comes late, or to the wrong input, shows in the first steps: 50 are enough, if all are recorded.
    """

    @cache
    def run(schedule):
        ready = replace(prepare_one("two_area", "pod_p", stop_time=0.005), record_every=1)
        if schedule == "jacobi":
            ready = replace(ready, schedule=jacobi(tuple(ready.system.components)))
        return ready, run_scenario(ready)

    return run


@pytest.mark.slow
@pytest.mark.parametrize(
    ("names", "schedule"),
    [(("gfor",), "gauss-seidel"), (("gfor", "sg1"), "jacobi"), (("sg2", "grid"), "gauss-seidel")],
)
def test_a_case_gives_the_local_master_s_numbers(names, schedule, run_here, temporary, started):
    ready, local = run_here(schedule)
    federated = run_scenario(ready, federates=Federates(names))
    assert federated.failure is None
    assert set(started) == {"the hub", *names}
    assert_same(local.dataset, federated.dataset)
    np.testing.assert_array_equal(
        [m.eigenvalue for m in local.modes.modes], [m.eigenvalue for m in federated.modes.modes]
    )


EVENT = """\
[[events]]
type = "parameter_change"
time = "2 ms"
component = "load"
parameter = "K"
value = 2.0
"""


def test_an_event_reaches_a_federate_at_once(prepared, temporary, started):
    ready = prepared(more=EVENT)
    assert ready.events
    local, federated = run_scenario(ready), run_scenario(ready, federates=Federates(("load",)))
    assert_same(local.dataset, federated.dataset)
    assert np.ptp(local.dataset["load.y"].values) > 1.0


def test_a_program_of_others_takes_a_component_s_place(
    prepared, port, stand_in, temporary, started
):
    ready = prepared()
    stand_in("gain", port)
    result = run_scenario(ready, federates=Federates(external=("load",), port=port))
    assert result.failure is None
    assert set(started) == {"the hub"}
    recorder = Recorder(ready.record, ready.record_every)
    # from the same start, as without modes
    with Master(ready.system, ready.schedule, ready.step_size) as master:
        master.run(ready.stop_time, observers=[recorder])
    for name, values in zip(recorder.names, recorder.values.T, strict=True):
        np.testing.assert_array_equal(result.dataset[name].values, values, err_msg=name)
    assert np.ptp(result.dataset["x.y"].values) > 0.1
    assert "foreign federate" in " ".join(result.modes.warnings)
    assert result.modes.modes == []


def test_times_of_groups_follow_one_another(prepared):
    layout = make_layout(prepared(), ("x", "load"), ())
    assert [(s.publish, s.compute, s.read) for s in layout.slots] == [
        (0, 25_000, 50_000),
        (50_000, 75_000, 100_000),
    ]
    assert [(p.name, p.slot, p.inputs, p.needed) for p in layout.parts] == [
        ("x", 0, ("u",), ("y",)),
        ("load", 1, ("u",), ("y",)),
    ]


@pytest.mark.parametrize(("step_size", "names"), [(1e-4 / 3, ("x",)), (2e-9, ("x", "load"))])
def test_a_step_that_helics_cannot_keep(step_size, names, prepared):
    with pytest.raises(InputError, match="HELICS counts time in whole nanoseconds"):
        make_layout(replace(prepared(), step_size=step_size), names, ())


# -- faults ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kind", "said"),
    [
        ("wrong_output", r"no global publication 'load\.y'.*it publishes 'load\.z', is that meant"),
        (
            "wrong_input",
            r"somebody subscribes to 'load\.uu', which nobody publishes; did you mean 'load\.u'",
        ),
    ],
)
def test_a_federate_with_other_names(kind, said, prepared, port, stand_in, temporary, started):
    stand_in(kind, port)
    with pytest.raises(InputError, match=said):
        run_scenario(prepared(), federates=Federates(external=("load",), port=port))


@pytest.mark.parametrize(
    ("kind", "error", "said"),
    [
        ("silent", ComponentError, r"component 'load' at t = 0\.001 s.*no value: of load\.y"),
        ("nan", NotFiniteError, r"component 'load'.*y is no finite number"),
        (
            "hangs",
            ComponentError,
            r"component 'load' at t = 0\.001 s.*did not ask for its next time within 2 s",
        ),
    ],
)
def test_a_federate_that_goes_wrong_keeps_what_was_recorded(
    kind, error, said, prepared, port, stand_in, temporary, started
):
    ready = prepared()
    stand_in(kind, port)
    choice = Federates(external=("load",), port=port, patience=2.0)
    result = run_scenario(ready, federates=choice)
    assert type(result.failure) is error
    assert re.search(said, str(result.failure))
    np.testing.assert_allclose(result.dataset["time"].values[-1], 1e-3, atol=2e-4)


def test_a_federate_that_is_killed(prepared, temporary, started):
    class Kills:
        every = 10

        def begin(self, run, stop_index):
            pass

        def observe(self, run):
            if run.index == 10:
                started["load"].kill()

        def end(self, run):
            pass

    result = run_scenario(prepared(), observers=[Kills()], federates=Federates(("load",)))
    assert re.search(
        r"component 'load' at t = 0\.00\d+ s: its federate returned crash.*SIGKILL",
        str(result.failure),
    )
    assert result.dataset.sizes["time"] >= 5


def test_ctrl_c_keeps_what_was_recorded(prepared, temporary, started):
    class Interrupts:
        every = 10

        def begin(self, run, stop_index):
            pass

        def observe(self, run):
            if run.index == 10:
                os.kill(os.getpid(), signal.SIGINT)

        def end(self, run):
            pass

    result = run_scenario(prepared(), observers=[Interrupts()], federates=Federates(("load",)))
    assert isinstance(result.failure, RunInterruptedError)
    assert result.dataset.sizes["time"] >= 5


@pytest.mark.parametrize("taken", [0, 1])
def test_a_port_in_use(taken, prepared, port):
    said = rf"--broker-port {port}: port {port + taken} is in use"
    with socket.create_server(("127.0.0.1", port + taken)), pytest.raises(InputError, match=said):
        run_scenario(prepared(), federates=Federates(("load",), port=port))


def test_federations_of_one_machine_take_no_port_of_each_other():
    """Nor one of those that the machine gives to whoever connects to somewhere: HELICS looks at no federate's port."""
    claimed = [claim_ports() for _ in range(20)]
    ports = sorted(number for number, _ in claimed)
    assert min(b - a for a, b in pairwise(ports)) >= 100
    assert ports[-1] + 100 < 32_768
    for _, held in claimed:
        held.close()


def test_a_block_of_ports_of_which_somebody_has_one_is_left_alone(monkeypatch):
    first, free = (claim_ports() for _ in range(2))
    for _, held in (first, free):
        held.close()
    monkeypatch.setattr("random.sample", lambda blocks, count: [first[0], free[0]])
    with socket.create_server(("127.0.0.1", first[0] + 6)):  # the second federate's
        port, held = claim_ports()
    held.close()
    assert port == free[0]


def test_no_broker(prepared, port):
    with pytest.raises(InputError, match=r"nothing answers there.*helics_broker -f N"):
        run_scenario(
            prepared(),
            federates=Federates(("load",), broker=f"tcp://127.0.0.1:{port}"),
        )


def test_nobody_joins(prepared, port, temporary, started):
    with pytest.raises(
        InputError, match=r"no federate named 'load' joined the federation at .* within 4 s"
    ):
        run_scenario(prepared(), federates=Federates(external=("load",), port=port, to_join=4.0))


def test_another_version(prepared, temporary, started, monkeypatch):
    monkeypatch.setattr(processes, "PROTOCOL", 99)
    with pytest.raises(
        InputError,
        match=r"component 'load': its federate is gfor-cosim .* with protocol 1 .* protocol 99",
    ):
        run_scenario(prepared(), federates=Federates(("load",)))


def test_an_event_in_a_foreign_federate(prepared, port, stand_in, temporary, started):
    stand_in("gain", port)
    with pytest.raises(
        InputError, match="'load' is a foreign federate, in which gfor can change nothing"
    ):
        run_scenario(prepared(more=EVENT), federates=Federates(external=("load",), port=port))


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--federate", "gfor"), "need --engine helics"),
        (
            ("--engine", "helics", "--federate", "sg9"),
            "has no component 'sg9'; components: gfor, sg1, sg2, grid",
        ),
        (
            ("--engine", "helics", "--federate", "gfor", "--external", "gfor"),
            "either started by gfor or external",
        ),
        (("--engine", "helics", "--broker", "tcp://"), "an address has the form tcp://host:port"),
        (
            ("--engine", "helics", "--checkpoint", "5"),
            "a run with federates keeps no checkpoints; leave out",
        ),
        (("--engine", "helics", "--federate", "sg9"), "if it is interrupted, it cannot be resumed"),
        (
            ("--engine", "helics", "--like", "fmpy_ssp"),
            "leave out either --like or --engine helics",
        ),
    ],
)
def test_a_choice_that_cannot_be(words, said, gfor, tmp_path):
    code, _, error = gfor(
        "run", "two_area", "--scenario", "gfor", "--stop", "0.01", "--out", tmp_path, *words
    )
    assert code == 2
    assert said in error


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
@pytest.mark.slow
@pytest.mark.parametrize("number", ["SIGTERM", "SIGKILL"])
def test_nothing_is_left_when_gfor_is_killed(number, prepared, tmp_path):
    case = prepared("100 s").case.path
    words = [
        sys.executable,
        "-m",
        "orchestrator.face.cli",
        "run",
        str(case),
        "--engine",
        "helics",
        "--federate",
        "load",
    ]
    environment = {**os.environ, "TMPDIR": str(tmp_path)}
    with (tmp_path / "said.txt").open("wb") as said:
        process = subprocess.Popen(
            [*words, "--out", str(tmp_path / "out")], stderr=said, env=environment
        )
    try:
        _until(lambda: "steps/s" in (tmp_path / "said.txt").read_text(encoding="utf-8"))
        children = _of_federation(process.pid)
        assert len(children) == 2
        process.send_signal(getattr(signal, number))
        process.wait()
        _until(lambda: not any(Path(f"/proc/{child}").exists() for child in children))
        sweep(tmp_path)  # as the next start does
        assert not [path for path in tmp_path.iterdir() if "federation" in path.name]
    finally:
        process.kill()
        process.wait()


def _of_federation(parent):
    """Processes of a federation that a process started."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            words = (folder / "cmdline").read_text(encoding="utf-8").split("\0")
            status = (folder / "stat").read_text(encoding="utf-8").rpartition(")")[2].split()
        except OSError:
            continue
        if int(status[1]) == parent and any(
            word.startswith("orchestrator.simulation.federation.") for word in words
        ):
            found.append(int(folder.name))
    return found


def _until(holds, seconds=60.0):
    deadline = time.monotonic() + seconds
    while not holds():
        assert time.monotonic() < deadline
        time.sleep(0.1)


def test_a_component_of_ours_that_was_started_by_hand(prepared, port, temporary, started):
    ready = prepared()
    words = [
        "master",
        "federate",
        str(ready.case.path),
        "--component",
        "load",
        "--broker",
        f"tcp://127.0.0.1:{port}",
    ]
    late = "import time, sys; time.sleep(3); from orchestrator.face.cli import main; sys.exit(main(sys.argv[1:]))"
    with subprocess.Popen([sys.executable, "-c", late, *words], stdout=subprocess.PIPE) as process:
        try:
            result = run_scenario(ready, federates=Federates(external=("load",), port=port))
            assert process.wait(60) == 0
        finally:
            process.kill()  # else a failure would wait for it for ever
        assert process.stdout is not None
        assert b"federate 'load' at tcp://127.0.0.1" in process.stdout.read()
    assert result.failure is None
    assert_same(run_scenario(ready).dataset, result.dataset)


def test_a_federate_without_a_broker(gfor, prepared, port):
    words = ("--component", "load", "--broker", f"tcp://127.0.0.1:{port}")
    code, _, error = gfor("master", "federate", prepared().case.path, *words)
    assert code == 2
    assert "nothing answers there" in error


@pytest.mark.slow
def test_the_program_of_the_guide(tmp_path, port, temporary, started):
    """A constant admittance in the place of the converter: its current follows the voltage that it is given."""
    page = (Path(__file__).parents[3] / ".docs" / "how-to" / "federation.md").read_text(
        encoding="utf-8"
    )
    program = tmp_path / "admittance.py"
    program.write_text(re.search(r"```python\n(.*?)```", page, re.DOTALL)[1], encoding="utf-8")
    ready = prepare_one("two_area", "gfor", stop_time=0.02)
    flow = ready.values
    current = (
        complex(flow["gfor.P_0"], -flow["gfor.Q_0"]) * flow["gfor.S_n"] / 100 / flow["gfor.v_0"]
    )
    with subprocess.Popen([sys.executable, str(program), f"tcp://127.0.0.1:{port}"]) as process:
        try:
            result = run_scenario(ready, federates=Federates(external=("gfor",), port=port))
            assert process.wait(30) == 0
        finally:
            process.kill()
    assert result.failure is None
    data = result.dataset
    found = data["gfor.i_re"].values + 1j * data["gfor.i_im"].values
    assert abs(found[0]) == pytest.approx(abs(current), rel=1e-9)
    np.testing.assert_allclose(np.abs(found), abs(current), rtol=0.02)
    assert "gfor.omega" not in data
    assert "sg1.omega" in data


@pytest.mark.parametrize(("granted", "ended"), [(0.25, False), (0.2, True)])
def test_the_hub_asks_for_its_time_in_seconds(monkeypatch, granted, ended):
    """Times are whole nanoseconds, and HELICS has seconds; one that grants another time has ended."""
    asked = []

    def request(federate, seconds):
        asked.append((federate, seconds, hub._waiting[1]))
        return granted

    monkeypatch.setattr(
        helics_calls, "library", lambda: SimpleNamespace(helicsFederateRequestTime=request)
    )
    hub = object.__new__(Hub)
    hub._request, hub._federate = {"patience": 5.0}, "gfor"
    hub._parts = [{"name": "grid", "slot": 0}, {"name": "load", "slot": 1}]
    with pytest.raises(_FederationError, match="ended") if ended else nullcontext():
        hub._request_time(250_000_000, 1)
    assert asked == [("gfor", pytest.approx(0.25), "load")]
    assert hub._waiting is None


def test_only_who_knows_the_word_comes_in():
    """Another program of this machine that calls first is sent away, and the hub's call after it is taken."""
    with Door() as door:
        stranger = Frames(socket.create_connection(("127.0.0.1", door.port), timeout=60.0))
        stranger.send(JOIN, b"guessed")
        hub = call(door.port, door.word)
        taken = door.accept(60.0)
        hub.send(JOIN, b"here")
        assert taken.receive(60.0) == (JOIN, b"here")
        with pytest.raises(EOFError):
            stranger.receive(60.0)
        for end in (stranger, hub, taken):
            end.close()


def test_a_stranger_holds_the_door_neither_with_a_long_frame_nor_byte_by_byte(monkeypatch):
    """Ten seconds began anew with each byte, and a frame could announce four gigabytes."""
    monkeypatch.setattr(frames, "_TO_SPEAK", 0.5)
    with Door() as door:
        long = socket.create_connection(("127.0.0.1", door.port), timeout=60.0)
        long.sendall(b"J" + (2**32 - 1).to_bytes(4, "little") + b"x" * 1000)
        slow = socket.create_connection(("127.0.0.1", door.port), timeout=60.0)
        over = threading.Event()

        def trickle():
            with suppress(OSError):
                while not over.wait(0.05):
                    slow.sendall(b"J")

        threading.Thread(target=trickle, daemon=True).start()
        hub = call(door.port, door.word)
        taken = door.accept(60.0)
        over.set()
        hub.send(JOIN, b"here")
        assert taken.receive(60.0) == (JOIN, b"here")
        for end in (long, slow, hub, taken):
            end.close()


def test_a_caller_may_take_its_time_and_one_that_hangs_up_ends_nothing():
    """The hub's process may lose its processor between its call and its word."""
    with Door() as door:
        socket.create_connection(("127.0.0.1", door.port), timeout=60.0).close()
        hub = Frames(socket.create_connection(("127.0.0.1", door.port), timeout=60.0))
        threading.Timer(0.5, hub.send, (JOIN, door.word.encode())).start()
        taken = door.accept(0.1)
        hub.send(JOIN, b"here")
        assert taken.receive(60.0) == (JOIN, b"here")
        for end in (hub, taken):
            end.close()


def test_a_remote_component_gives_the_outputs_that_are_asked_for(monkeypatch):
    """By references and values where they lie in memory, as FMI's function has them."""
    component = object.__new__(FederatedComponent)
    component._remote = True
    monkeypatch.setattr(component, "_current", lambda references: [10.0 * r for r in references])
    references, values = (ctypes.c_uint * 3)(7, 0, 4), (ctypes.c_double * 3)()
    assert component._get_real(0, ctypes.addressof(references), 3, ctypes.addressof(values)) == 0
    assert list(values) == [70.0, 0.0, 40.0]


def test_values_of_a_component_that_was_handed_over_are_its_federates():
    """The FMU in this process stands where the run began."""
    component = object.__new__(FederatedComponent)
    component.name, component.inner = "load", SimpleNamespace(values=lambda names: {"K": 0.5})
    component._exchanges = SimpleNamespace(command=lambda *asked: {"K": 2.0, "asked": asked})
    component._remote = False
    assert component.values(["K"]) == {"K": 0.5}
    component._remote = True
    assert component.values(["K"]) == {"K": 2.0, "asked": ("load", "values", ["K"])}
