"""A shunt that switches: its admittance on and off, in both networks, and in both kinds of FMU."""

import numpy as np
import pytest

from fmus.grid.grid import grid
from fmus.grid.network import Line, Load, Network, Port, Shunt
from fmus.grid.phasor_grid import phasor_grid
from tests.models.networks import are_the_same, phasors, stepped
from tests.support.evaluated import Evaluated

OFF, ON = 200, 1200
"""Steps of 0.1 ms after which the shunt is off, and on again."""


def network(b_mvar):
    shunt = Shunt("bank", "b", g_mw=30.0, b_mvar=b_mvar, switched=True)
    line = Line("ab", "a", "b", X=0.1, R=0.01, B=0.1)
    return Network(
        "bay",
        ("a", "b"),
        (line,),
        (Load("town", "a", 200.0, 50.0),),
        (Port("unit", "a"),),
        (shunt,),
    )


def admittance(b_mvar, connected):
    """Of both buses, with 1 pu as the power flow's voltage."""
    y = 1 / complex(0.01, 0.1)
    share = 1.0 if connected else (1e-3 if b_mvar > 0 else 0.0)
    return np.array(
        [
            [y + 0.05j + 2.0 - 0.5j, -y],
            [-y, y + 0.05j + (0.3 if connected else 0.0) + 1j * share * b_mvar / 100],
        ]
    )


@pytest.mark.parametrize("b_mvar", [90.0, -90.0])
def test_the_network_settles_on_the_admittances(b_mvar):
    names = ("b.v_re", "b.v_im")
    i = 2.5 - 0.4j
    rows = stepped(
        grid(network(b_mvar)),
        {"unit.i_re": i.real, "unit.i_im": i.imag},
        0.4,
        names,
        None,
        {OFF: {"bank.connected": False}, ON: {"bank.connected": True}},
    )
    (v,) = phasors(rows, names, "b.v")
    for step, connected in ((ON - 1, False), (len(v) - 1, True)):
        wanted = np.linalg.solve(admittance(b_mvar, connected), [i, 0.0])[1]
        assert v[step] == pytest.approx(wanted, abs=1e-4)


@pytest.mark.parametrize("connected", [True, False])
@pytest.mark.parametrize("b_mvar", [90.0, -90.0])
def test_its_rest_is_that_of_the_admittances(b_mvar, connected):
    """Rates are linear in the states, so that one solution leads to where all of them are zero."""
    network_at_rest = Evaluated(grid(network(b_mvar)), {"bank.connected": connected})
    given = {"unit.i_re": 2.5, "unit.i_im": -0.4}
    u = np.array([given[v.name] for v in network_at_rest.model.inputs])
    rates = np.array(list(network_at_rest.rates(u).values()))
    at_rest = network_at_rest.x - np.linalg.solve(network_at_rest.blocks(u)[0], rates)
    found = network_at_rest.outputs(u, at_rest)
    wanted = np.linalg.solve(admittance(b_mvar, connected), [complex(*given.values()), 0.0])[1]
    assert complex(found["b.v_re"], found["b.v_im"]) == pytest.approx(wanted, abs=1e-9)


@pytest.mark.parametrize("make", [grid, phasor_grid])
@pytest.mark.parametrize("b_mvar", [90.0, -90.0])
def test_native_and_python_backed_fmus_give_the_same_bits(make, b_mvar):
    model = make(network(b_mvar))
    values = {v.name: 1.0 for v in model.inputs}
    names = [v.name for v in (*model.states, *model.outputs)]
    changes = {20: {"bank.connected": False}, 60: {"bank.connected": True}}
    one, other = (
        stepped(model, values, 0.01, names, None, changes, native=native)
        for native in (True, False)
    )
    assert are_the_same(one, other, model)
    assert not np.array_equal(one[19], one[59])
