"""An FMU in a process of its own: the same answers, and whatever it does becomes one named error."""

import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from fmus.toolchain.compiler import compile_library, joined_source
from orchestrator import devices
from orchestrator.core.errors import ComponentError, InputError
from orchestrator.devices.acceptance.runner import check_fmu
from orchestrator.devices.fmi import instance, isolated_component
from orchestrator.devices.fmi.component import RealBatch
from orchestrator.devices.fmi.description import read_description
from orchestrator.devices.fmi.instance import is_ours, open_component
from orchestrator.devices.fmi.isolated_component import _TO_END, IsolatedComponent
from orchestrator.devices.fmi.loaded_component import LoadedComponent
from orchestrator.devices.sandbox.mailbox import Client
from orchestrator.devices.sandbox.process_tree import descendants
from orchestrator.devices.sandbox.resource_limits import TO_BEGIN, Limits
from orchestrator.systems.coupling.compiled_loop import CompiledLoop
from orchestrator.systems.coupling.master import Master
from orchestrator.systems.coupling.recorder import Recorder
from orchestrator.systems.coupling.schedule import jacobi
from orchestrator.systems.coupling.stepping import PythonLoop
from orchestrator.systems.coupling.system import System
from tests.devices.acceptance.gallery.build import build
from tests.devices.acceptance.gallery.members import converter

H = 1e-4


@pytest.fixture(scope="module")
def box(tmp_path_factory):
    """A converter of the gallery, with faults."""
    folder = tmp_path_factory.mktemp("boxes")

    def make(name="box", **faults):
        return read_description(build(converter(name, **faults), folder))

    return make


def initialised(component):
    component.setup(0.0, None)
    component.enter_initialization_mode()
    component.set({"v_re": 1.0, "v_im": 0.0})
    component.exit_initialization_mode()
    return component


def stepped(component, steps):
    inputs, outputs = (
        RealBatch(component, ["v_re", "v_im"]),
        RealBatch(component, ["i_re", "i_im", "omega"]),
    )
    rows = []
    for k in range(steps):
        inputs.values[:] = 1.0 + 0.01 * np.sin(k), 0.02 * np.cos(3 * k)
        inputs.write()
        component.step(k * H, H)
        rows.append(outputs.read().copy())
    return np.array(rows)


def test_answers_are_the_same_to_the_last_bit(box):
    description, answers = box(), []
    for isolated in (False, True):
        with open_component("box", description, isolated=isolated) as component:
            assert isinstance(component, IsolatedComponent) is isolated
            component.set({"P_0": 0.7, "R_f": 0.01})
            answers.append(stepped(initialised(component), 200))
    np.testing.assert_array_equal(*answers)


def test_python_files_of_the_users_folder_are_not_taken_for_the_librarys(
    box, tmp_path, monkeypatch
):
    (tmp_path / "pathlib.py").write_text("raise RuntimeError('the user's own file')\n")
    monkeypatch.chdir(tmp_path)
    with open_component("box", box(), isolated=True) as component:
        assert len(stepped(initialised(component), 3)) == 3


def test_a_python_backed_fmu_can_be_isolated_as_well(fmu_path):
    description, answers = read_description(fmu_path("gfor")), []
    for isolated in (False, True):
        with open_component("box", description, isolated=isolated) as component:
            component.set({"pod_p.enabled": True})
            answers.append(stepped(initialised(component), 50))
    np.testing.assert_array_equal(*answers)


def test_only_what_was_built_here_is_trusted(box, fmu_path, tmp_path):
    assert is_ours(fmu_path("gfor"))
    assert not is_ours(box().path)
    copy = tmp_path / "renamed.fmu"
    content = fmu_path("gfor").read_bytes()
    copy.write_bytes(content)
    assert is_ours(copy)
    copy.write_bytes(content[:-1] + b"x")
    assert not is_ours(copy)
    # what a file says of itself does not count
    claims = replace(box(), generation_tool="gfor-cosim 1.0")
    with open_component("box", claims) as component:
        assert isinstance(component, IsolatedComponent)
    with open_component("own", read_description(fmu_path("gfor"))) as component:
        assert isinstance(component, LoadedComponent)


def test_state_is_saved_in_the_other_process(box):
    with open_component("box", box()) as component:
        initialised(component)
        stepped(component, 10)
        saved = component.save_state()
        copy = component.deserialize_state(component.serialize_state(saved))
        first = stepped(component, 20)
        for state in (saved, copy):
            component.restore_state(state)
            np.testing.assert_array_equal(stepped(component, 20), first)
            component.free_state(state)


def test_reset(box):
    with open_component("box", box()) as component:
        first = stepped(initialised(component), 20)
        component.reset()
        np.testing.assert_array_equal(stepped(initialised(component), 20), first)


