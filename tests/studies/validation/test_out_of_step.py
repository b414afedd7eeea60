"""A model that falls out of step where the plant did not: the loss is told, and no cause is read from what follows."""

import numpy as np
import pandas as pd
import pytest

import orchestrator as gfor_in_python
from orchestrator.studies.validation.hypotheses import _is_whole
from orchestrator.studies.validation.limits import EXAMPLE
from orchestrator.studies.validation.out_of_step import slip, step_loss
from orchestrator.studies.validation.record import Recording
from orchestrator.studies.validation.windows import Windows
from tests.studies.validation.recordings import SOLVER, table, with_noise

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
        "gfor", frame.set_index("time"), values=values, **{"step": STEP} | more
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
    best, *_ = validated(recorded, MODEL, explain=True, step="500 us").result.explanations
    assert best.name == "pod_p.K"
    assert best.value == pytest.approx(60, rel=0.05)


def test_a_model_without_the_plants_limit_makes_no_minutes_of_seconds():
    """It is off by two ratings at the end; a run at rest in 240 s leaves 0.3 pu, which explains nothing."""
    fault = {"time": 1.0, "component": "grid", "type": "bus_fault", "bus": "bus_2"}
    case = gfor_in_python.load("two_area").with_(
        events=[fault | {"X": 0.004, "duration": 0.1}],
        solver=SOLVER,
    )
    limited = {"gfor.current_limit.kind": 3, "gfor.current_limit.I_max": 1.002}
    frame = with_noise(table(case.scenario("pod_p", limited).run(stop=4.0).dataset))
    assert "time unit" not in kinds(validated(frame, {"pod_p.enabled": True}, step="500 us"))


@pytest.mark.parametrize(
    ("rate", "whole"), [(1000.0, True), (50.05, True), (16.67, False), (1 / 60, False)]
)
def test_a_recorder_takes_a_whole_number_of_samples_a_second(rate, whole):
    """50.05 a second: times in minutes with six decimals, 20 ms apart."""
    assert _is_whole(rate) is whole


def made(frame, values=PLANT):
    """P and Q of a device at a voltage, as of an instrument."""
    found = gfor_in_python.validate(
        "gfor", frame.set_index("time"), values=values, step=STEP, average=0
    )
    curves = found.curves()
    return with_noise(
        frame.assign(
            p_mw=1500 * curves.p_simulated.to_numpy(), q_mvar=1500 * curves.q_simulated.to_numpy()
        )
    )


def stiff(degrees, megawatt):
    """A stiff grid whose angle jumps: a plant without a limit of its speed may not follow."""
    angle = degrees * (TIMES >= 1)
    empty = {"v_pu": 1.0, "angle_deg": angle + 0.0, "p_mw": megawatt, "q_mvar": 0.0}
    return pd.DataFrame({"time": TIMES} | empty)


NO_RESISTANCE = {"current_limit.kind": 3}
"""A limit of another kind, beside which the model turns away from the plant."""


@pytest.mark.parametrize(("degrees", "megawatt"), [(-40, 1350.0), (-60, 750.0)])
def test_a_model_that_turns_past_its_plant_is_told_though_it_is_off_by_little(degrees, megawatt):
    """Its current turns by half a turn and more, and no mean power stays far off up to the end."""
    recorded = made(stiff(degrees, megawatt))
    found = validated(recorded, PLANT | NO_RESISTANCE, limits=EXAMPLE)
    (asked,) = [one for one in found.as_json()["events"][0]["questions"] if one["kind"] == "slips"]
    assert asked["keeps_open"] is False
    assert 1.0 < asked["figures"]["at"] < 1.5
    assert "out of step" not in kinds(found)
    assert found.verdict == "not met"
    assert "slips" not in kinds(validated(recorded, PLANT))


def recording_of(power):
    """A recording of a power [pu] at the rated voltage."""
    everywhere = np.ones(len(TIMES), dtype=bool)
    return Recording(
        label="rec",
        begin=0.0,
        interval=1e-3,
        voltage=everywhere.astype(complex),
        power=power,
        good=everywhere,
        driven=everywhere,
        frame_hz=50.0,
        instantaneous=False,
        average=0.02,
        channels={},
    )


FROM_1_S = Windows(begin=1.0, end=1.1, length=float(TIMES[-1]))


@pytest.mark.parametrize(("off", "lost"), [(0.1, True), (0.15, False)])
def test_a_model_is_in_step_while_it_is_off_by_two_fifths_of_the_plants_movement(off, lost):
    """The plant moves by 0.3 pu; the model is off by so much from 1 s on, and by 1.6 pu from 3 s on."""
    plant = np.where(TIMES < 1, 0.5, 0.8) + 0j
    model = plant + np.where(TIMES < 1, 0.0, np.where(TIMES < 3, off, 1.6))
    found = step_loss(recording_of(plant), FROM_1_S, model)
    assert (found is not None) is lost
    if found is not None:
        assert found.time == pytest.approx(3.0, abs=0.1)
        assert (found.own, found.seen) == pytest.approx((2.4, 0.8))


def slipped(angle, seen=0.5, own=0.5):
    """The moment of a slip; currents [pu], and the angle between them from 1 s on [turns]."""
    size = np.where(TIMES < 1, seen, own)
    recording = recording_of(np.full(len(TIMES), seen + 0j))
    return slip(recording, FROM_1_S, size * np.exp(2j * np.pi * angle))


def test_a_slip_begins_where_the_model_leaves_the_plant():
    moment = slipped(np.clip(TIMES - 2, 0, None))  # a quarter of a turn at 2.25 s
    assert moment == pytest.approx(2.25, abs=0.03)


@pytest.mark.parametrize(
    "angle",
    [
        0.45 * np.sin(2 * np.pi * np.clip(TIMES - 1, 0, None)),  # back and forth
        0.5 * np.ones(len(TIMES)),  # a wrong sign from the begin on
        0.5 * np.clip((TIMES - 1) / 0.2, 0, 1),  # feeds the other way
    ],
)
def test_a_model_that_swings_or_has_another_sign_does_not_slip(angle):
    assert slipped(angle) is None


def test_the_angle_of_no_current_tells_no_slip():
    assert slipped(np.clip(TIMES - 2, 0, None), own=0.05) is None


def test_a_model_that_turns_past_its_plant_beside_slow_samples_leaves_the_verdict_open():
    """The right model may fall so there, for the voltage between the samples is not known."""
    recorded = made(stiff(-40, 1350.0)).iloc[::5]
    found = validated(recorded, PLANT | NO_RESISTANCE, limits=EXAMPLE)
    assert "slips" not in kinds(found)
    assert "out of step" in kinds(found)
    assert found.verdict == "open"
