"""What a converter without an emf takes for the bus voltage at the ends of a master's steps."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import expm

from fmus.converter_parts.bus_voltage import extrapolated_voltage
from fmus.toolchain.frames import Phasor
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.phasor_port import declare_master_step
from fmus.toolchain.symbols import Expr
from tests.support.evaluated import Evaluated

SLOPE = 0.3
"""Of the bus voltage, in both parts [pu/s]: any other serves, as the lags are linear."""


def behind_lags(step, ahead):
    """The voltage that is seen, and the one expected so many seconds later, of a bus that a master steps."""
    m = ModelBuilder("alone", "The lags alone")
    v = Phasor(*(m.input(name, "pu", name, base="bus") for name in ("v_re", "v_im")))
    port = SimpleNamespace(v_0=Phasor(Expr(1.0), Expr(0.0)))
    seen = extrapolated_voltage(m, port, declare_master_step(m))
    seen.follow(m, v)
    later = seen.after(Expr(ahead))
    m.output("v_re_later", later.re, "pu", "Real part", base="bus")
    m.output("v_im_later", later.im, "pu", "Imaginary part", base="bus")
    return Evaluated(m.build(), {"communication_step": step})


@pytest.mark.parametrize("ahead", [0.0, 5e-4, 2e-3])
@pytest.mark.parametrize("step", [1e-4, 1e-3, 2e-3, 1e-2])
def test_a_ramp_that_a_master_holds_over_each_step_is_seen_where_it_is(step, ahead):
    """Each step holds the value of its middle; steps are solved exactly, and after many the lags follow evenly."""
    lags = behind_lags(step, ahead)
    A, B, C, D = lags.blocks([1.0, 0.0])
    assert np.abs(D).max() == 0
    moved = expm(np.block([[A, B], [np.zeros((2, 6))]]) * step)[:4]
    x, count = lags.x, round(max(0.2, 40 * step) / step)
    ramp = np.array([1.0, 0.0])
    for k in range(count):
        x = moved @ np.concatenate([x, ramp + SLOPE * (k + 0.5) * step])
    assert C @ x == pytest.approx(ramp + SLOPE * (count * step + ahead), abs=1e-9)
