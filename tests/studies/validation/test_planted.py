"""What would make a validation wrong in silence, each planted in a good recording and asked about."""

import numpy as np
import pytest

import orchestrator as gfor_in_python
from tests.studies.validation.recordings import run, table, with_noise

ON = {"pod_p.enabled": True}


@pytest.fixture(scope="module")
def good():
    return with_noise(table(run()))


def asked(frame, **more):
    found = gfor_in_python.validate("gfor", frame.set_index("time"), values=ON, **more).as_json()
    return found["events"][0]["questions"]


def late(frame, seconds=0.03):
    shifted = {c: np.interp(frame.time - seconds, frame.time, frame[c]) for c in ("p_mw", "q_mvar")}
    return frame.assign(**shifted)


def held(frame, samples=10):
    first = np.arange(len(frame)) // samples * samples
    return frame.assign(angle_deg=frame.angle_deg.to_numpy()[first])


PLANTED = {
    "P counts into the plant": (lambda f: f.assign(p_mw=-f.p_mw), "read otherwise"),
    "Q counts into the plant": (lambda f: f.assign(q_mvar=-f.q_mvar), "read otherwise"),
    "P and Q are of one phase": (
        lambda f: f.assign(p_mw=f.p_mw / 3, q_mvar=f.q_mvar / 3),
        "read otherwise",
    ),
    "the angle is in radians": (
        lambda f: f.assign(angle_deg=np.deg2rad(f.angle_deg)),
        "read otherwise",
    ),
    "the angle has the other sign": (
        lambda f: f.assign(angle_deg=-f.angle_deg),
        "read otherwise",
    ),
    "60 Hz": (lambda f: f.assign(angle_deg=f.angle_deg + 3600 * f.time), "rated frequency"),
    "clocks": (late, "clocks"),
    "held": (held, "angle held"),
    "setpoint": (lambda f: f.assign(p_mw=f.p_mw + 100 * (f.time > 2)), "setpoint"),
}


@pytest.mark.parametrize("name", PLANTED)
def test_a_planted_mistake_is_asked_about(good, name):
    spoil, kind = PLANTED[name]
    questions = asked(spoil(good))
    (found,) = [one for one in questions if one["kind"] == kind]
    assert found["keeps_open"]
    assert found["figures"].get("reading", name) == name


def test_a_good_recording_is_not_asked_about(good):
    assert asked(good) == []


def test_the_remedy_that_is_printed_works_when_it_is_given(good):
    turned = good.assign(p_mw=-good.p_mw)
    (question,) = asked(turned)
    (remedy,) = question["figures"]["remedy"]
    assert remedy == "p=-p_mw"
    assert asked(turned, channels=[remedy]) == []


def test_a_voltage_to_ground_is_named_though_the_device_does_not_start(good):
    with pytest.raises(gfor_in_python.CosimError, match=r"measured to ground.*1.732"):
        asked(good.assign(v_pu=good.v_pu / np.sqrt(3)))


def test_an_angle_that_is_wrapped_is_the_same(good):
    wrapped = good.assign(angle_deg=(good.angle_deg + 350) % 360 - 180)
    assert asked(wrapped) == []
