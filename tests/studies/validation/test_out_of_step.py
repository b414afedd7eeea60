"""A model that falls out of step where the plant did not: the loss is told, and no cause is read from what follows."""

import numpy as np
import pandas as pd
import pytest

import orchestrator as gfor_in_python
from orchestrator.studies.validation.hypotheses import _is_whole
from tests.studies.validation.recordings import table, with_noise

STEP = "200 us"
PLANT = {"pod_p.enabled": True, "pod_p.K": 60.0}
MODEL = {"pod_p.enabled": True, "pod_p.K": 200.0}
TIMES = np.arange(0, 4, 1e-3)
AFTER = np.clip(TIMES - 1, 0, None)


def swing(degrees=45.0):
    """A stiff grid whose angle swings: the plant comes near its limit of the current, and back."""
    angle = 5.7 + degrees * np.sin(2 * np.pi * 0.35 * AFTER) * np.exp(-AFTER / 2)
    empty = {"v_pu": 1.0, "angle_deg": angle, "p_mw": 1350.0, "q_mvar": 0.0}
    return pd.DataFrame({"time": TIMES} | empty)


@pytest.fixture(scope="module")
def recorded():
    """Recording of the plant, whose P and Q are those of a device with its gain."""
    frame = swing()
    found = gfor_in_python.validate("gfor", frame.set_index("time"), values=PLANT, step=STEP)
    curves = found.curves()
    power = {
        f"{c}_{u}": 1500 * curves[f"{c}_simulated"].to_numpy()
        for c, u in (("p", "mw"), ("q", "mvar"))
    }
    return with_noise(frame.assign(**power))


def validated(frame, values, **more):
    return gfor_in_python.validate(
        "gfor", frame.set_index("time"), values=values, step=STEP, **more
    )


def kinds(found):
    return [one["kind"] for one in found.as_json()["events"][0]["questions"]]


def test_a_loss_of_step_is_told_and_no_magnitude_or_setpoint_is_suspected(recorded):
    asked = kinds(validated(recorded, MODEL))
    assert "out of step" in asked
    assert not {"magnitude", "setpoint", "read otherwise"} & set(asked)


def test_the_plants_own_values_stay_in_step(recorded):
    assert "out of step" not in kinds(validated(recorded, PLANT))


def test_the_gain_that_makes_a_model_fall_is_named_with_the_plants(recorded):
    best, *_ = validated(recorded, MODEL, explain=True).result.explanations
    assert best.name == "pod_p.K"
    assert best.value == pytest.approx(60, rel=0.05)


def test_a_model_without_the_plants_limit_makes_no_minutes_of_seconds():
    """It is off by two ratings at the end; a run at rest in 240 s leaves 0.3 pu, which explains nothing."""
    fault = {"time": 1.0, "component": "grid", "type": "bus_fault", "bus": "bus_2"}
    case = gfor_in_python.load("two_area").with_(
        events=[fault | {"X": 0.004, "duration": 0.1}],
        solver={"record_interval": "1 ms", "record_filter": "low-pass"},
    )
    limited = {"gfor.current_limit.kind": 3, "gfor.current_limit.I_max": 1.002}
    frame = with_noise(table(case.scenario("pod_p", limited).run(stop=4.0).dataset))
    assert "time unit" not in kinds(validated(frame, {"pod_p.enabled": True}))


@pytest.mark.parametrize(
    ("rate", "whole"), [(1000.0, True), (50.05, True), (16.67, False), (1 / 60, False)]
)
def test_a_recorder_takes_a_whole_number_of_samples_a_second(rate, whole):
    """50.05 a second: times in minutes with six decimals, 20 ms apart."""
    assert _is_whole(rate) is whole
