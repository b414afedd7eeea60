"""The drift of the common speed, by two machines whose eigenvalues are known: one is told, another growth is not."""

import numpy as np
import pytest

from orchestrator.linear.doubts.common_speed import is_common_speed, tell_common_speed
from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.linear.spectra.stability import judge

SPEEDS = ("sg1.omega", "sg2.omega")
INERTIA = 5.0
"""H of both machines [s]."""


def two_machines(synchronising, falling, apart=0.0):
    """2H·dω_i/dt = −K·(δ_i − δ_j) + d·ω_i + c·(ω_i − ω_j), where c is ``apart``."""
    omega_b, a = 2 * np.pi * 50, 1 / (2 * INERTIA)
    K, d, c = synchronising * a, falling * a, apart * a
    A = np.array(
        [
            [0, omega_b, 0, 0],
            [-K, d + c, K, -c],
            [0, 0, 0, omega_b],
            [K, -c, -K, d + c],
        ]
    )
    names = ("sg1.delta", SPEEDS[0], "sg2.delta", SPEEDS[1])
    return LinearModel.from_matrix(A, names, None)


def test_a_torque_that_falls_with_speed_is_told_as_the_common_speed():
    """Its eigenvalue is d/(2H)."""
    verdict = judge(two_machines(synchronising=1.0, falling=0.4))
    assert verdict.mode.eigenvalue == pytest.approx(0.04, rel=1e-6)
    (told,) = tell_common_speed(verdict, SPEEDS)
    assert "+0.04 1/s is the common speed" in told


def test_machines_that_lose_each_other_are_not_told_so():
    """A negative synchronising torque: δ_1 − δ_2 grows at √(2K·ω_b/2H) at any speed, here slowly."""
    verdict = judge(two_machines(synchronising=-0.001, falling=0.0))
    rate = np.sqrt(2 * 0.001 * 2 * np.pi * 50 / (2 * INERTIA))
    assert verdict.mode.eigenvalue == pytest.approx(rate, rel=1e-6)
    assert rate < 0.5
    assert tell_common_speed(verdict, SPEEDS) == ()


def test_a_swing_that_grows_and_a_stable_system_are_silent():
    assert tell_common_speed(judge(two_machines(1.0, 0.4)), SPEEDS)
    for falling in (-0.4, 0.0):
        assert tell_common_speed(judge(two_machines(1.0, falling)), SPEEDS) == ()
    growing = judge(two_machines(1.0, -0.4, apart=1.6))
    assert growing.stable is False
    assert growing.mode.is_oscillation
    assert tell_common_speed(growing, SPEEDS) == ()


def test_one_machine_has_no_common_speed():
    mode = judge(two_machines(1.0, 0.4)).mode
    assert is_common_speed(mode, SPEEDS)
    assert not is_common_speed(mode, SPEEDS[:1])
    assert not is_common_speed(mode, ("nothing.omega", *SPEEDS))
