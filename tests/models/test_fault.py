"""Faults at buses against the analytic answer of R and L, and against the solved network of phasors."""

import numpy as np
import pytest

from fmus.grid.grid import grid
from fmus.grid.network import Line, Load, Network, Port
from fmus.grid.phasor_grid import phasor_grid
from fmus.toolchain.catalogue import build_model
from tests.models.networks import are_the_same, phasors, stepped
from tests.support.evaluated import Evaluated

OMEGA_B = 2 * np.pi * 50
STIFF = 1e4
"""Conductance [pu] that makes a current source a voltage source."""


def feeder(**more):
    """A stiff source at a, a line, and the faulted bus b with next to nothing besides."""
    loads = (Load("stiff", "a", 100 * STIFF), Load("light", "b", 1e-3))
    fields = {
        "lines": (Line("ab", "a", "b", X=0.1, R=0.01),),
        "loads": loads,
        "ports": (Port("unit", "a"),),
    }
    return Network("feeder", ("a", "b"), **fields | {"faults": ("b",)} | more)


@pytest.mark.parametrize(("R", "X"), [(0.0, 1e-5), (0.02, 1e-5), (0.005, 0.05)])
def test_the_current_of_a_fault_is_that_of_r_and_l(R, X):
    """i = v/Z·(1 − e^{−(R/L + jω)t}) in the turning frame: a direct component that dies out, and no ringing."""
    names = ("b.fault.i_re", "b.fault.i_im")
    values = {"b.fault.R": R, "b.fault.X": X}
    rows = stepped(
        grid(feeder()),
        {"unit.i_re": STIFF, "unit.i_im": 0.0},
        0.12,
        names,
        values,
        {100: {"b.fault.on": True}},
    )
    (found,) = phasors(rows, names, "b.fault.i")
    t = np.arange(len(found) - 100) * 1e-4
    R_all, X_all = R + 0.01 + 1 / STIFF, X + 0.1
    wanted = (1 - np.exp(-(R_all / X_all + 1j) * OMEGA_B * t)) / complex(R_all, X_all)
    assert np.abs(found[:101]).max() < 1e-9
    assert np.abs(found[100:] - wanted).max() < 2e-3 * np.abs(wanted).max()


def test_it_ends_without_ringing():
    names = ("b.v_re", "b.v_im", "b.fault.i_re", "b.fault.i_im")
    line = Line("ab", "a", "b", X=0.1, R=0.01, B=0.1)
    loads = (Load("stiff", "a", 100 * STIFF), Load("town", "b", 300.0))
    model = grid(feeder(lines=(line,), loads=loads))
    rows = stepped(
        model,
        {"unit.i_re": STIFF, "unit.i_im": 0.05 * STIFF},
        0.3,
        names,
        None,
        {1000: {"b.fault.on": True}, 2000: {"b.fault.on": False}},
    )
    v, i = (np.abs(x) for x in phasors(rows, names, "b.v", "b.fault.i"))
    assert v[1010:2000].max() < 3e-4  # 1e-5 pu for each pu of current, some 20 at most
    assert i[2100:].max() < 1e-4 * i[1999]
    assert i[2010] == pytest.approx(i[2000] / np.e, rel=1e-2)
    assert np.abs(np.diff(v[2300:])).max() < 1e-2
    assert v[-1] == pytest.approx(v[999], rel=1e-2)


def test_the_phasor_network_solves_the_same_fault():
    """Against the network solved by hand, and against the EMT network once its direct component is gone."""
    network = feeder(
        faults=("b",), loads=(Load("stiff", "a", 100 * STIFF), Load("town", "b", 80.0, 20.0))
    )
    values = {"b.fault.R": 0.02, "b.fault.X": 0.03, "b.fault.on": 1.0}
    source = [1.0, 0.0, 0.0, -50.0]
    y = Evaluated(phasor_grid(network), values).outputs(source)
    Y_line, Y_b = 1 / (0.01 + 0.1j), 0.8 - 0.2j + 1 / (0.02 + 0.03j)
    v = np.linalg.solve([[STIFF - 50j + Y_line, -Y_line], [-Y_line, Y_b + Y_line]], [-50j, 0])
    assert complex(y["b.v_re"], y["b.v_im"]) == pytest.approx(v[1], rel=1e-12)
    assert complex(y["b.fault.i_re"], y["b.fault.i_im"]) == pytest.approx(
        v[1] / (0.02 + 0.03j), rel=1e-12
    )
    off = Evaluated(phasor_grid(network), values | {"b.fault.on": 0.0}).outputs(source)
    healthy = np.linalg.solve(
        [[STIFF - 50j + Y_line, -Y_line], [-Y_line, 0.8 - 0.2j + Y_line]], [-50j, 0]
    )
    assert complex(off["b.v_re"], off["b.v_im"]) == pytest.approx(healthy[1], rel=1e-12)
    assert complex(off["b.fault.i_re"], off["b.fault.i_im"]) == 0
    injected = (1 - v[0]) * -50j
    emt = Evaluated(grid(network), values)
    A, B = emt.blocks([0.0, 0.0])[:2]
    emt.x = np.linalg.solve(A, -B @ [injected.real, injected.imag])
    other = emt.outputs([injected.real, injected.imag])
    assert complex(other["b.fault.i_re"], other["b.fault.i_im"]) == pytest.approx(
        v[1] / (0.02 + 0.03j), rel=1e-9
    )


@pytest.mark.parametrize("make", [grid, phasor_grid])
def test_native_and_python_backed_fmus_give_the_same_bits(make):
    model = make(feeder())
    held = {"unit.i_re": STIFF, "unit.i_im": 1.0}
    if make is phasor_grid:
        held = {"unit.e_re": 1.0, "unit.e_im": 0.0, "unit.y_re": 0.0, "unit.y_im": -50.0}
    names = [v.name for v in (*model.states, *model.outputs)]
    changes = {20: {"b.fault.on": True}, 60: {"b.fault.on": False}}
    one, other = (
        stepped(model, held, 0.01, names, None, changes, native=native) for native in (True, False)
    )
    assert np.ptp(one, axis=0).max() > 1e-3
    assert are_the_same(one, other, model)


def test_a_network_without_faults_knows_nothing_of_them():
    assert not [v for v in build_model("two_area_grid").variables if "fault" in v.name]
    assert build_model("two_area_grid").integrator == "runge_kutta"


def test_a_fault_at_no_bus_is_refused():
    with pytest.raises(ValueError, match="fault 'c' is at bus 'c', which does not exist"):
        feeder(faults=("c",))
