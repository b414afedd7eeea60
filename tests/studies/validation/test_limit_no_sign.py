"""A limit that the model lacks is no sign of P or Q, and a wrong sign is asked about beside wrong values."""

import pytest

import orchestrator as gfor_in_python
from tests.studies.validation.recordings import run, table, with_noise

ON = {"pod_p.enabled": True}
LENGTH = 4.0  # of a recording [s]: three after the event


def readings(frame, **values):
    given = {name.replace("__", "."): value for name, value in values.items()}
    found = gfor_in_python.validate(
        "gfor", frame.set_index("time"), values=ON | given, step="500 us"
    )
    questions = found.as_json()["events"][0]["questions"]
    return [one["figures"]["reading"] for one in questions if one["kind"] == "read otherwise"]


@pytest.mark.parametrize(("limit", "scale"), [(0.93, 1.04), (0.93, 1.1), (0.96, 1.06)])
def test_a_plant_at_its_limit_beside_a_model_without_it_is_not_asked_for_a_sign(limit, scale):
    """With Q turned, three quarters of the model's error would go."""
    plant = run("pod_p", stop=LENGTH, scale=scale, gfor__voltage_control__i_q_max=limit)
    assert readings(with_noise(table(plant))) == []


@pytest.mark.slow
@pytest.mark.parametrize("every", [1, 20])
@pytest.mark.parametrize("length", [2.5, 3.0])
def test_a_plant_that_comes_to_its_limit_later_is_not_asked_for_a_sign(length, every):
    """In the first quarter of a second it does as the model: no turned sign makes that."""
    plant = run("pod_p", stop=LENGTH, scale=1.06, gfor__voltage_control__i_q_max=0.96)
    frame = with_noise(table(plant))
    assert readings(frame[frame.time <= length].iloc[::every]) == []


@pytest.mark.parametrize("every", [1, 20])
def test_a_wrong_sign_is_asked_about_beside_a_wrong_reactance(every):
    """Q is off at once by more than it moves, and in slow samples by what none of them holds."""
    good = with_noise(table(run("pod_p", stop=LENGTH)))
    turned = good.assign(p_mw=-good.p_mw, q_mvar=-good.q_mvar).iloc[::every]
    assert readings(turned, transformer__X_t=0.12) == ["P and Q count into the plant"]
    if every == 1:
        turned = good.assign(q_mvar=-good.q_mvar)
        assert readings(turned, transformer__X_t=0.12) == ["Q counts into the plant"]
