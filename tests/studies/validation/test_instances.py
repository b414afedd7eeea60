"""An instance that is used for run after run gives what a new one gives, and is given back."""

from dataclasses import replace
from zipfile import ZipFile

import numpy as np
import pandas as pd
import pytest

from orchestrator.cases.scenario.catalogue_fmus import catalogue_fmu, quickest_fmu
from orchestrator.devices.fmi.description import read_description
from orchestrator.devices.fmi.isolated_component import IsolatedComponent
from orchestrator.face.api import validation as face
from orchestrator.studies.validation import instances
from orchestrator.studies.validation.device import PlayedDevice
from orchestrator.studies.validation.event import prepare_event
from orchestrator.studies.validation.record import PortBases, read_recording
from tests.devices.acceptance.gallery.build import build
from tests.devices.acceptance.gallery.members import converter

OTHERS = {
    "gfor": {"droop.R_f": 0.1, "pod_p.enabled": True, "current_limit.kind": 1},
    "gfor_phasor": {"droop.R_f": 0.1, "transformer.X_t": 0.3},
}


def event():
    times = pd.Index(np.arange(400) / 1000, name="time")
    moved = (times > 0.2).astype(float)
    columns = {"v_pu": 1 - 0.05 * moved, "angle_deg": 2 * moved, "p_mw": 60.0, "q_mvar": 0.0}
    bases = PortBases(100.0, 50.0)
    frame = pd.DataFrame(columns, times).to_xarray()
    return prepare_event(read_recording(frame, "made here", bases), bases)


@pytest.mark.parametrize("model", OTHERS)
def test_a_run_leaves_nothing_to_the_next_one(model, monkeypatch):
    opened = []
    open_anew = instances.open_component

    def counted(*given, **named):
        opened.append(open_anew(*given, **named))
        return opened[-1]

    monkeypatch.setattr(instances, "open_component", counted)
    device = face._alone(model, None, {"S_n": 100.0}, 1e-4)
    seen = event()
    new = device.play(seen.recording, seen.start).power
    with device.shelf.keeping():
        other = device.with_values(OTHERS[model]).play(seen.recording, seen.start).power
        again = device.play(seen.recording, seen.start).power
    assert np.abs(other - new).max() > 1e-3
    assert np.array_equal(again, new)
    assert len(opened) == 2
    assert all(one._fmu is None for one in opened)


def test_a_model_by_its_name_runs_without_python_and_gives_the_same_to_the_last_bit():
    device = face._alone("gfor", None, {"S_n": 100.0}, 1e-4)
    with ZipFile(device.path) as archive:
        assert not [name for name in archive.namelist() if name.endswith(".py")]
    seen = event()
    of_python = replace(device, description=catalogue_fmu("gfor"))
    powers = [one.play(seen.recording, seen.start).power for one in (device, of_python)]
    assert np.array_equal(*powers)


def test_a_component_of_a_case_runs_on_the_compiled_fmu_of_its_model():
    device = face._of_case("infinite_bus", "gfor", "dip", None, 1e-4)
    assert device.path == quickest_fmu("gfor").path


LEAVES = (
    '({ static int late = -1; if (late < 0) late = getenv("RAN") != 0;'
    ' if (WHERE) setenv("RAN", "1", 1); late; })'
)
"""True in a process in which an instance ran before, with a droop as in WHERE: the library forgets, the process not."""


def stranger(folder, **faults):
    """A device of somebody else's FMU."""
    source = converter("stranger", **faults)
    description = read_description(build(source, folder))
    return PlayedDevice("stranger", description, {"S_n": 100.0}, 100.0, 50.0)


@pytest.fixture
def processes(monkeypatch):
    """The processes that are started for FMUs, one after another."""
    opened = []
    begin = IsolatedComponent._start

    def counted(component, directory):
        opened.append(component)
        begin(component, directory)

    monkeypatch.setattr(IsolatedComponent, "_start", counted)
    return opened


DROOPS = (0.02, 0.02, 0.05, 0.04, 0.02, 0.05)


def powers(device, seen):
    return [
        device.with_values({"R_f": droop}).play(seen.recording, seen.start).power
        for droop in DROOPS
    ]


def test_a_strangers_process_runs_many_times_after_two_runs_that_show_that_it_may(
    tmp_path, processes
):
    device, seen = stranger(tmp_path), event()
    each = powers(device, seen)
    assert len(processes) == len(DROOPS)
    processes.clear()
    with device.shelf.keeping():
        kept = powers(device, seen)
    np.testing.assert_array_equal(kept, each)
    assert np.abs(kept[2] - kept[0]).max() > 1e-5
    assert len(processes) == 3  # one more beside a run with the same values, and with others
    assert not any(one._process.running for one in processes)


@pytest.mark.parametrize("where", ["1", "z[GAIN] > 0.03"])
def test_what_a_run_leaves_in_a_process_never_reaches_the_next_run(where, tmp_path, processes):
    faults = {"FAULT_GAIN_WHERE": LEAVES.replace("WHERE", where), "FAULT_GAIN_BY": 1.3}
    device, seen = stranger(tmp_path, **faults), event()
    each = powers(device, seen)
    with device.shelf.keeping():
        kept = powers(device, seen)
    np.testing.assert_array_equal(kept, each)


def test_a_run_that_fails_in_a_used_process_is_made_in_a_new_one(tmp_path, processes):
    """A library that its second instance in a process crashes, as one that frees what it still needs."""
    crashes = LEAVES.replace("WHERE", "1").replace(" late; })", " late && (abort(), 1); })")
    assert "abort" in crashes
    device, seen = stranger(tmp_path, FAULT_GAIN_WHERE=crashes, FAULT_GAIN_BY=1.3), event()
    each = powers(device, seen)
    processes.clear()
    with device.shelf.keeping():
        kept = powers(device, seen)
    np.testing.assert_array_equal(kept, each)
    assert len(processes) == len(DROOPS)
