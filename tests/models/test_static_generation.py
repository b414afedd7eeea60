"""Static generation against its equations by hand, and that it neither holds an angle nor damps."""

from cmath import exp

import numpy as np
import pytest

from fmus.toolchain.catalogue import build_model
from tests.support.evaluated import Evaluated

VALUES = {"S_n": 600.0, "P_0": 0.8, "Q_0": -0.1, "v_0": 1.02, "theta_0": 0.4, "f_0": 10.0}
START = 1.02 * exp(0.4j)
OMEGA_0 = 20 * np.pi


def test_the_equations_written_by_hand():
    device = Evaluated(build_model("static_generation"), VALUES)
    i_0 = (complex(0.8, -0.1) / START).conjugate()
    i, r, v = 0.5 - 0.2j, 0.1 + 0.3j, 0.9 * exp(0.7j)
    wanted = i_0 * exp(0.3j)
    states = {"i_x": i.real, "i_y": i.imag, "turning_x": r.real, "turning_y": r.imag}
    found = device.rates([v.real, v.imag], device.vector(states))
    assert complex(found["i_x"], found["i_y"]) == pytest.approx(
        2 * OMEGA_0 * (wanted - i) + OMEGA_0 * r, rel=1e-12
    )
    assert complex(found["turning_x"], found["turning_y"]) == pytest.approx(
        OMEGA_0 * (wanted - i), rel=1e-12
    )
    assert max(map(abs, device.rates([START.real, START.imag]).values())) < 1e-12


def answer(s):
    """Of the current [pu, 100 MVA] along and across the bus voltage to the voltage along and across it [pu]."""
    device = Evaluated(build_model("static_generation"), VALUES | {"theta_0": 0.0, "Q_0": 0.0})
    A, B, C, D = device.blocks([1.02, 0.0])
    names = [output.name for output in build_model("static_generation").outputs]
    rows = [names.index(name) for name in ("i_re", "i_im")]
    return (C @ np.linalg.solve(s * np.eye(len(A)) - A, B) + D)[rows]


def test_a_turn_of_the_grid_turns_the_current_with_it_and_a_magnitude_moves_nothing():
    conductance = 0.8 * 6 / 1.02**2
    assert answer(1e-9j) == pytest.approx(np.array([[0, 0], [0, conductance]]), abs=1e-6)


def test_it_follows_swings_without_a_lag_and_stands_still_above_its_natural_frequency():
    """A lag of the current behind the voltage's angle would damp swings: at 1 Hz its angle is below 0.15°."""
    slow = answer(2j * np.pi)[1, 1]
    assert abs(np.degrees(np.angle(slow))) < 0.15
    assert abs(answer(2j * np.pi * 500)[1, 1]) < 0.05 * abs(answer(1e-9j)[1, 1])
