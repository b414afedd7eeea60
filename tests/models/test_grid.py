"""The grid model with ratios, shunts and switches, against the nodal admittance matrix of the literature."""

import cmath
from itertools import pairwise

import numpy as np
import pytest

from fmus.grid.grid import grid
from fmus.grid.network import Line, Load, Network, Port, Shunt
from orchestrator.cases.flow.balance import FlowLine, FlowLoad, FlowShunt
from orchestrator.cases.flow.power_flow import FlowUnit, solve_power_flow
from tests.support.jacobians import jacobians

LINES = (
    Line("ab", "a", "b", X=0.1, R=0.01, B=0.04),
    Line("bc", "b", "c", X=0.08, R=0.004, tap=0.95, shift=0.2),
    Line("cd", "c", "d", X=0.15, R=0.02, B=0.06, tap=1.04),
    Line("da", "d", "a", X=0.12, R=0.01, B=0.05, shift=-0.15),
)
NETWORK = Network(
    "switched",
    ("a", "b", "c", "d", "e"),
    (*LINES, Line("de", "d", "e", X=0.05)),
    (Load("town", "b", 60, 20), Load("works", "d", 80, -15), Load("camp", "c", 30, 10)),
    (Port("g", "a"), Port("h", "e")),
    (Shunt("bank", "b", b_mvar=20), Shunt("reactor", "d", g_mw=2, b_mvar=-30)),
    stray_B=0.02,
)
BUSES = NETWORK.buses


def flow_of(opened=(), tripped=(), network=NETWORK):
    """The power flow of the network, some lines open and some loads switched off."""
    lines = [
        FlowLine(
            *(getattr(x, n) for n in ("name", "from_bus", "to_bus", "R", "X", "B", "tap", "shift")),
            closed=x.name not in opened,
        )
        for x in network.lines
    ]
    loads = [FlowLoad(x.bus, x.p_mw, x.q_mvar) for x in network.loads if x.name not in tripped]
    shunts = [FlowShunt(x.bus, x.g_mw / 100, x.b_mvar / 100) for x in network.shunts]
    shunts += [
        FlowShunt(bus, 0, network.stray_B) for bus in network.buses if network.needs_stray(bus)
    ]
    units = [FlowUnit("g", "a", 200, 0.5, 1.02), FlowUnit("h", "e", 100, 0.7, 1.01)]
    return solve_power_flow(network.buses, lines, loads, units, "a", shunts)


def matpower_admittances(network, opened=(), open_charging=1e-3):
    """Ybus as MATPOWER's manual writes it: Yff = (y + jB/2)/τ², Yft = −y/τe^{−jθ}, Ytf = −y/τe^{jθ}, Ytt = y + jB/2."""
    Y = np.zeros((len(network.buses),) * 2, complex)
    for line in network.lines:
        f, t = network.buses.index(line.from_bus), network.buses.index(line.to_bus)
        y = 0 if line.name in opened else 1 / complex(line.R, line.X)
        charging = 0.5j * line.B * (open_charging if line.name in opened else 1)
        Y[f, f] += (y + charging) / line.tap**2
        Y[f, t] -= y / (line.tap * cmath.exp(-1j * line.shift))
        Y[t, f] -= y / (line.tap * cmath.exp(1j * line.shift))
        Y[t, t] += y + charging
    for shunt in network.shunts:
        k = network.buses.index(shunt.bus)
        Y[k, k] += complex(shunt.g_mw, shunt.b_mvar) / 100
    for bus in network.buses:
        if network.needs_stray(bus):
            k = network.buses.index(bus)
            Y[k, k] += 1j * network.stray_B
    return Y


