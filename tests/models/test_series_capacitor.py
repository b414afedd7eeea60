"""Series capacitors of lines: against impedances written by hand, in phasors, and when their line opens."""

import numpy as np
import pytest

from fmus.grid.grid import grid
from fmus.grid.network import Line, Load, Network, Port
from fmus.grid.phasor_grid import phasor_grid
from tests.models.networks import are_the_same, phasors, stepped
from tests.support.evaluated import Evaluated

OMEGA_B = 2 * np.pi * 50
R, X, X_C = 0.01, 0.2, 0.08


def network(**more):
    line = Line("ab", "a", "b", X=X, R=R, **({"X_C": X_C} | more))
    return Network(
        "compensated",
        ("a", "b"),
        (line,),
        (Load("l", "a", 200.0), Load("m", "b", 500.0)),
        (Port("unit", "a"),),
    )


@pytest.mark.parametrize("frequency", [0.5, 18.4, 31.6, 70.0])
def test_the_network_answers_as_its_impedances_do(frequency):
    """Z(s) = R + X·(s + jω_b)/ω_b + X_C·ω_b/(s + jω_b) in the turning frame, above and below its resonances."""
    s = 2j * np.pi * frequency
    turned = (s + 1j * OMEGA_B) / OMEGA_B
    Z = R + X * turned + X_C / turned
    current = 0.5 / (0.5 + Z + 0.2)
    found = Evaluated(grid(network())).response(s, [0.0, 0.0])
    v_b = found["b.v_re", "unit.i_re"] + 1j * found["b.v_im", "unit.i_re"]
    assert v_b == pytest.approx(0.2 * current, rel=1e-9)


@pytest.mark.parametrize("charging", [0.0, 0.3])
def test_it_starts_in_steady_state_and_the_phasor_network_agrees(charging):
    start = {"a.v_0": 1.02, "a.theta_0": 0.1, "b.v_0": 0.99}
    model = grid(network(B=charging))
    at = Evaluated(model, start)
    current = (1.02 * np.exp(0.1j) - 0.99) / (R + 1j * (X - X_C))
    assert complex(at.states["ab.i_re"], at.states["ab.i_im"]) == pytest.approx(current)
    rates = at.rates([0.0, 0.0])
    assert max(abs(rates[f"ab.v_C_{part}"]) for part in ("re", "im")) < 1e-9
    y = Evaluated(phasor_grid(network(B=charging)), start).outputs([1.0, 0.0, 0.0, -10.0])
    v = complex(y["a.v_re"], y["a.v_im"]), complex(y["b.v_re"], y["b.v_im"])
    into = (v[0] - v[1]) / (R + 1j * (X - X_C))
    assert complex(y["ab.p"], y["ab.q"]) == pytest.approx(v[0] * into.conjugate())


@pytest.mark.parametrize("charging", [0.0, 0.3])
def test_its_voltage_fades_where_the_line_opens(charging):
    names = ("ab.v_C_re", "ab.v_C_im", "ab.i_re", "ab.i_im")
    rows = stepped(
        grid(network(B=charging)),
        {"unit.i_re": 7.0, "unit.i_im": 0.0},
        0.3,
        names,
        None,
        {2000: {"ab.connected": False}},
    )
    v, i = (np.abs(x) for x in phasors(rows, names, "ab.v_C", "ab.i"))
    assert v[1999] == pytest.approx(X_C * i[1999], rel=1e-3)
    assert v[2010] == pytest.approx(v[2000] / np.e, rel=1e-2)
    assert v[-1] < 1e-9


@pytest.mark.parametrize("X_C", [-0.1, 0.2, 0.3])
def test_what_it_cannot_be(X_C):
    with pytest.raises(
        ValueError,
        match=r"'ab' has the series capacitor X_C = .* must not be negative, and be less",
    ):
        network(X_C=X_C)


@pytest.mark.parametrize("make", [grid, phasor_grid])
def test_native_and_python_backed_fmus_give_the_same_bits(make):
    model = make(network())
    values = {v.name: 1.0 for v in model.inputs}
    names = [v.name for v in (*model.states, *model.outputs)]
    one, other = (stepped(model, values, 0.005, names, native=native) for native in (True, False))
    assert are_the_same(one, other, model)
