"""Lines whose ends switch one by one, and faults along them, against networks with a bus at the fault's place."""

import numpy as np
import pytest

from fmus.grid.grid import grid
from fmus.grid.network import OPEN_CHARGING, Line, Load, Network, Port
from fmus.grid.phasor_grid import phasor_grid
from tests.support.evaluated import Evaluated

SOURCE = [1.0, 0.1, 0.5, -20.0]  # emf and admittance of the device
Z, B = 0.01 + 0.1j, 0.3
LINE = {"X": Z.imag, "R": Z.real, "B": B}


def evaluated(line, values=None, town=80.0):
    """A device at a, and a line to b with a load."""
    loads = (Load("town", "b", town, 20.0), Load("light", "a", 5.0))
    network = Network("n", ("a", "b"), (line,), loads, (Port("unit", "a"),), phasors=True)
    return Evaluated(phasor_grid(network), values or {}).outputs(SOURCE)


def solved(Y):
    """Voltages at a and b by hand; the matrix is without the device and the loads, and may have inner nodes."""
    Y = np.array(Y, dtype=complex)
    Y[0, 0] += complex(*SOURCE[2:]) + 0.05
    Y[1, 1] += 0.8 - 0.2j
    driven = np.zeros(len(Y), dtype=complex)
    driven[0] = complex(*SOURCE[:2]) * complex(*SOURCE[2:])
    return np.linalg.solve(Y, driven)


def voltages(found):
    return [complex(found[f"{bus}.v_re"], found[f"{bus}.v_im"]) for bus in "ab"]


@pytest.mark.parametrize("tap", [1.0, 1.05])
def test_a_whole_line_is_the_same_with_and_without_parts(tap):
    shift = 0.0 if tap == 1 else 0.1
    plain = evaluated(Line("l", "a", "b", **LINE, tap=tap, shift=shift))
    parts = evaluated(
        Line("l", "a", "b", **LINE, tap=tap, shift=shift, has_ends=True, faulted=True)
    )
    for name, value in plain.items():
        assert parts[name] == pytest.approx(value, rel=1e-9, abs=1e-11)
    assert parts["l.fault.i_re"] == parts["l.fault.i_im"] == 0


@pytest.mark.parametrize("at", [0.01, 0.3, 0.9])
@pytest.mark.parametrize("z_f", [1e-5j, 0.02 + 0.03j, 0.1 - 4j])
@pytest.mark.parametrize("tap", [1.0, 1.05])
def test_a_fault_along_a_line_is_one_at_a_bus_there(at, z_f, tap):
    values = {"l.fault.on": 1.0, "l.fault.at": at, "l.fault.R": z_f.real, "l.fault.X": z_f.imag}
    found = evaluated(Line("l", "a", "b", **LINE, tap=tap, faulted=True), values)
    y_a, y_b = 1 / (at * Z), 1 / ((1 - at) * Z)
    b, rest = 0.5j * B * (1 - OPEN_CHARGING), 0.5j * B * OPEN_CHARGING
    b_a, b_b = at * b, (1 - at) * b  # each part is a π section with its own charging
    v = solved(
        [
            [(y_a + b_a + rest) / tap**2, 0, -y_a / tap],
            [0, y_b + b_b + rest, -y_b],
            [-y_a / tap, -y_b, y_a + b_a + y_b + b_b + 1 / z_f],
        ]
    )
    assert voltages(found) == pytest.approx(v[:2], rel=1e-8)
    current = complex(found["l.fault.i_re"], found["l.fault.i_im"])
    assert current == pytest.approx(v[2] / z_f, rel=1e-7)
    power = v[0] * np.conj((v[0] / tap - v[2]) * y_a / tap)
    assert complex(found["l.p"], found["l.q"]) == pytest.approx(power, rel=1e-7)


@pytest.mark.parametrize("end", ["from", "to"])
def test_a_line_that_is_open_at_one_end_stays_charged_from_the_other(end):
    found = evaluated(Line("l", "a", "b", **LINE, has_ends=True), {f"l.{end}_connected": 0.0})
    y, b = 1 / Z, 0.5j * B * (1 - OPEN_CHARGING)
    rest = 0.5j * B * OPEN_CHARGING
    charged = y + b - y**2 / (y + b)
    Y = [[rest, 0], [0, rest]]
    Y[end == "from"][end == "from"] += charged
    v = solved(Y)
    assert voltages(found) == pytest.approx(v, rel=1e-9)
    drawn = v[0] * np.conj(v[0] * (charged - b)) if end == "to" else 0
    assert complex(found["l.p"], found["l.q"]) == pytest.approx(drawn, rel=1e-9, abs=1e-12)


def test_a_fault_on_a_line_that_is_open_at_one_end():
    values = {"l.fault.on": 1.0, "l.fault.at": 0.3, "l.fault.R": 0.01, "l.to_connected": 0.0}
    found = evaluated(Line("l", "a", "b", **LINE, has_ends=True, faulted=True), values)
    b, rest = 0.5j * B * (1 - OPEN_CHARGING), 0.5j * B * OPEN_CHARGING
    y_a, y_b, z_f = 1 / (0.3 * Z), 1 / (0.7 * Z), 0.01 + 1e-5j
    b_a, b_b = 0.3 * b, 0.7 * b
    far = y_b + b_b - y_b**2 / (y_b + b_b)
    v = solved(
        [[y_a + b_a + rest, 0, -y_a], [0, rest, 0], [-y_a, 0, y_a + b_a + far + 1 / z_f]],
    )
    assert voltages(found) == pytest.approx(v[:2], rel=1e-8)
    assert complex(found["l.fault.i_re"], found["l.fault.i_im"]) == pytest.approx(
        v[2] / z_f, rel=1e-8
    )


@pytest.mark.parametrize("charging", [0.0, 0.3])
def test_an_open_line_takes_nothing_wherever_its_ends_and_its_fault_are(charging):
    line = Line("l", "a", "b", X=0.1, B=charging, has_ends=True, faulted=True)
    values = {"l.connected": 0.0, "l.from_connected": 0.0, "l.fault.on": 1.0}
    for given in ({}, values, values | {"l.to_connected": 0.0}):
        found = evaluated(line, {"l.connected": 0.0} | given)
        rest = 0.5j * charging * OPEN_CHARGING
        assert voltages(found) == pytest.approx(solved([[rest, 0], [0, rest]]), rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("more", [{"has_ends": True}, {"faulted": True}])
def test_a_network_with_transients_refuses_them(more):
    line = Line("l", "a", "b", X=0.1, B=0.1, **more)
    with pytest.raises(ValueError, match="line 'l': ends that switch one by one"):
        grid(Network("n", ("a", "b"), (line,), (Load("x", "b", 10.0),), (Port("u", "a"),)))
