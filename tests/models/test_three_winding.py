"""Three-winding transformers, with a negative reactance in the star as well, against the star's own equations."""

import numpy as np
import pytest

from fmus.grid.grid import grid
from fmus.grid.network import Load, Network, Port, ThreeWinding
from fmus.grid.phasor_grid import phasor_grid
from tests.models.networks import are_the_same, phasors, stepped
from tests.support.evaluated import Evaluated

OMEGA_B = 2 * np.pi * 50
X, R = (0.12, -0.03, 0.2), (0.004, 0.002, 0.006)
TAP, SHIFT = (1.05, 1.0, 0.97), (0.0, 0.0, 0.5236)
G = (2.0, 3.0, 1.5)


def network(transformer=None):
    transformer = transformer or ThreeWinding("t", ("a", "b", "c"), X, R, TAP, SHIFT)
    loads = tuple(Load(f"load_{bus}", bus, 100 * g) for bus, g in zip("abc", G, strict=True))
    return Network(
        "three", ("a", "b", "c"), (), loads, (Port("unit", "a"),), transformers=(transformer,)
    )


def admittances(s=0.0):
    """Of the three windings behind their ratios, the star point eliminated by Kron's reduction."""
    y = np.array([1 / (r + x * (s + 1j * OMEGA_B) / OMEGA_B) for r, x in zip(R, X, strict=True)])
    Y = np.diag(y) - np.outer(y, y) / y.sum()
    t = np.array([tap * np.exp(1j * shift) for tap, shift in zip(TAP, SHIFT, strict=True)])
    return Y / np.outer(t.conjugate(), t)


@pytest.mark.parametrize("frequency", [0.3, 5.0, 49.0, 400.0])
def test_the_network_answers_as_the_star_does(frequency):
    s = 2j * np.pi * frequency
    v = np.linalg.solve(admittances(s) + np.diag(G), [1, 0, 0])
    found = Evaluated(grid(network())).response(s, [0.0, 0.0])
    for bus, wanted in zip("abc", v, strict=True):
        value = found[f"{bus}.v_re", "unit.i_re"] + 1j * found[f"{bus}.v_im", "unit.i_re"]
        assert value == pytest.approx(wanted, rel=1e-9)


def test_the_phasor_network_has_the_same_admittances():
    y = Evaluated(phasor_grid(network())).outputs([1.0, 0.0, 0.0, -10.0])
    v = np.linalg.solve(admittances() + np.diag(G) + np.diag([-10j, 0, 0]), [-10j, 0, 0])
    power = v * (admittances() @ v).conjugate()
    for k, bus in enumerate("abc"):
        assert complex(y[f"{bus}.v_re"], y[f"{bus}.v_im"]) == pytest.approx(v[k], rel=1e-12)
        assert complex(y[f"t.winding_{k + 1}.p"], y[f"t.winding_{k + 1}.q"]) == pytest.approx(
            power[k], rel=1e-10
        )


def test_it_starts_with_the_currents_of_the_power_flow():
    start = {"a.v_0": 1.02, "a.theta_0": 0.1, "c.v_0": 0.98, "c.theta_0": -0.6}
    v = np.array([1.02 * np.exp(0.1j), 1.0, 0.98 * np.exp(-0.6j)])
    drawn = admittances() @ v
    at = Evaluated(grid(network()), start).states
    for k, t in ((0, TAP[0]), (1, TAP[1])):
        assert complex(at[f"t.i_re_{k + 1}"], at[f"t.i_im_{k + 1}"]) == pytest.approx(
            drawn[k] * t, rel=1e-10
        )


def test_it_opens():
    names = ("b.v_re", "b.v_im")
    rows = stepped(
        grid(network()),
        {"unit.i_re": 3.0, "unit.i_im": 0.0},
        0.1,
        names,
        None,
        {500: {"t.connected": False}},
    )
    (v,) = phasors(rows, names, "b.v")
    assert abs(v[499]) > 0.2
    assert abs(v[510]) < 0.5 * abs(v[499])
    assert abs(v[-1]) < 1e-9


@pytest.mark.parametrize("make", [grid, phasor_grid])
def test_native_and_python_backed_fmus_give_the_same_bits(make):
    model = make(network())
    values = {v.name: 1.0 for v in model.inputs}
    names = [v.name for v in (*model.states, *model.outputs)]
    one, other = (stepped(model, values, 0.005, names, native=native) for native in (True, False))
    assert are_the_same(one, other, model)


@pytest.mark.parametrize(
    ("X", "words"),
    [
        ((0.1, -0.2, 0.3), "transformer 't' has the reactances 0.1, -0.2, 0.3 pu"),
        ((0.1, 0.0, 0.3), "none within 1e-05 of 0"),
    ],
)
def test_what_it_cannot_be(X, words):
    with pytest.raises(ValueError, match=words):
        network(ThreeWinding("t", ("a", "b", "c"), X))
    with pytest.raises(ValueError, match="two windings at one bus: a, b, a"):
        network(ThreeWinding("t", ("a", "b", "a"), (0.1, 0.1, 0.1)))
