"""A magnitude or an angle of the voltage that comes later than the other one is asked about, and by which time."""

from types import SimpleNamespace

import numpy as np
import pytest

from orchestrator.studies.validation.device import OperatingStart
from orchestrator.studies.validation.event import RecordedEvent
from orchestrator.studies.validation.record import Recording
from orchestrator.studies.validation.trials import TrialLog
from orchestrator.studies.validation.voltage_clocks import (
    ask_of_voltage_clocks,
    delay_of_magnitude,
)
from orchestrator.studies.validation.windows import Windows

INTERVAL = 1e-3  # between samples [s]
TIMES = INTERVAL * np.arange(3000)
DIP = (TIMES >= 1.0) & (TIMES < 1.1)
SWING = 0.05 * np.sin(2 * np.pi * 0.7 * (TIMES - 1.0)) * (TIMES > 1.0)
ANGLE = SWING - 0.2 * DIP  # [rad]
MAGNITUDE = 1.0 + 0.1 * SWING - 0.3 * DIP  # [pu]
WINDOWS = Windows(1.0, 1.1, TIMES[-1])


def late(values, seconds):
    return np.interp(TIMES - seconds, TIMES, values)


def plant(voltage):
    """The power of a source of 1 pu behind 0.2 pu, as both follow at once [pu]."""
    return voltage * np.conj((1.0 - voltage) / 0.2j)


def recorded(magnitude, angle, power):
    everywhere = np.ones(len(TIMES), dtype=bool)
    return Recording(
        label="rec",
        begin=0.0,
        interval=INTERVAL,
        voltage=magnitude * np.exp(1j * angle),
        power=power,
        good=everywhere,
        driven=everywhere,
        frame_hz=50.0,
        instantaneous=False,
        average=0.02,
        channels={},
    )


CASES = {
    "of one time": (MAGNITUDE, ANGLE, 0.0),
    "the magnitude 20 ms late": (late(MAGNITUDE, 0.02), ANGLE, 0.02),
    "the angle 8 ms late": (MAGNITUDE, late(ANGLE, 0.008), -0.008),
    "a delay too short to tell": (late(MAGNITUDE, 0.002), ANGLE, 0.0),
    "an angle without a jump": (late(MAGNITUDE, 0.02), SWING, 0.0),
}


@pytest.mark.parametrize(("magnitude", "angle", "expected"), CASES.values(), ids=CASES)
def test_jumps_tell_by_which_time_magnitude_and_angle_are_apart(magnitude, angle, expected):
    found = delay_of_magnitude(recorded(magnitude, angle, 0j * TIMES), WINDOWS)
    assert found == pytest.approx(expected, abs=INTERVAL)


@pytest.mark.parametrize(
    ("part", "seconds"), [("magnitude", 0.02), ("angle", 0.02), ("angle", -0.02)]
)
def test_the_device_tells_which_of_both_is_late(part, seconds):
    """The power follows magnitude and angle as they were; a device that errs otherwise gets no question."""
    whole = {"magnitude": MAGNITUDE, "angle": ANGLE}
    power = plant(MAGNITUDE * np.exp(1j * ANGLE))
    recording = recorded(**(whole | {part: late(whole[part], seconds)}), power=power)

    def asked(scale):
        def play(one, start):
            return SimpleNamespace(power=scale * plant(one.voltage))

        power = play(recording, None).power
        event = RecordedEvent(recording, WINDOWS, OperatingStart(1 + 0j, power[0]))
        comparison = SimpleNamespace(
            event=event,
            device=SimpleNamespace(play=play, trials=TrialLog()),
            played=SimpleNamespace(power=power),
            near_power=lambda near: power[round(near.recording.begin / INTERVAL) :][
                : len(near.recording.power)
            ],
        )
        return [one.figures for _, one in ask_of_voltage_clocks(comparison)]

    (figures,) = asked(1.0)
    assert figures["which"] == f"V's {part}"
    assert figures["delay"] == pytest.approx(seconds, abs=INTERVAL)
    assert figures["left"] < 0.1 * figures["error"]
    assert not asked(-1.0)
