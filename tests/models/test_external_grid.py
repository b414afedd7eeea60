"""The external grid against its equations by hand, and the short-circuit power that it stands for."""

from cmath import exp

import numpy as np
import pytest

from fmus.toolchain.catalogue import build_model
from tests.support.evaluated import Evaluated

VALUES = {
    "S_n": 5500.0,
    "R_X": 0.2,
    "P_0": 0.3,
    "Q_0": -0.1,
    "v_0": 1.02,
    "theta_0": 0.4,
    "f_n": 60.0,
}


def test_the_source_behind_its_impedance_written_by_hand():
    device = Evaluated(build_model("external_grid"), VALUES)
    X = 1 / np.hypot(1, 0.2)
    v_0 = 1.02 * exp(0.4j)
    i_0 = (complex(0.3, -0.1) / v_0).conjugate()
    e = v_0 + complex(0.2 * X, X) * i_0
    i, v = 0.5 - 0.2j, 0.9 + 0.1j
    rate = 120 * np.pi / X * (e - v - complex(0.2 * X, X) * i)
    found = device.rates([v.real, v.imag], device.vector({"i_x": i.real, "i_y": i.imag}))
    assert complex(found["i_x"], found["i_y"]) == pytest.approx(rate, rel=1e-12)
    assert max(map(abs, device.rates([v_0.real, v_0.imag]).values())) < 1e-9


@pytest.mark.parametrize("ratio", [0.0, 0.1, 1.0])
def test_a_short_circuit_at_rated_voltage_takes_the_short_circuit_power(ratio):
    """At no load |i| at v = 0 is S_n [MVA] at 1 pu, in both variants."""
    values = {"S_n": 17700.0, "R_X": ratio}
    phasor = Evaluated(build_model("external_grid_phasor"), values).outputs([0.0, 0.0])
    assert np.hypot(phasor["i_re"], phasor["i_im"]) == pytest.approx(177.0, rel=1e-12)
    A, B, *_ = Evaluated(build_model("external_grid"), values).blocks([0.0, 0.0])
    # The current's mean is that of the impedance at rated frequency: −B/A from the source to the current.
    gain = np.linalg.solve(A, B)
    assert np.hypot(*gain[0]) * 177.0 == pytest.approx(177.0, rel=1e-12)
