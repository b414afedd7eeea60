"""A model that falls out of step where the plant did not: the loss is told, and no cause is read from what follows."""

import numpy as np
import pandas as pd
import pytest

import orchestrator as gfor_in_python
from tests.studies.validation.recordings import with_noise

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
