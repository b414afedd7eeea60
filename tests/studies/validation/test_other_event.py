"""P and Q that have nothing to do with the voltage beside them, and P that somebody moves while the angle drifts."""

import numpy as np
import pytest

import orchestrator as gfor_in_python
from tests.studies.validation.recordings import NOISE, run, table, with_noise

ON = {"pod_p.enabled": True}
MODEL, STEP = "gfor_phasor", "1 ms"


@pytest.fixture(scope="module")
def good():
    return with_noise(table(run()))


def asked(frame, values=None):
    given = ON | (values or {})
    found = gfor_in_python.validate(MODEL, frame.set_index("time"), values=given, step=STEP)
    return found.as_json()["events"][0]["questions"]


def held_open(frame, values=None):
    return [one for one in asked(frame, values) if one["keeps_open"]]


def quiet(frame):
    """The voltage of a grid in which nothing happens."""
    random = np.random.default_rng(5)
    before = frame[frame.time < 0.95]
    turns = np.polyval(np.polyfit(before.time, before.angle_deg, 1), frame.time)
    noise = {name: NOISE[name] * random.standard_normal(len(frame)) for name in NOISE}
    return frame.assign(
        v_pu=before.v_pu.mean() + noise["v_pu"], angle_deg=turns + noise["angle_deg"]
    )


def of_seconds_later(frame, seconds):
    """P and Q as of another event, with the noise of before it in the seconds that are new."""
    count = round(seconds / 1e-3)
    before = frame[["p_mw", "q_mvar"]].iloc[:900]
    filling = before.iloc[np.arange(count) % 900]
    moved = np.concatenate([filling, frame[["p_mw", "q_mvar"]]])[: len(frame)]
    return frame.assign(p_mw=moved[:, 0], q_mvar=moved[:, 1])


@pytest.mark.parametrize("every", [1, 20])
def test_power_that_moves_beside_a_quiet_voltage_is_asked_about(good, every):
    (question,) = held_open(quiet(good).iloc[::every])
    assert question["kind"] == "another event"
    assert question["figures"]["at"] == pytest.approx(1.0, abs=0.06)
    assert "voltage_at" not in question["figures"]


@pytest.mark.parametrize("seconds", [0.6, 1.5, 3.0])
def test_power_that_moves_at_another_time_than_the_voltage_is_asked_about(good, seconds):
    (question,) = held_open(of_seconds_later(good, seconds))
    assert question["kind"] == "another event"
    assert question["figures"]["voltage_at"] == pytest.approx(1.0, abs=0.03)
    assert question["figures"]["at"] == pytest.approx(1.0 + seconds, abs=0.06)
    assert f"do the clocks differ by {seconds:g}" in question["text"]


def test_a_plant_that_does_nothing_in_a_quiet_grid_is_not_asked_about_another_event(good):
    still = quiet(good).assign(
        p_mw=good.p_mw.iloc[:900].mean(), q_mvar=good.q_mvar.iloc[:900].mean()
    )
    assert "another event" not in [one["kind"] for one in asked(still)]


def test_a_dead_plant_is_no_other_event(good):
    """P and Q that do nothing at all are an error of the model, or of the meter, and no other event's."""
    random = np.random.default_rng(2)
    dead = {
        name: good[name].iloc[:900].mean() + NOISE[name] * random.standard_normal(len(good))
        for name in ("p_mw", "q_mvar")
    }
    assert "another event" not in [one["kind"] for one in asked(good.assign(**dead))]


def drifting(frame, values):
    """A right recording of a plant in a grid whose angle drifts from 2 s on: the device itself makes P and Q."""
    turned = frame.angle_deg + 360 * 0.02 * np.clip(frame.time - 2, 0, None)
    given = frame.assign(angle_deg=turned).set_index("time")
    made = gfor_in_python.validate(MODEL, given, values=values, step=STEP, average=0).curves()
    made.index = frame.index
    clean = frame.assign(
        angle_deg=turned, p_mw=1500 * made.p_simulated, q_mvar=1500 * made.q_simulated
    )
    return with_noise(clean, 7, v_pu=0.0, angle_deg=0.0)


@pytest.fixture(scope="module")
def drifted(good):
    return drifting(good, ON)


@pytest.mark.parametrize("sign", [1, -1])
def test_a_ramp_to_the_end_with_a_drifting_angle_is_asked_about(drifted, sign):
    """0.04 pu from 2 s on: the angle drifts along the same line, and might explain it to somebody in a hurry."""
    ramp = sign * 60 * np.clip((drifted.time - 2) / 4, 0, 1)
    (question,) = held_open(drifted.assign(p_mw=drifted.p_mw + ramp))
    assert question["kind"] == "setpoint"
    assert question["figures"]["offset"] == pytest.approx(sign * 0.04, rel=0.1)
    assert question["figures"]["at"] == pytest.approx(2.0, abs=0.2)
    assert question["figures"]["until"] == pytest.approx(6.0, abs=0.2)


@pytest.mark.parametrize("wrong", [{}, {"droop.R_f": 0.02}, {"transformer.X_t": 0.25}])
def test_a_drifting_angle_beside_a_right_or_a_wrong_model_is_no_setpoint(drifted, wrong):
    assert not {"setpoint", "another event"} & {one["kind"] for one in asked(drifted, wrong)}
