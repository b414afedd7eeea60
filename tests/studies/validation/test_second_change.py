"""The window during an event holds a second, slower change; a swing that follows an event is none."""

import numpy as np
import pytest

from tests.studies.validation.test_early_event import windows

BEGIN = 3.0  # of the event [s]
LENGTH = 12.0  # of the recording [s]
SHORTEST = 0.1  # that a window lasts after a change [s]


def ramp(since, later, lasts):
    return np.clip((since - later) / lasts, 0, 1)


SECOND = {
    "the voltage comes back": lambda part, lasts: 0.02 * part,
    "the voltage sinks further": lambda part, lasts: -0.03 * part,
    "the frequency falls for a while": lambda part, lasts: -1j * np.pi * lasts * part,
}


def after_a_step(second, later, lasts, hertz=0.5, swing=0.03):
    """A voltage that steps by 2 %, swings, and changes a second time."""

    def voltage(times):
        since = np.clip(times - BEGIN, 0, None)
        wave = swing * np.exp(-0.3 * since) * np.sin(2 * np.pi * hertz * since)
        changed = second(ramp(since, later, lasts), lasts)
        return np.exp(-(0.02 + 0.02j) * (times > BEGIN) - 1j * wave + changed)

    return voltage


@pytest.mark.parametrize("interval", [1e-3, 0.02])
@pytest.mark.parametrize(("later", "lasts"), [(0.6, 0.3), (1.2, 0.6), (2.0, 0.9)])
@pytest.mark.parametrize("name", SECOND)
def test_the_window_ends_with_the_second_change(name, later, lasts, interval):
    found = windows(after_a_step(SECOND[name], later, lasts), interval, length=LENGTH)
    assert found.begin == pytest.approx(BEGIN, abs=1.1 * interval)
    ended = BEGIN + later + lasts
    assert ended <= found.end < ended + 2 * SHORTEST


@pytest.mark.parametrize("interval", [1e-3, 0.02])
@pytest.mark.parametrize("damping", [0.02, 0.1, 0.3])
@pytest.mark.parametrize("hertz", [0.3, 0.6, 1.2, 2.5])
def test_a_swing_after_a_step_is_no_second_change(hertz, damping, interval):
    def voltage(times):
        since = np.clip(times - BEGIN, 0, None)
        turns = 2 * np.pi * hertz * since
        wave = np.exp(-damping * turns) * np.sin(turns)
        return np.exp(-0.02 * (times > BEGIN) - (0.01 + 0.08j) * wave)

    quiet = windows(voltage, interval, length=LENGTH)
    assert quiet.end - quiet.begin <= 1.0 + SHORTEST


def test_a_voltage_that_sinks_for_two_seconds_is_within_the_window():
    def voltage(times):
        return 1 - 0.02 * ramp(times - BEGIN, 0, 2.0) + 0j

    found = windows(voltage, length=LENGTH)
    assert BEGIN + 2.0 <= found.end < BEGIN + 2.0 + 2 * SHORTEST
