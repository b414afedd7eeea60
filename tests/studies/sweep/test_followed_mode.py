"""One followed mode of a sweep, from Python."""

import json

import numpy as np
import pytest

import orchestrator
from orchestrator.core.errors import InputError
from tests.studies.sweep.sweep_case import two_oscillators

FULL_TURN = 2 * np.pi


def test_one_mode_over_scenarios_and_parameters(tmp_path):
    sweep = orchestrator.load(two_oscillators(tmp_path)).sweep({"a1.gain": [3.0, 6.0, 12.0]})
    first = sweep["first"]
    assert first.damping.dims == ("scenario", "a1.gain")
    assert list(first["scenario"].values) == ["one", "two"]
    wanted = np.sqrt(np.array([3.0, 6.0, 12.0]) * FULL_TURN) / FULL_TURN
    assert first.frequency.values == pytest.approx(np.array([wanted, wanted]), rel=1e-5)
    with pytest.raises(
        InputError, match="no mode was followed as 'third'; the followed modes: first, mode 2"
    ):
        sweep["third"]


@pytest.mark.slow
def test_a_sweep_over_a_crossing_keeps_the_name_on_the_mode_that_it_was(gfor, tmp_path):
    """Another mode has the same shape nearly at K = 200, and is damped less at K = 150."""
    folder = tmp_path / "sweep"
    code, out, _ = gfor(
        "sweep",
        "two_area",
        "--scenario",
        "pod_p",
        "--vary",
        "gfor.pod_p.K=150,200,250",
        "--set",
        "grid.X_L=0.3",
        "--workers",
        "1",
        "--json",
        "--out",
        folder,
    )
    assert code == 0
    (first,) = [
        t
        for t in json.loads(out)["scenarios"][0]["trajectories"]
        if t["name"] == "electromechanical"
    ]
    found = [
        (round(p["frequency_hz"], 3), round(p["damping_percent"], 2), p["named"])
        for p in first["points"]
    ]
    assert found == [(0.668, 34.59, True), (0.726, 30.79, True), (0.768, 27.60, True)]
