"""A second event in one recording is found and named; a ring-down, whatever its modes, holds none."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from orchestrator.studies.validation.event import cut_event, prepare_event
from orchestrator.studies.validation.figures import compare_signals
from orchestrator.studies.validation.questions import QuestionKind
from orchestrator.studies.validation.record import PortBases, read_recording

LENGTH = 10.0  # of a recording [s]
FIRST = 1.5  # begin of its event [s]
LATER = 3.5  # after which a second one begins, beyond the window of the first [s]
REACTANCE = 0.4  # between the plant and a stiff bus [pu]
BASES = PortBases(100.0, 50.0)


def ring(times, begin, size, hertz=0.6, damping=0.08):
    """A damped swing of the angle [rad], which begins with a jump of its rate."""
    since = np.clip(times - begin, 0, None)
    turns = 2 * np.pi * hertz * since
    return size * np.exp(-damping * turns) * np.sin(turns)


def step(times, begin, size):
    return size * (times > begin)


def recorded(angle, magnitude, interval=0.02, noise=2e-5):
    """A plant whose P and Q follow from the angle [rad] and the magnitude [pu] of its bus behind a reactance."""
    times = np.arange(0.0, LENGTH, interval)
    random = np.random.default_rng(3)
    size, turned = magnitude(times), 0.1 + angle(times)
    v = size * np.exp(-1j * turned)
    power = v * np.conj((1 - v) / (1j * REACTANCE))
    scatter = noise * random.standard_normal((4, len(times)))
    columns = {
        "v_pu": size + scatter[0],
        "angle_deg": np.rad2deg(-turned + scatter[1]),
        "p_mw": 100 * (power.real + 10 * scatter[2]),
        "q_mvar": 100 * (power.imag + 10 * scatter[3]),
    }
    frame = pd.DataFrame(columns, pd.Index(times.round(6), name="time"))
    return prepare_event(read_recording(frame.to_xarray(), "made", BASES), BASES)


def alone(times, hertz=0.6, damping=0.08, size=0.05):
    return ring(times, FIRST, size, hertz, damping)


def dropped(times):
    return 1 - step(times, FIRST, 0.02)


def named(event):
    return [one.figures["at"] for one in event.questions if one.kind is QuestionKind.SECOND_EVENT]


AGAIN = FIRST + LATER
SECOND = {
    "a load is switched": (
        lambda t: alone(t) + ring(t, AGAIN, 0.05),
        lambda t: dropped(t) - step(t, AGAIN, 0.02),
    ),
    "a line closes again": (
        lambda t: alone(t) - ring(t, AGAIN, 0.04),
        lambda t: dropped(t) + step(t, AGAIN, 0.02),
    ),
    "a load ramps for 1 s": (
        lambda t: alone(t) + 0.1 * np.clip(t - AGAIN, 0, 1) + ring(t, AGAIN + 1, 0.06),
        lambda t: dropped(t) - 0.03 * np.clip(t - AGAIN, 0, 1),
    ),
    "a swing is driven": (
        lambda t: alone(t, damping=0.15) + (t > AGAIN) * 0.05 * np.sin(3.5 * (t - AGAIN)),
        lambda t: dropped(t) + (t > AGAIN) * 0.01 * np.sin(3.5 * (t - AGAIN)),
    ),
}


@pytest.mark.parametrize("interval", [1e-3, 0.02])
@pytest.mark.parametrize("name", SECOND)
def test_a_second_event_is_named_with_its_time(name, interval):
    event = recorded(*SECOND[name], interval=interval)
    (at,) = named(event)
    assert at == pytest.approx(AGAIN, abs=0.7)
    assert event.windows.parts["after"] == (event.windows.end, pytest.approx(at))
    assert event.windows.part("after", event.recording.times).sum() * interval == pytest.approx(
        at - event.windows.end, abs=2 * interval
    )


@pytest.mark.parametrize("noise", [2e-5, 2e-4])
@pytest.mark.parametrize("damping", [0.0, 0.02, 0.08, 0.2])
@pytest.mark.parametrize("hertz", [0.25, 0.4, 0.8, 1.3])
def test_a_ring_down_of_one_event_holds_no_second(hertz, damping, noise):
    assert named(recorded(lambda t: alone(t, hertz, damping), dropped, noise=noise)) == []


@pytest.mark.parametrize("other", [0.45, 0.9, 1.1])
def test_two_modes_that_beat_are_one_event(other):
    def both(times):
        return alone(times, 0.6, 0.05) + alone(times, other, 0.07, 0.04)

    assert named(recorded(both, dropped)) == []


def test_a_swing_that_grows_from_the_event_on_is_one_event():
    assert named(recorded(lambda t: alone(t, damping=-0.03, size=0.02), dropped)) == []


def test_a_mean_that_ends_with_the_recording_is_no_second_event():
    """The last one is taken over what was there, half of its time: an angle that drifts seems to jump."""

    def drifts(times):
        middle = np.where(times == times[-1], times - 0.01, times)
        return alone(middle, damping=0.2) - 0.6 * np.clip(middle - FIRST, 0, None)

    assert named(recorded(drifts, dropped)) == []


def test_a_frequency_that_settles_for_seconds_is_one_event():
    def settles(times):
        since = np.clip(times - FIRST, 0, None)
        return alone(times) + 0.02 * (since - 3 * (1 - np.exp(-since / 3)))

    assert named(recorded(settles, dropped)) == []


def damping_of(event):
    """Of the plant's ring-down in P [%]."""
    figures = compare_signals(event.recording, event.recording.power, event.windows)["p"]
    return figures.modes[0].damping_percent


def test_the_ring_down_is_that_before_the_second_event():
    event = recorded(*SECOND["a swing is driven"])
    assert damping_of(event) == pytest.approx(15, abs=1)
    whole = SimpleNamespace(recording=event.recording, windows=_blind(event.windows))
    assert abs(damping_of(whole) - 15) > 5


def _blind(windows):
    """The windows as if nothing came later."""
    return type(windows)(windows.begin, windows.end, windows.length, windows.first_end)


def test_a_part_before_the_second_event_holds_none():
    event = recorded(*SECOND["a load is switched"])
    second = event.windows.second - event.windows.begin
    assert cut_event(event, second - 1).windows.second is None
    later = cut_event(event, second + 1, before=0.7)
    assert later.windows.second - later.windows.begin == pytest.approx(second)
