"""How often a mode turns during a period, beside the angle of its multiplier."""

import numpy as np
import pytest

from orchestrator.linear.models.periodic import _turns


@pytest.mark.parametrize("looks", [5, 7, 40])
@pytest.mark.parametrize("turns", [-2.1, -1.1, 0.1, 1.2, 1.9, 2.1])
def test_a_rotation_turns_as_often_as_it_does(turns, looks):
    """Two turns in five looks are the last that can be told from three turns the other way."""

    def rotation(angle):
        return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])

    maps = np.array([rotation(2 * np.pi * turns * (k + 1) / looks) for k in range(looks)])
    multipliers, right = np.linalg.eig(maps[-1])
    left = np.linalg.inv(right).T
    exponents = np.log(multipliers)
    found = exponents.imag / (2 * np.pi) + _turns(right, left, exponents, maps)
    assert sorted(found) == pytest.approx(sorted([turns, -turns]))
