"""Codes that recorders write where they have no value, such as -9999, are no values."""

import numpy as np
import pytest
import xarray as xr

from orchestrator.studies.validation.missing_codes import missing_codes
from orchestrator.studies.validation.questions import QuestionKind
from orchestrator.studies.validation.record import PortBases, read_recording
from orchestrator.studies.validation.words import sentence

TIMES = np.arange(0.0, 6.0, 0.02)
GAP = slice(100, 103)  # from 2 s on


def recorded(**planted):
    """A quiet plant of 1500 MVA as a recording, with a code at some samples of some columns."""
    random = np.random.default_rng(2)
    scatter = random.standard_normal((4, len(TIMES)))
    columns = {
        "v_pu": (1.0 + 1e-5 * scatter[0], "pu"),
        "angle_deg": (5.7 + 1e-3 * scatter[1], "deg"),
        "p_mw": (1350 + 0.1 * scatter[2], "MW"),
        "q_mvar": (2.5 + 0.1 * scatter[3], "Mvar"),
    }
    for name, code in planted.items():
        columns[name][0][GAP] = code
    named = {name: ("time", values, {"units": unit}) for name, (values, unit) in columns.items()}
    dataset = xr.Dataset(named, {"time": TIMES})
    return read_recording(dataset, "rec", PortBases(rating=1500.0, rated_hz=50.0))


@pytest.mark.parametrize("code", [-9999.0, 9999.0, -999.0, -32768.0, 1e20, -3.4028235e38])
@pytest.mark.parametrize("column", ["v_pu", "angle_deg", "p_mw", "q_mvar"])
def test_a_code_is_named_and_its_samples_are_missing(column, code):
    found = recorded(**{column: code})
    assert np.abs(found.voltage).max() < 1.001
    assert np.abs(found.power).max() < 0.91
    assert np.flatnonzero(~found.good).tolist() == [100, 101, 102]
    kinds = [one.kind for one in found.questions]
    assert kinds == [QuestionKind.MISSING_CODE, QuestionKind.MISSING]
    said = sentence(found.questions[0])
    assert said.startswith(f"{column!r} is {code:.10g} at 2 s (3 rows)")
    assert "a code for missing?" in said


def test_a_plant_that_passes_through_such_a_number_is_not_asked_about():
    power = np.linspace(990.0, 1350.0, 361)  # one MW apart, 999 among them
    assert 999.0 in power
    assert missing_codes(power) == []
    assert missing_codes(np.append(power, 3500.0)) == []  # a spike is not a code
    (code,) = missing_codes(np.append(power, -9999.0))
    assert (code.value, code.samples.tolist()) == (-9999.0, [361])


def test_a_recording_without_codes_stays_as_it_is():
    assert recorded().questions == ()
