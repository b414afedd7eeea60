"""The averaged bridge: it follows what is asked of it up to its limit, on both sides."""

import numpy as np
import pytest

from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, Function, symbols_in
from fmus.vendor_dll.circuit import BRIDGE, _bridge_voltage

V_DC, M_MAX, VOLT = 1.2, 1.15, 0.5


def bridge(kind, demanded):
    """The bridge's phases [pu] at an angle of 0, for three demanded signals."""
    m = ModelBuilder("small_bridge", "A bridge")
    e = _bridge_voltage(m, kind, Expr(VOLT), Expr(0.0))
    given = dict(zip(BRIDGE, demanded, strict=True)) | {"V_dc": V_DC, "m_max": M_MAX}
    known = symbols_in([e.re, e.im])
    return Function("e", [known], [[e.re, e.im]])([given[symbol.name()] for symbol in known])[0]


@pytest.mark.parametrize("kind", ["modulation", "voltage"])
@pytest.mark.parametrize(
    "demanded", [(1.1, -0.4, -0.7), (3.0, -1.5, -1.5), (-3.0, 1.5, 1.5), (0.2, -2.0, 1.8)]
)
def test_each_phase_is_held_at_the_limit_of_the_modulation_on_both_sides(kind, demanded):
    """With the amplitude-invariant transformation by hand, without its zero sequence."""
    half = V_DC / 2
    asked = demanded if kind == "modulation" else [value * half for value in demanded]
    a, b, c = np.clip(demanded, -M_MAX, M_MAX) * half / VOLT
    wanted = 2 / 3 * (a + b * np.exp(2j * np.pi / 3) + c * np.exp(-2j * np.pi / 3))
    re, im = bridge(kind, asked)
    assert complex(float(re), float(im)) == pytest.approx(wanted)
