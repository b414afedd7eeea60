"""An event within the first tenth of a recording is found if the time before it is steady and long enough."""

import numpy as np
import pandas as pd
import pytest

from orchestrator.studies.validation.record import PortBases, read_recording
from orchestrator.studies.validation.windows import find_windows
from tests.support.late import LateLibrary

scipy_signal = LateLibrary("scipy.signal")
LENGTH = 6.0  # [s]


def windows(voltage, interval=1e-3, power=60.0, noise=2e-5, length=LENGTH):
    """Of a recording whose complex voltage [pu] is a function of time [s]."""
    times = np.arange(0.0, length, interval)
    random = np.random.default_rng(1)
    v = voltage(times) * (1 + noise * random.standard_normal(len(times)))
    columns = {
        "v_pu": np.abs(v),
        "angle_deg": np.rad2deg(np.unwrap(np.angle(v))),
        "p_mw": power + 0 * times,
        "q_mvar": 0.0,
    }
    frame = pd.DataFrame(columns, pd.Index(times.round(6), name="time"))
    return find_windows(read_recording(frame.to_xarray(), "made", PortBases(100.0, 50.0)))


def dip(at, hertz=0.0):
    def voltage(times):
        deep = (times >= at - 1e-9) & (times < at + 0.2)
        return (1 - 0.3 * deep) * np.exp(2j * np.pi * hertz * times)

    return voltage


@pytest.mark.parametrize("hertz", [0.0, 0.08])
@pytest.mark.parametrize("interval", [1e-3, 0.02])
@pytest.mark.parametrize("at", [0.3, 0.4, 0.5, 0.58])
def test_a_dip_there_is_found_with_its_begin_and_end(at, interval, hertz):
    found = windows(dip(at, hertz), interval)
    assert found.seen
    assert found.begin == pytest.approx(at, abs=1.1 * interval)
    assert found.end == pytest.approx(at + 0.2, abs=1.1 * interval)


def test_a_step_of_the_power_alone_is_found_as_well():
    def stepped(times):
        return np.ones(len(times), complex)

    times = np.arange(0.0, LENGTH, 1e-3)
    found = windows(stepped, power=60.0 + 5.0 * (times >= 0.5 - 1e-9))
    assert found.seen
    assert found.begin == pytest.approx(0.5, abs=0.025)  # powers are means over a period


def test_an_event_without_a_steady_time_before_it_is_none():
    assert not windows(dip(0.1)).seen


@pytest.mark.parametrize("hertz", [0.1, 0.2, 0.5, 1.0, 2.0])
@pytest.mark.parametrize("phase", [0.0, 0.8, 1.5708, 2.4])
def test_a_swing_has_no_early_event_wherever_it_begins(hertz, phase):
    def swing(times):
        wave = np.sin(2 * np.pi * hertz * times + phase)
        return (1 + 0.03 * wave) * np.exp(0.2j * wave)

    found = windows(swing)
    assert not found.seen or found.begin > 0.1 * LENGTH - 0.05


def switched(at, jump, swing):
    """A load is switched: the magnitude jumps, and the angle begins to swing."""

    def voltage(times):
        since = np.clip(times - at, 0, None)
        angle = swing * (1 - np.cos(2 * np.pi * 0.5 * since))
        return (1 - jump * (since > 1e-9)) * np.exp(-1j * angle)

    return voltage


@pytest.mark.parametrize("interval", [1e-3, 5e-3, 0.02])
@pytest.mark.parametrize("jump", [0.0008, 0.0015, 0.005])
def test_a_small_jump_is_the_event_and_not_the_faster_swing_after_it(jump, interval):
    """The swing's angle moves by up to 0.0025 pu in a period, more than most of these jumps."""
    found = windows(switched(1.5, jump, 0.04), interval)
    assert found.begin == pytest.approx(1.5, abs=1.1 * interval)


def test_a_load_that_is_switched_before_a_fault_is_not_the_event():
    def voltage(times):
        return (1 - 0.001 * (times >= 1.5)) * dip(3.0)(times)

    found = windows(voltage)
    assert found.begin == pytest.approx(3.0, abs=2e-3)


