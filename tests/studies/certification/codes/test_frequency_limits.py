"""The stiffness that a jump of the angle asks for, behind the impedance of a grid."""

import pytest

from orchestrator.studies.certification.codes.frequency.limits import (
    JUMP,
    OPPOSED,
    POWER,
    SCR,
    asked_stiffness,
)
from orchestrator.studies.certification.codes.programme import jumps


class Flat:
    """A device of the same |P/θ| at all frequencies."""

    def least(self, values, low, high):
        return 7.0, low


def test_device_and_grid_in_series_give_the_power_that_is_asked_for():
    """A jump Δθ over two stiffnesses in series moves the power by Δθ·K·K_g/(K + K_g)."""
    Z = jumps(SCR, POWER, ()).impedance
    grid = Z.imag / abs(Z) ** 2
    asked = asked_stiffness(Flat(), 50.0)
    assert JUMP * asked.value * grid / (asked.value + grid) == pytest.approx(OPPOSED)
    assert asked.value > OPPOSED / JUMP  # a weaker grid asks for more of the device, never for less
    assert asked.met == (asked.value <= 7.0)
