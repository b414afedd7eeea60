"""The change of basis of an admittance, on a source behind an impedance whose powers are known."""

import cmath

import numpy as np
import pytest

from orchestrator.studies.black_box.frequency_response import FrequencyResponse
from orchestrator.studies.certification.codes.stiffness import stiffness

OMEGA_B = 2 * np.pi * 50
STEP = 1e-6
"""Communication step [s]: so short that the hold does not show."""

R, X = 0.02, 0.2
INNER = 1.05 * cmath.exp(0.3j)
OUTER = 0.98 * cmath.exp(-0.2j)
FREQUENCIES = np.array([1e-3, 1.0, 20.0, 50.0])


def powers(outer):
    """P and Q that the source feeds into a bus, at rest."""
    apparent = outer * np.conj((INNER - outer) / complex(R, X))
    return np.array([apparent.real, apparent.imag])


def measured(outer=OUTER):
    """What a measurement of the source would give: i = (e − v)/Z, with Z in a rotating frame."""
    s = 2j * np.pi * FREQUENCIES / OMEGA_B
    values = np.array([-np.linalg.inv([[R + k * X, -X], [X, R + k * X]]) for k in s])
    x = 2j * np.pi * FREQUENCIES * STEP
    held = values * ((1 - np.exp(-x)) / x)[:, None, None]
    current = (INNER - outer) / complex(R, X)
    return FrequencyResponse(
        FREQUENCIES,
        held,
        np.zeros(values.shape),
        np.zeros((2, 2)),
        np.array([current.real, current.imag]),
        STEP,
        ("v_re", "v_im"),
        ("i_re", "i_im"),
        0.0,
        "multisine",
    )


def test_slow_changes_give_the_derivatives_of_the_powers():
    """Against differences of the powers themselves, in angle and in magnitude."""
    found = stiffness(measured(), OUTER, 50.0)
    h = 1e-6
    by_angle = (powers(OUTER * cmath.exp(1j * h)) - powers(OUTER * cmath.exp(-1j * h))) / (2 * h)
    by_size = (powers(OUTER * (1 + h)) - powers(OUTER * (1 - h))) / (2 * h)
    at_rest = [found.powers[name][0] for name in ("P/theta", "Q/theta", "P/V", "Q/V")]
    assert at_rest == pytest.approx([*by_angle, *by_size], rel=1e-4)


def test_the_frequency_is_the_rate_of_the_angle():
    found = stiffness(measured(), OUTER, 50.0)
    angle_per_frequency = OMEGA_B / (2j * np.pi * FREQUENCIES)
    assert np.allclose(found.powers["P/omega"], found.powers["P/theta"] * angle_per_frequency)


def test_a_turned_frame_changes_nothing():
    """The powers do not know in which frame the voltage was measured."""
    turn = cmath.exp(0.7j)
    matrix = np.array([[turn.real, -turn.imag], [turn.imag, turn.real]])
    straight = measured()
    current = matrix @ straight.operating_point
    other = FrequencyResponse(
        FREQUENCIES,
        matrix @ straight.values @ matrix.T,
        straight.bounds,
        straight.feedthrough,
        current,
        STEP,
        straight.inputs,
        straight.outputs,
        0.0,
        "multisine",
    )
    one, two = stiffness(straight, OUTER, 50.0), stiffness(other, OUTER * turn, 50.0)
    for name, values in one.powers.items():
        assert np.allclose(values, two.powers[name])


def test_the_least_value_is_told_with_its_frequency_and_an_empty_band_is_an_error():
    found = stiffness(measured(), OUTER, 50.0)
    value, at = found.least("P/theta", 0.5, 60.0)
    inside = np.abs(found.powers["P/theta"][1:])
    assert (value, at) == (inside.min(), FREQUENCIES[1:][inside.argmin()])
    with pytest.raises(ValueError, match="no frequency was measured from 60 to 70 Hz"):
        found.least("Q/V", 60.0, 70.0)
