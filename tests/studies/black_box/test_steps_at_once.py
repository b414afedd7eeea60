"""Many steps of an FMU in another process cost one exchange, and give and tell what single steps do."""

import sys
from functools import partial
from time import monotonic

import numpy as np
import pytest

from orchestrator.core.errors import ComponentError, ErrorKind
from orchestrator.devices.binding.binding import bound_fmu
from orchestrator.devices.fmi import instance
from orchestrator.devices.fmi.bound_component import BoundComponent
from orchestrator.devices.fmi.description import read_description
from orchestrator.devices.fmi.isolated_component import IsolatedComponent
from orchestrator.devices.sandbox.resource_limits import Limits
from orchestrator.studies.black_box.bench import drive
from tests.devices.acceptance.conftest import gallery
from tests.devices.acceptance.gallery.build import build
from tests.devices.acceptance.gallery.members import converter

__all__ = ["gallery"]

H = 1e-4
NAMES = (("v_re", "v_im"), ("i_re", "i_im", "p"))
STEPS = 300
PATIENCE = 1.0  # [s]


def voltages(count=STEPS):
    """One that turns and swings, so that no two rows are alike, and passes the angle of half a turn."""
    times = H * np.arange(count)
    v = (1 + 0.05 * np.sin(40 * times)) * np.exp(1j * (3.0 + 20 * times))
    return np.column_stack([v.real, v.imag])


def initialised(component):
    component.setup(0.0, None)
    component.enter_initialization_mode()
    component.set({"v_re": 1.0, "v_im": 0.1})
    component.exit_initialization_mode()
    return component


def in_single_steps(monkeypatch, kind):
    monkeypatch.setattr(kind, "takes_many", lambda component, steps: False)


@pytest.mark.parametrize("late", [False, True])
@pytest.mark.parametrize(
    "name", [f"converter_{form}_si" for form in ("qd", "polar", "power", "abc")]
)
def test_behind_a_binding_they_are_the_same_to_the_last_bit(name, late, gallery, monkeypatch):
    description = bound_fmu(*gallery(name))
    rows = voltages()
    after = np.roll(rows, -1, axis=0) if late else None
    found = []
    for single in (False, True):
        if single:
            in_single_steps(monkeypatch, BoundComponent)
        with instance.open_component("box", description, isolated=True) as component:
            initialised(component)
            first = drive(component, NAMES, rows, H, late=after)
            # what was set and read last stays so for whoever asks step by step
            component.step(STEPS * H, H)
            state = component.get(("v_re", "v_im", "i_re", "i_im", "q"))
            again = drive(component, NAMES, rows[::-1], H, STEPS + 1)
            found.append((first, list(state.values()), again))
    for at_once, each in zip(*found, strict=True):
        np.testing.assert_array_equal(at_once, each)


def test_without_a_binding_and_beyond_the_room_of_the_mailbox_as_well(tmp_path, monkeypatch):
    description = read_description(build(converter("plain"), tmp_path))
    names = (NAMES[0], ("i_re", "i_im", "omega") * 20)
    rows = voltages(6000)
    found = []
    for single in (False, True):
        if single:
            in_single_steps(monkeypatch, IsolatedComponent)
        with instance.open_component("box", description, isolated=True) as component:
            found.append(drive(initialised(component), names, rows, H, late=rows + 0.01))
    np.testing.assert_array_equal(*found)


@pytest.mark.parametrize(
    ("faults", "words"),
    [
        ({"FAULT_CRASH_AT": 0.01}, "crash: its process died with SIGSEGV"),
        ({"FAULT_EXIT_AT": 0.01}, "exit: it ended its process with exit code 3"),
        ({"FAULT_HANG_AT": 0.01}, "hang: no answer within 1 s"),
        ({"FAULT_NAN_AT": 0.01}, "not a number: i_re is no finite number"),
        ({"FAULT_ERROR_AT": 0.01}, "fmi2Error: licence expired"),
        ({"FAULT_FLOOD": 100_000}, "output flood: more than 20000 log messages"),
    ],
    ids=["crash", "exit", "hang", "nan", "error", "flood"],
)
@pytest.mark.skipif(sys.platform == "win32", reason="names of signals")
def test_what_happens_in_the_middle_is_told_as_of_single_steps(
    faults, words, tmp_path, monkeypatch
):
    description = read_description(build(converter("box", **faults), tmp_path))
    limited = partial(IsolatedComponent, limits=Limits(seconds=1.0))
    told = []
    for single in (False, True):
        if single:
            in_single_steps(monkeypatch, IsolatedComponent)
        with limited("box", description) as component:
            initialised(component)
            with pytest.raises(ComponentError, match=words) as caught:
                drive(component, (NAMES[0], NAMES[1][:2]), voltages(), H)
            told.append((str(caught.value), caught.value.kind, caught.value.time))
    assert told[0] == told[1]
    assert (told[0][1] is ErrorKind.HANG) is ("FAULT_HANG_AT" in faults)


def test_patience_is_for_a_step_and_not_for_all_of_them(tmp_path):
    """Each step takes a fraction of what it may; all together take several times as much."""
    slow, patience = "({ extern int usleep(unsigned); usleep(6000); 0; })", 3.0
    description = read_description(
        build(converter("slow", FAULT_GAIN_WHERE=slow, FAULT_GAIN_BY=1), tmp_path)
    )
    with IsolatedComponent("box", description, limits=Limits(seconds=patience)) as component:
        begin = monotonic()
        found = drive(initialised(component), (NAMES[0], NAMES[1][:2]), voltages(100), H)
        assert monotonic() - begin > patience
    assert np.isfinite(found).all()
