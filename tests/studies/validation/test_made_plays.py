"""What a device did by a recording is kept while a study runs, and not found out twice."""

from dataclasses import replace

import numpy as np
import pytest

from orchestrator.face.api import validation as face
from orchestrator.studies.validation import device as played_device
from orchestrator.studies.validation import record
from orchestrator.studies.validation.device import PlayedDevice
from tests.studies.validation.test_instances import event

STEP = 1e-3  # [s]


@pytest.fixture
def device():
    return face._alone("gfor_phasor", None, {"S_n": 100.0}, STEP)


@pytest.fixture
def runs(monkeypatch):
    """The values of the devices that ran."""
    found = []
    run = PlayedDevice._play_alone

    def counted(device, *given):
        found.append(device.values)
        return run(device, *given)

    monkeypatch.setattr(PlayedDevice, "_play_alone", counted)
    return found


def test_the_same_values_by_the_same_voltage_run_once_while_outcomes_are_kept(device, runs):
    seen = event()
    doubled = replace(seen.recording, power=2 * seen.recording.power)
    with device.made.keeping():
        first = device.play(seen.recording, seen.start)
        assert device.with_values({}).play(doubled, seen.start) is first
    assert len(runs) == 1
    again = device.play(seen.recording, seen.start)
    device.play(seen.recording, seen.start)
    assert len(runs) == 3
    assert again.same_as(first)


def changed(recording, part):
    """A recording of which one part is another one."""
    others = {
        "voltage": recording.voltage * 0.999,
        "average": 2 * recording.average,
        "interval": 2 * recording.interval,
        "jumps": {200: 0.5},
        "bends": True,
        "instantaneous": True,
    }
    return replace(recording, **{part: others[part]})


@pytest.mark.parametrize(
    "part", ["voltage", "average", "interval", "jumps", "bends", "instantaneous"]
)
def test_what_drives_the_device_otherwise_runs_anew(part, device, runs):
    seen = event()
    with device.made.keeping():
        device.play(seen.recording, seen.start)
        device.play(changed(seen.recording, part), seen.start)
    assert len(runs) == 2


def test_another_device_or_operating_point_runs_anew(device, runs):
    seen = event()
    others = [
        device.with_values({"droop.R_f": 0.03}),
        replace(device, step_size=2 * STEP),
        device.in_step,
    ]
    with device.made.keeping():
        for one in [device, *others]:
            one.play(seen.recording, seen.start)
        device.play(seen.recording, replace(seen.start, power=0.5 + 0j))
    assert len(runs) == 5


def test_beside_a_voltage_that_turns_what_was_measured_counts(device, runs):
    seen = event()
    held = device.in_step
    with device.made.keeping():
        first = held.play(seen.recording, seen.start)
        assert held.play(replace(seen.recording), seen.start) is first
        held.play(replace(seen.recording, power=0.9 * seen.recording.power), seen.start)
        held.play(replace(seen.recording, good=np.arange(400) > 1), seen.start)
    assert len(runs) == 3


def test_no_more_is_kept_than_fits(device, runs, monkeypatch):
    seen = event()
    monkeypatch.setattr(played_device, "_MOST_SAMPLES", 2 * len(seen.recording.power))
    droops = [0.03, 0.04, 0.05]
    with device.made.keeping():
        for droop in [*droops, 0.05, 0.03]:
            device.with_values({"droop.R_f": droop}).play(seen.recording, seen.start)
    assert [one["droop.R_f"] for one in runs] == [0.03, 0.04, 0.05, 0.03]


def test_what_is_known_is_not_made_beside_others(device, runs, monkeypatch):
    beside = []
    make = played_device._made_beside
    monkeypatch.setattr(
        played_device, "_made_beside", lambda plays: beside.append(len(plays)) or make(plays)
    )
    seen = event()
    others = [device.with_values({"droop.R_f": droop}) for droop in (0.03, 0.04, 0.06, 0.07, 0.08)]
    plays = [played_device.Play(one, seen.recording, seen.start) for one in others]
    with device.shelf.keeping(), device.made.keeping():
        others[0].play(seen.recording, seen.start)
        device.announce(plays)
        for one in others:
            one.play(seen.recording, seen.start)
    assert beside == [4]
    assert len(runs) == 1


def test_the_voltage_for_the_steps_is_made_once_and_anew_for_a_changed_recording(monkeypatch):
    recording = event().recording
    driving = recording.driving_in(STEP)
    assert recording.driving_in(STEP) is driving
    assert driving.held.shape == (399, 10)
    np.testing.assert_array_equal(driving.voltage, recording.at(driving.times))
    assert recording.driving_in(STEP / 2).held.shape == (798, 5)
    lower = changed(recording, "voltage").driving_in(STEP)
    np.testing.assert_allclose(lower.held, 0.999 * driving.held, rtol=1e-12)
    monkeypatch.setattr(record, "_MOST_KEPT", 100)
    long = replace(recording)
    assert long.driving_in(STEP) is not long.driving_in(STEP)
