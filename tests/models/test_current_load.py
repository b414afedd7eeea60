"""Loads of constant active current: their law in steady state, their step, and what they refuse."""

import numpy as np
import pytest

from fmus.grid.grid import grid
from fmus.grid.network import Line, Load, Network, Port
from fmus.grid.phasor_grid import phasor_grid


def network(active, q_mvar=0.0, tau=None, **more):
    loads = (Load("load", "a", 800.0, q_mvar, active=active),)
    return Network("one_load", ("a", "b"), (Line("ab", "a", "b", X=0.05),), (*loads, Load("far", "b", 100.0)),
                   (Port("unit", "a"),), **more)  # fmt: skip


class Held:
    """The grid model with the current that holds bus a at a voltage, found by Newton's method on ẋ = 0."""

    def __init__(self, active, q_mvar=0.0):
        self.model = grid(network(active, q_mvar))
        self.p = np.array([float(v.start) for v in self.model.parameters])
        self.c, x = self.model.initialise(self.p)
        self.x = np.array(x).ravel()

    def drawn(self, u):
        """Steady state for an injected current (re, im): bus voltage and the power the load draws."""
        x = self.x.copy()
        for _ in range(50):
            A = np.array(self.model.jacobians()(x, u, self.p, self.c)[0])
            rate = np.array(self.model.derivatives(x, u, self.p, self.c)).ravel()
            x -= np.linalg.solve(A, rate)
        assert np.abs(np.array(self.model.derivatives(x, u, self.p, self.c))).max() < 1e-6
        y = dict(zip((v.name for v in self.model.outputs),
                     np.array(self.model.outputs_function(x, u, self.p, self.c)).ravel(), strict=True))  # fmt: skip
        return y


def test_it_starts_in_steady_state():
    held = Held("current", 100.0)
    names = [s.name for s in held.model.states]
    u = np.array([8.0, -1.0])  # with equal voltages at both ends the line carries nothing
    rates = np.array(held.model.derivatives(held.x, u, held.p, held.c)).ravel()
    of_load = [abs(r) for n, r in zip(names, rates, strict=True) if n.startswith("load.c")]
    assert max(of_load) < 1e-9


def test_active_power_goes_with_the_voltage():
    """dP/dv·v/P = 1, where a constant impedance has 2."""
    held = Held("current")
    low, high = held.drawn(np.array([8.9, -0.05])), held.drawn(np.array([8.9 + 1e-3, -0.05]))
    dp, dv = high["load.p"] - low["load.p"], high["a.v"] - low["a.v"]
    assert abs(dv) > 1e-6
    assert dp / dv * low["a.v"] / low["load.p"] == pytest.approx(1.0, abs=1e-6)
    assert low["load.p"] == pytest.approx(8.0 * low["a.v"], rel=1e-9)


def test_the_lag_is_the_only_difference_to_an_impedance():
    """At the first instant after a step of the injected current the load is still the conductance."""
    held = Held("current")
    u = np.array([8.0, 0.0])
    outputs = held.model.outputs_function(held.x, 1.1 * u, held.p, held.c)
    y = dict(zip((v.name for v in held.model.outputs), np.array(outputs).ravel(), strict=True))
    assert y["load.p"] == pytest.approx(8.0 * y["a.v"] ** 2, rel=1e-12)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"stray_B": 0.05}, "needs a network without bus capacitances"),
        ({"loads": (Load("load", "a", 0.0, 5.0, active="current"), Load("r", "a", 1.0), Load("far", "b", 1.0))},
         "must exceed 0"),
    ],
)  # fmt: skip
def test_what_it_refuses(change, words):
    fields = {"name": "n", "buses": ("a", "b"), "lines": (Line("ab", "a", "b", X=0.05),),
              "loads": (Load("load", "a", 10.0, active="current"), Load("far", "b", 1.0)),
              "ports": (Port("unit", "a"),)}  # fmt: skip
    with pytest.raises(ValueError, match=words):
        Network(**fields | change)


def test_the_phasor_grid_refuses_it():
    with pytest.raises(ValueError, match="load is of constant current, which the phasor grid does not have"):
        phasor_grid(network("current"))
