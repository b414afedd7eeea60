"""A network with every kind of branch, beside a load flow and a state matrix that are written here with NumPy alone."""

import cmath
import math
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import root

from orchestrator.studies.modes.modes import compute_modes
from tests.support.scenarios import prepare_one
from tests.support.tables import figures

pytestmark = pytest.mark.reproduction

PAGE = (Path(__file__).parents[2] / ".docs" / "validation" / "networks.md").read_text(
    encoding="utf-8"
)
CASE = """\
name = "kinds"
[solver]
step_size = "1 ms"
[power_flow]
grid = "grid"
slack = "one"
[network]
frequency = 50.0
buses = ["a", "b", "c", "d", "e"]
lines.ab = { from = "a", to = "b", R = 0.004, X = 0.06, B = 0.08 }
lines.bc = { from = "b", to = "c", R = 0.003, X = 0.09, X_C = 0.03 }
lines.ac = { from = "a", to = "c", R = 0.002, X = 0.08, tap = 1.04, shift = 0.05 }
shunts.bank = { bus = "b", g = "1 MW", b = "30 Mvar" }
loads.town = { bus = "b", p = "150 MW", q = "40 Mvar" }
loads.mill = { bus = "e", p = "30 MW", q = "15 Mvar" }
loads.wind = { bus = "d", p = "-60 MW", q = "-10 Mvar", active = "impedance", reactive = "impedance" }
[network.three_winding_transformers]
t = { buses = ["c", "d", "e"], X_12 = 0.12, X_13 = 0.2, X_23 = 0.14, R_12 = 0.002, tap = [1.0, 0.98, 1.0] }
[components.grid]
model = "phasor_grid"
[components.one]
model = "synchronous_generator_phasor"
bus = "a"
machine = "classical"
exciter = "manual"
governor = "constant_power"
stabilizer = "none"
[components.one.parameters]
S_n = "300 MVA"
v_0 = 1.02
transformer = { X_t = 0.0, R_t = 0.0 }
machine = { X_d1 = 0.3, H = 5.0, R_s = 0.0, D = 0.0 }
[components.two]
model = "synchronous_generator_phasor"
bus = "c"
machine = "classical"
exciter = "manual"
governor = "constant_power"
stabilizer = "none"
[components.two.parameters]
S_n = "150 MVA"
P_0 = 0.4
Q_0 = 0.1
transformer = { X_t = 0.0, R_t = 0.0 }
machine = { X_d1 = 0.25, H = 3.0, R_s = 0.0, D = 0.0 }
"""
BUSES = "abcde*"  # the last is the star point of t
OMEGA_B = 2 * math.pi * 50


def admittances():
    """Nodal admittances without loads [pu, 100 MVA]."""
    Y = np.zeros((6, 6), complex)

    def branch(start, end, z, tap=1 + 0j, charging=0.0):
        i, j, y = BUSES.index(start), BUSES.index(end), 1 / z
        Y[i, i] += (y + 0.5j * charging) / abs(tap) ** 2
        Y[j, j] += y + 0.5j * charging
        Y[i, j] -= y / tap.conjugate()
        Y[j, i] -= y / tap

    branch("a", "b", 0.004 + 0.06j, charging=0.08)
    branch("b", "c", 0.003 + 0.06j)
    branch("a", "c", 0.002 + 0.08j, tap=cmath.rect(1.04, 0.05))
    Y[1, 1] += 0.01 + 0.30j
    z_12, z_13, z_23 = 0.002 + 0.12j, 0.20j, 0.14j
    for bus, z, tap in (
        ("c", (z_12 + z_13 - z_23) / 2, 1.0),
        ("d", (z_12 + z_23 - z_13) / 2, 0.98),
        ("e", (z_13 + z_23 - z_12) / 2, 1.0),
    ):
        branch(bus, "*", z, tap=complex(tap))
    return Y


def load_flow():
    """Voltages; a holds 1.02 pu, and all others are fed what they are."""
    Y = admittances()
    fed = np.array([0, -1.5 - 0.4j, 0.6 + 0.15j, 0.6 + 0.1j, -0.3 - 0.15j, 0])

    def off(x):
        v = np.concatenate([[1.02], x[:5] + 1j * x[5:]])
        gap = (v * np.conj(Y @ v) - fed)[1:]
        return np.concatenate([gap.real, gap.imag])

    found = root(off, np.concatenate([np.ones(5), np.zeros(5)]), tol=1e-13)
    assert np.abs(off(found.x)).max() < 1e-11
    return np.concatenate([[1.02], found.x[:5] + 1j * found.x[5:]])


def swing():
    """Eigenvalue [rad/s] of two constant fluxes behind X'_d, the emfs in proportion to speed, by a matrix of 4 × 4."""
    v, Y = load_flow(), admittances()
    at, S, X1, H = (
        np.array([0, 2]),
        np.array([3.0, 1.5]),
        np.array([0.3, 0.25]),
        np.array([5.0, 3.0]),
    )
    i = (Y @ v)[at]
    E = v[at] + 1j * X1 / S * i
    for bus, drawn in ((1, 1.5 + 0.4j), (3, -0.6 - 0.1j), (4, 0.3 + 0.15j)):
        Y[bus, bus] += drawn.conjugate() / abs(v[bus]) ** 2
    y = S / (1j * X1)
    Y[at, at] += y
    reduced = np.diag(y) - np.diag(y) @ np.linalg.inv(Y)[np.ix_(at, at)] @ np.diag(y)
    power = (E * np.conj(reduced @ E)).real

    def rates(x):
        delta, w = x[:2], x[2:]
        current = reduced @ (w * np.abs(E) * np.exp(1j * delta))
        torque = (np.abs(E) * np.exp(1j * delta) * np.conj(current)).real
        return np.concatenate([OMEGA_B * (w - 1), (power / w - torque) / (2 * H * S)])

    x, h = np.concatenate([np.angle(E), [1, 1]]), 1e-6
    assert np.abs(rates(x)).max() < 1e-10
    A = np.column_stack([(rates(x + h * e) - rates(x - h * e)) / (2 * h) for e in np.eye(4)])
    return max(np.linalg.eigvals(A), key=lambda z: z.imag)


@pytest.fixture(scope="module")
def ready(tmp_path_factory):
    path = tmp_path_factory.mktemp("kinds") / "case.toml"
    path.write_text(CASE, encoding="utf-8")
    found = prepare_one(path)
    return found


def test_the_power_flow_is_that_of_the_load_flow(ready):
    wanted = dict(zip(BUSES, load_flow(), strict=True))
    difference = max(abs(ready.power_flow.voltages[bus] - wanted[bus]) for bus in "abcde")
    ((most,),) = figures(PAGE, "Every kind of branch", "Voltages of the power flow, 10⁻¹² pu")
    assert difference < 1e-12 * most
    # its unit feeds Q, and holds no voltage
    assert abs(wanted["c"]) != pytest.approx(1.0, abs=1e-3)


def test_the_swing_is_that_of_the_matrix(ready):
    found = compute_modes(ready, (0.3, 3.0))
    (mode,) = found.modes
    ((most,),) = figures(PAGE, "Every kind of branch", "Swing of the phasor FMUs at 1 ms, rad/s")
    assert found.operating_point.residual < 1e-9
    assert abs(mode.eigenvalue - swing()) < most
