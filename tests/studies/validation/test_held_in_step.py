"""A model near its limit of the current is held in step with the plant, so that its causes are told apart."""

import ctypes
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from orchestrator.core.errors import AnalysisError, CosimError
from orchestrator.face.api import validation as face
from orchestrator.studies.black_box import bench
from orchestrator.studies.black_box.bench import Stretches
from orchestrator.studies.validation.causes import capped
from orchestrator.studies.validation.event import prepare_event
from orchestrator.studies.validation.held_in_step import hold_in_step
from orchestrator.studies.validation.record import PortBases, read_recording

STEP = 5e-4
SECONDS = 4.0
UNSTABLE = 3.0  # rate at which the device's angle runs away [1/s]


def run_away(off):
    """A current of fixed size whose angle runs away from the voltage's, beginning so far off [rad]."""
    angle = off

    def drive(voltage, late):
        nonlocal angle
        found = []
        for one in late:
            angle += STEP * UNSTABLE * (angle - np.angle(one))
            found.append(np.exp(1j * angle))
        return np.array(found)

    return drive


def held(off, **more):
    voltage = np.ones(round(SECONDS / STEP), complex)
    return hold_in_step(run_away(off), (voltage, voltage), np.ones(len(voltage), complex), STEP)


def test_an_angle_that_runs_away_faster_than_it_is_followed_is_lost_and_a_slower_one_is_kept(
    monkeypatch,
):
    """By hand: the difference grows at the device's rate less the gain."""
    module = "orchestrator.studies.validation.held_in_step._GAIN"
    for gain in (2.0, 5.0):
        monkeypatch.setattr(module, gain)
        current = held(1e-4).current
        early, late = (abs(np.angle(current[round(t / STEP)])) for t in (0.5, 1.5))
        assert np.log(late / early) == pytest.approx(UNSTABLE - gain, abs=0.1)


def test_a_device_that_feeds_the_measured_current_turns_nothing():
    run = held(0.0)
    assert not run.turn.any()
    assert run.current == pytest.approx(1.0)


def test_what_gives_way_is_counted_as_power(monkeypatch):
    """A device at a quarter of a turn pulls the voltage at the gain's speed; of a ramp a second's part counts."""
    count = round(SECONDS / STEP)
    ones = np.ones(count, complex)

    def ahead(voltage, late):
        return 1j * late

    run = hold_in_step(ahead, (ones, ones), ones, STEP)
    assert run.turn[-1] > 0.5
    behind = hold_in_step(lambda v, late: -1j * late, (ones, ones), ones, STEP)
    assert behind.turn == pytest.approx(-run.turn)


def test_a_limit_of_the_current_is_not_told_the_measured_angle():
    own, voltage = np.array([0.5, 2.0, 2j]), np.ones(3)
    (found,) = capped([own], [voltage], 1.0)
    assert found == pytest.approx([0.5, 1.0, 1j])


@pytest.fixture(scope="module")
def swinging():
    """A plant whose angle runs away from every model's, so that the voltage turns all the time."""
    times = np.arange(250) / 1000
    columns = {"v_pu": 1 - 0.05 * (times > 0.1), "angle_deg": 2.0 * (times > 0.1), "q_mvar": 0.0}
    frame = pd.DataFrame(columns | {"p_mw": 60.0}, pd.Index(times, name="time")).to_xarray()
    bases = PortBases(100.0, 50.0)
    event = prepare_event(read_recording(frame, "made here", bases), bases)
    turned = event.recording.power * np.exp(4j * np.maximum(times - 0.1, 0))
    return replace(event, recording=replace(event.recording, power=turned))


@pytest.mark.parametrize(
    ("model", "step"),  # a stretch of 1, 2, 3, 10 or 71 steps: sums of few, of eight and of halves
    [
        ("gfor_phasor", 1e-3),
        ("gfor", 5e-4),
        ("gfor_phasor", 3e-4),
        ("gfor", 1e-4),
        ("gfor_phasor", 1.4e-5),
    ],
)
def test_all_stretches_at_once_give_what_one_after_the_other_gives_to_the_last_bit(
    swinging, monkeypatch, model, step
):
    device = face._alone(model, None, {"S_n": 100.0}, step).in_step
    at_once = device.play(swinging.recording, swinging.start).power
    monkeypatch.setattr(Stretches, "turns_at_once", False)
    each = device.play(swinging.recording, swinging.start).power
    np.testing.assert_array_equal(at_once, each)
    assert np.ptp(np.angle(at_once)) > 0.01


@pytest.mark.parametrize(
    ("volts", "words"),
    [(np.nan, r"at t = 0\.649 s: fmi2SetReal"), (1e200, r"at t = 0\.649 s: fmi2DoStep")],
)
def test_what_ends_a_run_that_is_held_is_told_as_of_one_stretch_after_the_other(
    swinging, monkeypatch, volts, words
):
    device = face._alone("gfor_phasor", None, {"S_n": 100.0}, 1e-3).in_step
    voltage = swinging.recording.voltage.copy()
    voltage[150:] = volts
    broken = replace(swinging.recording, voltage=voltage, good=np.arange(len(voltage)) < 150)
    said = []
    for at_once in (True, False):
        if not at_once:
            monkeypatch.setattr(Stretches, "turns_at_once", at_once)
        with pytest.raises(CosimError, match=words) as ended:
            device.play(broken, swinging.start)
        said.append(str(ended.value))
    assert said[0] == said[1]


@pytest.mark.parametrize("turns_at_once", [True, False])
def test_a_current_that_is_no_number_ends_a_run_that_is_held(swinging, monkeypatch, turns_at_once):
    """A foreign FMU's, for ours end such a step themselves; before, it comes to rest in one call."""
    get_set = ctypes.CFUNCTYPE(
        ctypes.c_int,
        ctypes.c_void_p,
        ctypes.c_void_p,
        ctypes.c_size_t,
        ctypes.POINTER(ctypes.c_double),
    )

    @get_set
    def read_nothing(component, references, count, values):
        values[0] = np.nan
        return 0

    called = []
    functions = bench._functions

    def spoilt(component):
        called.append(component)
        found = functions(component)
        if len(called) > 1:
            found[1] = ctypes.cast(read_nothing, ctypes.c_void_p)
        return found

    monkeypatch.setattr(bench, "_functions", spoilt)
    monkeypatch.setattr(Stretches, "turns_at_once", turns_at_once)
    device = face._alone("gfor_phasor", None, {"S_n": 100.0}, 1e-3).in_step
    with pytest.raises(AnalysisError, match="its current is no longer a finite number"):
        device.play(swinging.recording, swinging.start)
    assert len(called) == 2
