"""A phasor model without its limit of the current says where the plant's would act."""

import numpy as np
import pandas as pd
import pytest

import orchestrator as gfor_in_python
from orchestrator.studies.validation.over_limit import over_limit

STEP = 1e-3  # [s]


def dipped(depth):
    """A plant that keeps its power through a dip of 0.2 s, as far as its recorder shows."""
    time = np.arange(0, 2, STEP)
    dip = (time >= 1) & (time < 1.2)
    noise = 1e-4 * np.random.default_rng(2).standard_normal((4, len(time)))
    columns = {
        "v_pu": 1 - depth * dip + noise[0],
        "angle_deg": noise[1],
        "p_mw": 750 + 1500 * noise[2],
        "q_mvar": 1500 * noise[3],
    }
    return pd.DataFrame(columns, index=pd.Index(time, name="time"))


@pytest.mark.parametrize("depth", [0.03, 0.6])
def test_a_model_is_asked_about_a_current_above_the_limit_that_it_lacks(depth):
    found = gfor_in_python.validate("gfor_phasor", dipped(depth), step="1 ms").as_json()
    asked = {one["kind"]: one for one in found["events"][0]["questions"]}
    assert ("above a limit" in asked) == (depth > 0.5)
    if depth > 0.5:
        question = asked["above a limit"]
        assert question["figures"]["at"] == pytest.approx(1.0, abs=0.01)
        assert 0.19 < question["figures"]["length"] < 0.3  # its angle has moved, and comes back
        assert question["figures"]["largest"] > 1.5
        assert "--beside" in question["text"]


def test_a_short_peak_and_a_constant_are_no_current_above_its_limit():
    parts = np.full(100, 0.8)
    assert over_limit(1.2 + 0 * parts, STEP) is None
    parts[50:60] = 1.4
    assert over_limit(parts, STEP) is None
    parts[50:75] = 1.4
    found = over_limit(parts, STEP)
    assert (found.begin, found.length, found.largest) == pytest.approx((0.051, 0.025, 1.4))