@pytest.mark.parametrize(
    ("faults", "words"),
    [
        ({"FAULT_CRASH_AT": 0.01}, "crash: its process died with SIGSEGV"),
        ({"FAULT_ABORT_AT": 0.01}, "crash: its process died with SIGABRT"),
        ({"FAULT_EXIT_AT": 0.01}, "exit: it ended its process with exit code 3"),
        ({"FAULT_HANG_AT": 0.01}, "hang: no answer within 1 s"),
        ({"FAULT_FLOOD": 100_000}, "output flood: more than 20000 log messages"),
        ({"FAULT_PRINT": 10_000}, "output flood: more than 1000000 bytes"),
        ({"FAULT_NAN_AT": 0.01}, "not a number: i_re is no finite number"),
        ({"FAULT_ERROR_AT": 0.01}, "fmi2Error: licence expired"),
    ],
    ids=lambda x: next(iter(x)) if isinstance(x, dict) else "",
)
@pytest.mark.skipif(sys.platform == "win32", reason="names of signals")
def test_whatever_it_does_is_one_error_and_what_was_computed_stays(faults, words, box, monkeypatch):
    limits = Limits(seconds=1.0, output=1_000_000)
    monkeypatch.setattr(
        instance, "IsolatedComponent", lambda *a: IsolatedComponent(*a, limits=limits)
    )
    system = System()
    system.add("sound", box(), inputs={"v_re": 1.0, "v_im": 0.0})
    system.add(
        "vendor", box(next(iter(faults)).lower(), **faults), inputs={"v_re": 1.0, "v_im": 0.0}
    )
    recorder = Recorder(["vendor.i_re", "sound.i_re"], every=10)
    with Master(system, jacobi(("sound", "vendor")), H) as master:
        with pytest.raises(ComponentError, match=words) as caught:
            master.run(1.0, observers=[recorder])
        assert caught.value.component == "vendor"
        assert caught.value.time is not None
    early = any(name in faults for name in ("FAULT_FLOOD", "FAULT_PRINT"))
    assert len(recorder.times) >= (1 if early else 9)
    assert np.isfinite(recorder.values).all()


def test_after_its_end_every_call_says_so(box):
    with open_component("box", box("fault_exit_at", FAULT_EXIT_AT=0.01)) as component:
        initialised(component)
        with pytest.raises(ComponentError, match="exit code 3"):
            stepped(component, 300)
        for again in (
            lambda: component.step(0.0, H),
            component.save_state,
            lambda: component.set({"R_f": 0.1}),
        ):
            with pytest.raises(ComponentError, match="exit code 3"):
                again()


@pytest.mark.skipif(sys.platform == "win32", reason="a script of the shell")
def test_the_beginning_of_our_own_process_is_not_the_fmus_time(box, tmp_path, monkeypatch):
    slow = tmp_path / "slow_python"
    slow.write_text(f'#!/bin/sh\nsleep 2\nexec "{sys.executable}" "$@"\n', encoding="utf-8")
    slow.chmod(0o755)
    description, limits = box(), Limits(seconds=1.5)
    monkeypatch.setattr(sys, "executable", str(slow))
    with IsolatedComponent("box", description, limits=limits) as component:
        initialised(component)
    report = check_fmu(description.path, limits=limits, only=("start_values",))
    assert not report.failures


def test_its_answers_have_the_time_of_the_limits_and_its_beginning_that_of_a_beginning(
    monkeypatch, tmp_path
):
    asked = []

    class Begun:
        """A process that begins at once, and answers nothing."""

        running = False

        def __init__(self, *_, **__):
            self.box = SimpleNamespace(client=Client(), function=lambda *_: None)

        def close(self):
            pass

    def remote(self, call, command, *_):
        asked.append((command, self._box.client.patience))

    monkeypatch.setattr(isolated_component, "ConfinedProcess", Begun)
    monkeypatch.setattr(isolated_component, "protections", lambda answer: ())
    monkeypatch.setattr(IsolatedComponent, "_remote", remote)
    description = SimpleNamespace(path=tmp_path / "box.fmu", guid="{}")
    monkeypatch.setattr(isolated_component, "runs_under_wine", lambda description: False)
    with IsolatedComponent("box", description, tmp_path, Limits(seconds=7.0)) as component:
        component.renew()
    assert asked == [
        ("begin", TO_BEGIN),
        ("instantiate", 7.0),
        ("release", min(7.0, _TO_END)),
        ("instantiate", 7.0),
    ]


def test_an_instance_that_cannot_be_made(box):
    description = replace(box(), guid="{other}")
    with pytest.raises(ComponentError, match="fmi2Instantiate"):
        open_component("box", description)
    with (
        open_component("box", box()) as component,
        pytest.raises(InputError, match="no variable 'x'"),
    ):
        component.set({"x": 1.0})


@pytest.mark.skipif(sys.platform != "linux", reason="Landlock and resource limits are Linux's")
def test_memory_and_files_are_limited(box, tmp_path):
    eater = box("eater", FAULT_EAT=1_000_000)
    limits = Limits(memory=60_000_000)
    component = IsolatedComponent("eater", eater, limits=limits)
    with component, pytest.raises(ComponentError, match=r"crash|exit"):
        stepped(initialised(component), 50)
    outside = tmp_path / "outside.txt"
    writer = box("writer", FAULT_WRITE=f'"{outside}"')
    with IsolatedComponent("writer", writer) as component:
        stepped(initialised(component), 1)
        *_, worker = descendants(component._process._process.pid)
        work = component._process.folder / "work"
        assert Path(f"/proc/{worker}/root{work}/inside.txt").read_text() == "inside"
    assert not outside.exists()
    assert not work.exists()


def test_both_loops_step_it(box, monkeypatch):
    ends = []
    for kind in (CompiledLoop, PythonLoop):
        if kind is PythonLoop:
            monkeypatch.setattr(
                "orchestrator.systems.coupling.compiled_loop.loop_library", lambda: None
            )
        system = System()
        system.add("box", box(), inputs={"v_re": 1.0, "v_im": 0.01})
        with Master(system, jacobi(("box",)), H) as master:
            assert type(master._loop) is kind
            master.advance(50)
            ends.append(master.components["box"].get(["i_re", "i_im"]))
    assert ends[0] == ends[1]


@pytest.mark.slow
@pytest.mark.parametrize("platform", ["win64", "darwin64"])
@pytest.mark.parametrize("source", ["sandbox/mailbox.c", "fmi/port_adapter.c"])
def test_what_is_compiled_can_be_compiled_for_every_platform(source, platform):
    """Only compiled: it runs on the platforms that the tests run on."""
    text = joined_source(Path(devices.__file__).parent / source)
    assert compile_library(text, platform).stat().st_size > 1000