@pytest.mark.parametrize("interval", [1e-3, 0.02])
@pytest.mark.parametrize("before", [0, 1, 2])
def test_a_change_in_the_last_samples_is_no_event(before, interval):
    """Nothing is left of it to judge."""
    last = interval * (round(LENGTH / interval) - 1 - before)
    found = windows(lambda times: 1 - 0.1 * (times >= last - 1e-9) + 0j, interval)
    assert found.begin < found.end


def test_noise_alone_has_no_event():
    assert not windows(lambda times: np.ones(len(times), complex), noise=3e-3).seen


SLOW = {
    "a voltage that sinks by 2 % in 2 s": lambda since: 1 - 0.01 * np.clip(since, 0, 2),
    "a voltage that sinks towards 0.99": lambda since: 1 - 0.01 * (1 - np.exp(-since)),
    "a frequency that falls by 50 mHz a second": lambda since: np.exp(
        -1j * np.pi * 0.05 * np.clip(since, 0, 4) ** 2
    ),
    "a swing of 0.5 Hz": lambda since: np.exp(-0.05j * (1 - np.cos(np.pi * since))),
    "a step of 0.08 % with a slow swing": lambda since: (
        (1 - 0.0008 * (since > 0)) * np.exp(-0.035j * (1 - np.cos(0.6 * np.pi * since)))
    ),
}


@pytest.mark.parametrize("noise", [2e-5, 2e-4])
@pytest.mark.parametrize("interval", [1e-3, 0.02])
@pytest.mark.parametrize("name", SLOW)
def test_a_slow_or_small_event_is_found_where_it_begins(name, interval, noise):
    """A load step far away moves the voltage by little at first."""
    begin = 3.0

    def voltage(times):
        return SLOW[name](np.clip(times - begin, 0, None)) * np.ones(len(times), complex)

    found = windows(voltage, interval, noise=noise, length=12.0)
    assert found.seen
    assert found.begin == pytest.approx(begin, abs=0.1 if noise > 1e-4 else 0.05)


def wandering(times, seed, hertz=0.005, corner=0.2):
    """An angle [rad] whose frequency scatters as the loads of a grid make it, slower than a corner [Hz]."""
    interval = times[1] - times[0]
    kept = np.exp(-2 * np.pi * corner * interval)
    pushes = hertz * np.sqrt(1 - kept**2) * np.random.default_rng(seed).standard_normal(len(times))
    frequency = scipy_signal.lfilter([1.0], [1.0, -kept], pushes)
    return 2 * np.pi * np.cumsum(frequency) * interval


@pytest.mark.parametrize("hertz", [0.005, 0.02])
@pytest.mark.parametrize("interval", [1e-3, 0.02])
@pytest.mark.parametrize("seed", range(6))
def test_a_dip_begins_where_it_does_though_the_angle_wanders(seed, interval, hertz):
    """The angle is nowhere before the dip where it was on average."""

    def voltage(times):
        deep = (times >= 3.0 - 1e-9) & (times < 3.15)
        return (1 - 0.1 * deep) * np.exp(1j * wandering(times, seed, hertz))

    found = windows(voltage, interval, length=12.0)
    assert found.seen
    assert found.begin == pytest.approx(3.0, abs=1.1 * interval)


@pytest.mark.parametrize("interval", [1e-3, 0.02])
@pytest.mark.parametrize("seed", range(6))
def test_a_small_step_is_the_event_though_the_angle_wanders_by_as_much_in_a_period(seed, interval):
    """The frequency wanders by 20 mHz with a correlation of 2 s, as that of a grid without an event."""

    def voltage(times):
        angle = wandering(times, seed, hertz=0.02, corner=0.08)
        return (1 - 0.006 * (times >= 5.0 - 1e-9)) * np.exp(1j * angle)

    found = windows(voltage, interval, length=12.0)
    assert found.seen
    assert found.begin == pytest.approx(5.0, abs=1.1 * interval)