class Running:
    """The model started from a power flow, with the currents of its two units."""

    def __init__(self, flow, network=NETWORK, **values):
        self.model = grid(network)
        self.names = [v.name for v in self.model.parameters]
        start = {f"{b}.v_0": abs(v) for b, v in flow.voltages.items()}
        start |= {f"{b}.theta_0": cmath.phase(v) for b, v in flow.voltages.items()} | values
        self.p = np.array([start.get(v.name, v.start) for v in self.model.parameters])
        self.c, x = self.model.initialise(self.p)
        self.x = np.array(x).ravel()
        ratings = {"g": 2.0, "h": 1.0}
        feeding = {
            p.name: (flow.powers[p.name] * ratings[p.name] / flow.voltages[p.bus]).conjugate()
            for p in network.ports
        }
        self.u = np.array([part for i in feeding.values() for part in (i.real, i.imag)])

    def set(self, **values):
        for name, value in values.items():
            self.p[self.names.index(name.replace("__", "."))] = value

    def settle(self, seconds, step=2e-5):
        """L-stable implicit Euler steps to a steady state or, with short steps, along the way to it."""
        A, B = (
            np.array(block) for block in jacobians(self.model)(self.x, self.u, self.p, self.c)[:2]
        )
        advance = np.linalg.inv(np.eye(len(A)) - step * A)
        for _ in range(round(seconds / step)):
            self.x = advance @ (self.x + step * B @ self.u)

    def stand(self):
        """The steady state for the present parameters and inputs."""
        A, B = (
            np.array(block) for block in jacobians(self.model)(self.x, self.u, self.p, self.c)[:2]
        )
        self.x = np.linalg.solve(A, -B @ self.u)

    @property
    def rates(self):
        return np.array(self.model.derivatives(self.x, self.u, self.p, self.c)).ravel()

    @property
    def y(self):
        values = np.array(self.model.outputs_function(self.x, self.u, self.p, self.c)).ravel()
        return dict(zip((o.name for o in self.model.outputs), values, strict=True))

    def voltage(self, bus):
        return complex(self.y[f"{bus}.v_re"], self.y[f"{bus}.v_im"])

    def state(self, name):
        names = [s.name for s in self.model.states]
        return complex(self.x[names.index(f"{name}.i_re")], self.x[names.index(f"{name}.i_im")])


@pytest.mark.parametrize("opened", [(), ("bc",), ("cd",), ("da",)])
def test_the_power_flow_is_the_steady_state_and_both_fit_the_literatures_admittances(opened):
    flow = flow_of(opened)
    assert flow.residual <= 1e-9
    running = Running(flow, **{f"{name}.connected": 0.0 for name in opened})
    fastest = np.abs(
        np.array(jacobians(running.model)(running.x, running.u, running.p, running.c)[0])
    ).max()
    # [pu/s]; rounding times the fastest rate
    assert np.abs(running.rates).max() < 1e-12 * fastest * 10
    v = np.array([flow.voltages[bus] for bus in BUSES])
    injected = np.zeros(5, complex)
    injected[[0, 4]] = running.u[0::2] + 1j * running.u[1::2]
    for load in NETWORK.loads:
        k = BUSES.index(load.bus)
        injected[k] -= (complex(load.p_mw, load.q_mvar) / 100 / v[k]).conjugate()
    assert np.abs(matpower_admittances(NETWORK, opened) @ v - injected).max() < 1e-9
    for line in LINES:
        p, q = running.y[f"{line.name}.p"], running.y[f"{line.name}.q"]
        v_from, v_to = flow.voltages[line.from_bus], flow.voltages[line.to_bus]
        y = 0 if line.name in opened else 1 / complex(line.R, line.X)
        current = v_from * y / line.tap**2 - v_to * y / (line.tap * cmath.exp(-1j * line.shift))
        assert complex(p, q) == pytest.approx(v_from * current.conjugate(), abs=1e-9)


def test_a_line_trips_and_recloses():
    running = Running(flow_of())
    before = running.x.copy()
    at_trip = running.state("cd")
    running.set(cd__connected=0)
    running.settle(1e-3, 1e-6)
    # τ = 1 ms, whatever the voltages do
    assert running.state("cd") == pytest.approx(at_trip / np.e, rel=1e-3)
    running.settle(0.03)
    assert abs(running.state("cd")) < 1e-10
    assert running.y["cd.p"] == pytest.approx(0, abs=1e-10)
    running.stand()
    v = np.array([running.voltage(bus) for bus in BUSES])
    Y = matpower_admittances(NETWORK, ("cd",))
    flow = flow_of()
    for load in NETWORK.loads:  # constant impedance from the voltage before the trip
        k = BUSES.index(load.bus)
        Y[k, k] += complex(load.p_mw, -load.q_mvar) / 100 / abs(flow.voltages[load.bus]) ** 2
    injected = np.zeros(5, complex)
    injected[[0, 4]] = running.u[0::2] + 1j * running.u[1::2]
    assert np.abs(Y @ v - injected).max() < 1e-10
    running.set(cd__connected=1)
    running.settle(4.0, 1e-4)
    assert running.x == pytest.approx(before, abs=1e-9)


def test_a_load_that_is_switched_off_and_on_comes_back_without_a_direct_component():
    running = Running(flow_of())
    before = running.x.copy()
    running.set(town__scale=0)
    running.settle(0.3, 1e-4)
    running.stand()
    v = np.array([running.voltage(bus) for bus in BUSES])
    flow, Y = flow_of(), matpower_admittances(NETWORK)
    for load in NETWORK.loads[1:]:
        k = BUSES.index(load.bus)
        Y[k, k] += complex(load.p_mw, -load.q_mvar) / 100 / abs(flow.voltages[load.bus]) ** 2
    injected = np.zeros(5, complex)
    injected[[0, 4]] = running.u[0::2] + 1j * running.u[1::2]
    assert np.abs(Y @ v - injected).max() < 1e-10
    running.set(town__scale=1)
    running.stand()
    assert running.x == pytest.approx(before, abs=1e-9)


