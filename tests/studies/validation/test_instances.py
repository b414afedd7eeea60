"""An instance that is used for run after run gives what a new one gives, and is given back."""

from dataclasses import replace
from zipfile import ZipFile

import numpy as np
import pandas as pd
import pytest

from orchestrator.cases.scenario.catalogue_fmus import catalogue_fmu
from orchestrator.face.api import validation as face
from orchestrator.studies.validation import instances
from orchestrator.studies.validation.event import prepare_event
from orchestrator.studies.validation.record import PortBases, read_recording

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
