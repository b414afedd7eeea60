"""The circuits around a controller against equations by hand, linearised by SciPy; and a hidden state in one."""

import cmath

import numpy as np
import pytest
from scipy.linalg import eigvals
from scipy.optimize import approx_fprime

from orchestrator.linear.models.blocks import Blocks
from orchestrator.linear.models.periodic import model_of
from orchestrator.linear.models.steady_state import find_operating_point
from orchestrator.linear.spectra.modes import eigenvalues
from tests.support.vendor_dlls import droop_device
from tests.vendor_dll.test_device import LAG, P_0, Q_0, W_B, device_master, swing

Z_S, Z_T, Z_2, B, R_D = 0.01 + 0.15j, 0.005 + 0.1j, 0.002 + 0.08j, 0.3, 0.1
MP, TAU = 0.02, 0.05
CIRCUIT = "filter.X = 0.15\nfilter.B = 0.3\nfilter.R_d = 0.1"
SECOND = "\ngrid_inductor.R = 0.002\ngrid_inductor.X = 0.08"

FILTERS = {
    "LC": (Z_T, [('filter = "L"', 'filter = "LC"'), ("filter.X = 0.15", CIRCUIT)]),
    "LCL": (Z_T + Z_2, [('filter = "L"', 'filter = "LCL"'), ("filter.X = 0.15", CIRCUIT + SECOND)]),
}


def by_hand(z_g, B=B):
    """Eigenvalues of droop, inductor, capacitor with its resistor, and what lies between it and a stiff bus of 1 pu."""
    i_g = complex(P_0, -Q_0)
    u = 1 + z_g * i_g
    u_c = u / (1 + 1j * R_D * B)
    i_s = i_g + 1j * B * u_c
    e = (u + Z_S * i_s) * cmath.exp(1j * LAG)
    p_ref = (e * i_s.conjugate()).real

    def rates(x):
        i_s, u_c, i_g = (complex(x[k], x[k + 1]) for k in (0, 2, 4))
        e_now = abs(e) * cmath.exp(1j * x[7])
        u = u_c + R_D * (i_s - i_g)
        parts = (
            W_B / Z_S.imag * (e_now * cmath.exp(-1j * LAG) - u - Z_S * i_s),
            W_B / B * (i_s - i_g - 1j * B * u_c),
            W_B / z_g.imag * (u - 1 - z_g * i_g),
        )
        power = (e_now * i_s.conjugate()).real
        flat = [y for part in parts for y in (part.real, part.imag)]
        return np.array([*flat, (power - x[6]) / TAU, W_B * MP * (p_ref - x[6])])

    x = np.array(
        [i_s.real, i_s.imag, u_c.real, u_c.imag, i_g.real, i_g.imag, p_ref, cmath.phase(e)]
    )
    assert np.abs(rates(x)).max() < 1e-9
    return eigvals(approx_fprime(x, rates, 1e-7))


def found(file):
    """The swing over the period [rad/s]."""
    with device_master(file) as master:
        find_operating_point(master)
        return swing(eigenvalues(model_of(master, Blocks(master))))


@pytest.mark.parametrize("kind", FILTERS)
def test_the_swing_behind_a_filter_is_that_of_the_equations(tmp_path, kind):
    z_g, changes = FILTERS[kind]
    here, expected, without = (
        found(droop_device(tmp_path, changes=changes)),
        swing(by_hand(z_g)),
        swing(by_hand(z_g, 0.2)),
    )
    assert abs(here.imag - expected.imag) / (2 * np.pi) < 0.005
    assert abs(here.real / abs(here) - expected.real / abs(expected)) < 0.005
    # a capacitor of other data would be seen
    assert abs(without.imag - expected.imag) / (2 * np.pi) > 0.01


def test_a_state_that_the_controller_hides_is_in_the_modes(tmp_path):
    """The same droop that keeps its filtered power in a variable of its own has the same swing."""
    (tmp_path / "open").mkdir()
    (tmp_path / "hiding").mkdir()
    declared = droop_device(tmp_path / "open")
    hidden = droop_device(tmp_path / "hiding", hide="static double own; filtered = &own;")
    expected, here = found(declared), found(hidden)
    assert here == pytest.approx(expected, rel=1e-6)