def test_an_inductive_load_follows_its_voltage_while_it_is_off():
    running = Running(flow_of(), **{"camp.scale": 0.0})
    running.stand()
    X = abs(flow_of().voltages["c"]) ** 2 / 0.1
    assert running.state("camp") == pytest.approx(running.voltage("c") / (1j * X), abs=1e-12)


def test_an_open_port_feeds_nothing_and_its_power_says_so():
    flow = flow_of()
    running = Running(flow)
    assert running.y["h.p"] == pytest.approx(0.7, abs=1e-9)
    assert running.y["g.q"] == pytest.approx(flow.powers["g"].imag * 2, abs=1e-9)
    running.set(h__connected=0)
    running.settle(0.5, 1e-4)
    assert (running.y["h.p"], running.y["h.q"]) == (0, 0)
    running.stand()
    through = complex(running.y["de.p"], running.y["de.q"])
    assert through.real == pytest.approx(0, abs=1e-12)
    assert through.imag == pytest.approx(
        -0.02 * abs(running.voltage("e")) ** 2 + 0.05 * abs(running.state("de")) ** 2
    )


def test_the_scale_of_a_load_that_alone_holds_a_voltage_stays_above_zero():
    network = Network(
        "few",
        ("a", "b"),
        (Line("ab", "a", "b", X=0.1),),
        (Load("only", "a", 50, 10), Load("one", "b", 50), Load("other", "b", 50)),
        (),
    )
    model = grid(network)
    scales = {v.name: v for v in model.parameters if v.name.endswith(".scale")}
    assert scales["only.scale"].minimum == 1e-6
    assert "nothing else determines the voltage" in scales["only.scale"].description
    assert scales["one.scale"].minimum == scales["other.scale"].minimum == 0
    assert len(model.requirement_texts) == 2
    p = np.array(
        [0.0 if v.name in ("one.scale", "other.scale") else v.start for v in model.parameters]
    )
    assert min(np.array(model.requirements(p, [])).ravel()) <= 0
    assert (
        "the voltage of b hangs on its loads; leave one of them switched on"
        in model.requirement_texts
    )


def test_states_and_parameters_only_where_something_is():
    names = {v.name for v in grid(NETWORK).parameters}
    assert {
        "tap_bc",
        "shift_bc",
        "tap_cd",
        "shift_cd",
        "reactor.G",
        "reactor.B",
        "bank.B",
        "stray_B",
    } <= names
    assert not {"tap_ab", "shift_ab", "B_bc", "bank.G"} & names


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            {"lines": (Line("ab", "a", "b", X=0.0),)},
            "'ab' has the reactance 0 pu between buses 'a' and 'b'",
        ),
        ({"lines": (Line("ab", "a", "b", X=-0.1),)}, "give a series capacitor as X_C of the line"),
        ({"lines": (Line("ab", "a", "b", X=0.1, R=-1),)}, "'ab' has the resistance -1 pu between"),
        (
            {"lines": (Line("ab", "a", "b", X=0.1, tap=0),)},
            "has the ratio 0 between buses 'a' and 'b'",
        ),
        ({"loads": ()}, "bus 'b' has neither a load with P > 0 nor line charging.*stray_B = 0.05"),
        ({"shunts": (Shunt("s", "z", 1, 1),)}, "shunt 's' is at bus 'z', which does not exist"),
        ({"stray_B": -1}, "stray_B = -1 pu; it must not be negative"),
    ],
)
def test_what_a_network_cannot_be(change, words):
    parts = {
        "lines": (Line("ab", "a", "b", X=0.1),),
        "loads": (Load("d", "b", 10),),
        "shunts": (Shunt("s", "a", 1),),
    }
    with pytest.raises(ValueError, match=words):
        Network("wrong", ("a", "b"), **(parts | {"ports": ()} | change))


def test_of_many_floating_buses_the_first_ten_are_named():
    names = tuple(f"b{k:02}" for k in range(13))
    lines = tuple(Line(f"l{k}", a, b, X=0.1) for k, (a, b) in enumerate(pairwise(names)))
    with pytest.raises(ValueError, match=r"buses 'b01', .*'b10', … have neither"):
        Network("wide", names, lines, (Load("d", "b00", 10),), ())
