"""One followed mode of a sweep, from Python."""

import numpy as np
import pytest

import orchestrator as gfor
from orchestrator.errors import InputError
from tests.sweep.sweep_case import two_oscillators

FULL_TURN = 2 * np.pi


def test_one_mode_over_scenarios_and_parameters(tmp_path):
    sweep = gfor.load(two_oscillators(tmp_path)).sweep({"a1.gain": [3.0, 6.0, 12.0]})
    first = sweep["first"]
    assert first.damping.dims == ("scenario", "a1.gain")
    assert list(first["scenario"].values) == ["one", "two"]
    wanted = np.sqrt(np.array([3.0, 6.0, 12.0]) * FULL_TURN) / FULL_TURN
    assert first.frequency.values == pytest.approx(np.array([wanted, wanted]), rel=1e-5)
    with pytest.raises(InputError, match="no mode was followed as 'third'; the followed modes: first, mode 2"):
        sweep["third"]
