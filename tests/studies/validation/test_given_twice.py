"""What is read of a recording's files: one that is given twice, headings as they are written, a rated voltage."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

import orchestrator as gfor_in_python
from orchestrator.core.errors import InputError
from orchestrator.output.results.csv_recording import read_table
from orchestrator.studies.validation.event import prepare_event
from orchestrator.studies.validation.record import PortBases, read_recording
from orchestrator.studies.validation.study import GivenRecording, events_of

BASES = PortBases(1500.0, 50.0)


def dipped(seed=1):
    """A plant whose voltage dips from 1 to 1.1 s."""
    time = np.arange(0, 3, 1e-3)
    noise = 1e-4 * np.random.default_rng(seed).standard_normal((4, len(time)))
    columns = {
        "v_pu": 1 - 0.05 * ((time >= 1) & (time < 1.1)) + noise[0],
        "angle_deg": noise[1],
        "p_mw": 750 + 30 * ((time >= 1) & (time < 1.1)) + 1500 * noise[2],
        "q_mvar": 1500 * noise[3],
    }
    return pd.DataFrame(columns, index=pd.Index(time, name="time"))


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"hold_back": [dipped()], "fit": "pod_p.K"}, "--hold-back .* confirm"),
        ({"more": [dipped()]}, "would count twice"),
    ],
)
def test_a_recording_that_is_given_twice_neither_counts_twice_nor_confirms(given, said):
    recordings = [dipped(), *given.pop("more", [])]
    with pytest.raises(InputError, match=said):
        gfor_in_python.validate(
            "gfor_phasor", recordings, values={"pod_p.enabled": True}, step="1 ms", **given
        )


def test_two_events_of_one_file_are_two():
    dataset = dipped().to_xarray()
    given = [GivenRecording(dataset, "may"), GivenRecording(dataset, "may", held_back=True)]

    def found(*events):
        return events_of(
            SimpleNamespace(
                recordings=given, bases=BASES, channels=(), place=None, events=list(events)
            )
        )

    assert len(found((1.0, 1.1), (2.0, 2.1))) == 2
    for same in ([], [(1.0, 1.1)]):
        with pytest.raises(InputError, match=r"--hold-back may: .* confirms nothing"):
            found(*same)


def asked(frame):
    """Questions about a recording's gaps, by kind."""
    recording = read_recording(frame.to_xarray(), "rec", BASES)
    questions = prepare_event(recording, BASES).questions
    return {str(one.kind): one.figures for one in questions}


def test_p_that_is_missing_as_the_event_begins_is_asked_about_like_missing_rows():
    frame = dipped()
    frame.loc[0.991:1.059, ["p_mw", "q_mvar"]] = np.nan
    found = asked(frame)
    assert found["gap at the event"] == {
        "length": pytest.approx(0.07),
        "at": pytest.approx(0.99),
        "of_power": True,
    }
    assert found["missing samples"]["longest"] == pytest.approx(0.069)
    assert found["missing samples"]["of_power"]
    rows = asked(dipped().drop(index=frame.index[991:1060]))
    assert not rows["gap at the event"]["of_power"]
    frame = dipped()
    frame.loc[2.0:2.06, ["p_mw", "q_mvar"]] = np.nan
    assert "gap at the event" not in asked(frame)


def test_headings_are_channels_as_they_are_written_and_a_rated_voltage_tells_kv(tmp_path):
    frame = dipped()
    columns = {
        "t [ms]": 1e3 * frame.index,
        "Vm": 230 * frame.v_pu,
        "Va": frame.angle_deg,
        "P_in [kW]": -1e3 * frame.p_mw,
        "Q (kvar)": 1e3 * frame.q_mvar,
    }
    path = tmp_path / "rec.csv"
    pd.DataFrame(columns).to_csv(path, index=False)
    channels = ["time=t [ms]", "v=Vm", "angle=Va in deg", "p=-P_in [kW]", "q=Q (kvar)"]
    bases = PortBases(1500.0, 50.0, kilovolt=230.0, average=0.0)
    found = read_recording(read_table(path), "rec", bases, channels)
    expected = read_recording(frame.to_xarray(), "rec", PortBases(1500.0, 50.0, average=0.0))
    for name in ("times", "voltage", "power"):
        assert getattr(found, name) == pytest.approx(getattr(expected, name), abs=1e-9)
