"""Generators of chosen parts in published networks: Kundur's example 12.6 and the WSCC 9-bus system."""

from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import fsolve

from orchestrator.cases.case import load_case
from orchestrator.study.modes import compute_modes

pytestmark = [pytest.mark.reproduction, pytest.mark.slow]

BAND = (0.1, 5.0)
"""Frequencies [Hz] of the modes that are looked at."""

CASES = Path(__file__).parents[1] / "support"


def swings(case, scenario):
    """(frequency [Hz], damping [%]) of the electromechanical modes, by rising frequency."""
    (prepared,) = load_case(CASES / case).prepare([scenario])
    found = [
        (m.frequency_hz, m.damping_percent) for m in compute_modes(prepared, BAND).modes if 0.3 < m.frequency_hz < 3
    ]
    return sorted(m for m in found if m[1] < 20)


KUNDUR = {
    # An EMT model of the same network in NumPy, written by someone else from Kundur's equations: inter-area mode and
    # the two areas' local modes.
    "manual": [(0.5427, 4.03), (1.0835, 8.85), (1.1190, 8.64)],
    "manual_torque": [(0.5425, 3.11), (1.0834, 8.39), (1.1189, 8.17)],
    "thyristor": [(0.6079, -0.73), (1.1366, 8.85), (1.1713, 8.57)],
    "transient_gain_reduction": [(0.5452, -2.86), (1.0886, 8.23), (1.1241, 8.08)],
}


@pytest.mark.parametrize("scenario", KUNDUR)
def test_kundurs_modes_are_those_of_an_independent_emt_model(scenario):
    found = swings("kundur/case.toml", scenario)
    assert len(found) == 3
    for (hertz, percent), (wanted_hertz, wanted_percent) in zip(found, KUNDUR[scenario], strict=True):
        assert hertz == pytest.approx(wanted_hertz, abs=3e-4)
        assert percent == pytest.approx(wanted_percent, abs=0.02)


BRANCHES = [
    (4, 5, 0.017 + 0.092j, 0.158), (5, 6, 0.039 + 0.17j, 0.358), (6, 7, 0.0119 + 0.1008j, 0.209),
    (7, 8, 0.0085 + 0.072j, 0.149), (8, 9, 0.032 + 0.161j, 0.306), (9, 4, 0.01 + 0.085j, 0.176),
    (1, 4, 0.0576j, 0.0), (3, 6, 0.0586j, 0.0), (8, 2, 0.0625j, 0.0),
]  # fmt: skip
LOADS = {5: 0.9 + 0.3j, 7: 1.0 + 0.35j, 9: 1.25 + 0.5j}
STRAY_B = 0.05
UNITS = {1: (None, 1.04, 23.64, 0.0608), 2: (1.63, 1.025, 6.4, 0.1198), 3: (0.85, 1.025, 3.01, 0.1813)}
"""Bus → power, voltage [pu], H [s] and X'_d [pu] on 100 MVA."""


def classical_swings():
    """Imaginary parts [rad/s] of the swing modes: network reduced to the machines' internal nodes (Kron)."""
    Y = np.zeros((9, 9), dtype=complex)
    for a, b, z, charging in BRANCHES:
        Y[a - 1, b - 1] -= 1 / z
        Y[b - 1, a - 1] -= 1 / z
        Y[a - 1, a - 1] += 1 / z + 0.5j * charging
        Y[b - 1, b - 1] += 1 / z + 0.5j * charging
    for bus in UNITS:
        Y[bus - 1, bus - 1] += 1j * STRAY_B

    def mismatch(x):
        v = np.exp(1j * np.concatenate(([0.0], x[:8]))) * np.concatenate(([1.04, 1.025, 1.025], x[8:]))
        s = v * np.conj(Y @ v)
        wanted = {1: 1.63, 2: 0.85}
        active = [s[k].real - wanted.get(k, -LOADS.get(k + 1, 0j).real) for k in range(1, 9)]
        return active + [s[k].imag + LOADS.get(k + 1, 0j).imag for k in range(3, 9)]

    x = fsolve(mismatch, np.concatenate((np.zeros(8), np.ones(6))))
    v = np.exp(1j * np.concatenate(([0.0], x[:8]))) * np.concatenate(([1.04, 1.025, 1.025], x[8:]))
    i = (Y @ v)[:3]
    X1 = np.array([UNITS[bus][3] for bus in UNITS])
    E = v[:3] + 1j * X1 * i
    for bus, load in LOADS.items():
        Y[bus - 1, bus - 1] += np.conj(load) / abs(v[bus - 1]) ** 2
    for k, X in enumerate(X1):
        Y[k, k] += 1 / (1j * X)
    inside = np.diag(1 / (1j * X1))
    to_network = np.zeros((3, 9), dtype=complex)
    to_network[:, :3] = inside
    reduced = inside - to_network @ np.linalg.solve(Y, to_network.T)
    delta, size = np.angle(E), abs(E)
    K = np.zeros((3, 3))
    for a in range(3):
        for b in range(3):
            if a != b:
                angle = delta[a] - delta[b]
                slope = size[a] * size[b] * (reduced[a, b].imag * np.cos(angle) - reduced[a, b].real * np.sin(angle))
                K[a, b], K[a, a] = -slope, K[a, a] + slope
    H = np.array([UNITS[bus][2] for bus in UNITS])
    squares = np.linalg.eigvals(-(120 * np.pi / (2 * H))[:, None] * K)
    return sorted(np.sqrt(-squares.real))[1:]


def test_the_nine_bus_systems_classical_modes_are_those_of_its_reduced_network():
    """Anderson and Fouad have 8.69 and 13.36 rad/s."""
    wanted = classical_swings()
    assert wanted == pytest.approx([8.69, 13.36], rel=3e-3)
    found = [2 * np.pi * hertz for hertz, _ in swings("wscc9_machines/classical.toml", "classical")]
    assert found == pytest.approx(wanted, rel=5e-4)


@pytest.mark.parametrize("scenario", ["two_axis", "type_1"])
def test_the_nine_bus_systems_two_axis_modes_are_near_the_textbooks(scenario):
    """Sauer and Pai: 1.332 Hz at 2.3 % and 2.029 Hz at 5.7 %, there with loads of constant power."""
    slow, fast = swings("wscc9_machines/case.toml", scenario)
    assert slow == pytest.approx((1.332, 2.28), abs=0.4)
    assert slow[0] == pytest.approx(1.332, abs=0.02)
    assert fast == pytest.approx((2.029, 5.65), abs=0.5)
    assert fast[0] == pytest.approx(2.029, abs=0.02)
