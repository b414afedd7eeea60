"""An angle against a bus of the same grid, which swings itself, is asked about; an angle against a clock is not."""

import numpy as np
import pytest

from tests.studies.validation.recordings import run, table, with_noise
from tests.studies.validation.test_planted import EMT, asked, of_frequency
from tests.support.late import LateLibrary

scipy_signal = LateLibrary("scipy.signal")
KIND = "angle reference"


@pytest.fixture(scope="module")
def good():
    return with_noise(table(run()))


def against(frame, bus):
    """The angle against another bus of the same run."""
    dataset = run()
    voltage = dataset[f"grid.{bus}.v_re"].values + 1j * dataset[f"grid.{bus}.v_im"].values
    return frame.assign(angle_deg=frame.angle_deg - np.rad2deg(np.unwrap(np.angle(voltage))))


def against_a_swing(frame, degrees=8.0):
    """From the event on."""
    since = np.clip(frame.time - 1, 0, None)
    swing = np.exp(-0.4 * since) * np.sin(2 * np.pi * 0.7 * since)
    return frame.assign(angle_deg=frame.angle_deg - degrees * swing)


def always_swinging(frame, degrees):
    swing = np.sin(2 * np.pi * 0.6 * frame.time)
    return frame.assign(angle_deg=frame.angle_deg - degrees * swing)


def with_frequency(frame, good, lag=0.0):
    """The plant's own frequency beside the angle, behind a filter [s]."""
    hertz = of_frequency(good).f_hz.to_numpy()
    if lag:
        part = 1e-3 / lag
        hertz = hertz[0] + scipy_signal.lfilter([part], [1, part - 1], hertz - hertz[0])
    return frame.assign(f_hz=hertz)


def kinds(questions):
    return [one["kind"] for one in questions]


def test_an_angle_against_another_bus_lacks_the_frequency_by_which_p_stays_off(good):
    (found,) = asked(against(good, "bus_3"))
    assert found["kind"] == KIND
    assert found["keeps_open"]
    assert found["figures"]["offset"] == pytest.approx(0.09, abs=0.01)


@pytest.mark.parametrize("degrees", [1, 4])
def test_a_bus_that_swings_before_the_event_is_asked_about(good, degrees):
    """Though the model falls out of step by it."""
    (found,) = asked(always_swinging(good, degrees), device=EMT)
    assert found["kind"] == KIND
    assert found["figures"]["seen"] < 0.01 * found["figures"]["asked"]


@pytest.mark.parametrize("lag", [0.0, 0.1])
def test_a_frequency_beside_the_angle_tells_it_and_stands_for_it_as_the_remedy_says(good, lag):
    spoilt = with_frequency(against_a_swing(good), good, lag)
    found, *others = asked(spoilt, device=EMT)
    assert kinds(others) == ["slips"]  # by which the model falls out of step
    assert found["kind"] == KIND
    assert found["figures"]["remedy"] == "f=f_hz"
    assert "--channel 'f=f_hz'" in found["text"]
    assert KIND not in kinds(asked(spoilt, device=EMT, channels=["f=f_hz"]))


@pytest.mark.parametrize("lag", [0.0, 0.1, 0.3])
def test_a_frequency_of_the_plants_own_angle_is_not_asked_about(good, lag):
    assert KIND not in kinds(asked(with_frequency(good, good, lag)))


@pytest.mark.parametrize("lag", [0.1, 0.3])
@pytest.mark.parametrize(("degrees", "lasts"), [(30, 0.25), (10, 9.0)])
def test_a_jump_that_a_filtered_frequency_follows_late_is_not_asked_about(
    good, lag, degrees, lasts
):
    jump = degrees * ((good.time > 1) & (good.time < 1 + lasts))
    jumped = good.assign(angle_deg=good.angle_deg + jump)
    assert KIND not in kinds(asked(with_frequency(jumped, jumped, lag)))


@pytest.mark.parametrize(
    "wrong",
    [
        {"droop.R_f": 0.02},
        {"transformer.X_t": 0.25},
        {"pod_p.K": 50},
        {"pod_p.enabled": False},
        {"droop.delta_P_ref": 0.01},
    ],
)
def test_a_wrong_model_beside_an_honest_angle_is_not_excused(good, wrong):
    assert KIND not in kinds(asked(good, values=wrong))
