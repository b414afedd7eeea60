"""Our power flow against pandapower's on published networks, its limits of reactive power, and what it says when there
is no solution.
"""

import cmath
import math
from functools import cache

import numpy as np
import pytest

from orchestrator.cases.flow.balance import FlowLine, FlowLoad, FlowShunt
from orchestrator.cases.flow.equations import FlowEquations
from orchestrator.cases.flow.newton import _newton, solve
from orchestrator.cases.flow.power_flow import FlowUnit, explain, solve_power_flow
from orchestrator.cases.networks import conversion as network_import
from orchestrator.cases.networks.sources import _pandapower_tables
from orchestrator.core.errors import InputError
from tests.support.late import LateLibrary
from tests.support.pandapower_networks import pandapower_network

pandapower = LateLibrary("pandapower")
pytestmark = pytest.mark.filterwarnings("ignore:tap_dependency_table:DeprecationWarning")
SMALL = ["case9", "case14", "case39", "case57", "case118"]


@cache
def of_pandapower(name, **options):
    """A network solved by pandapower: its elements in our form, voltages by bus, and itself; nobody changes them."""
    net = pandapower_network(name)
    pandapower.runpp(
        net,
        calculate_voltage_angles=True,
        numba=False,
        tolerance_mva=1e-9,
        voltage_depend_loads=False,
        **options,
    )
    source = _pandapower_tables(name, net)
    demand = {int(row[0]): complex(row[2], row[3]) for row in source.bus}
    buses = {n: network_import.bus_of(label) for n, label in source.labels.items()}
    # loads that feed have no element of their own in every version of the import
    source.bus[:, 2:4] = 0.0
    data = network_import.import_network(source)
    lines = [
        FlowLine(x.name, x.from_bus, x.to_bus, x.R, x.X, x.B, x.tap, x.shift) for x in data.lines
    ]
    shunts = [FlowShunt(x.bus, x.g_mw / 100, x.b_mvar / 100) for x in data.shunts]
    loads = [FlowLoad(buses[n], s.real, s.imag) for n, s in demand.items() if s]
    units = [FlowUnit(bus, bus, 100.0, g.p_mw / 100, g.v_pu) for bus, g in data.generation.items()]
    place = net._pd2ppc_lookups["bus"]
    voltages = {
        buses[int(place[i])]: net.res_bus.vm_pu[i]
        * np.exp(1j * np.deg2rad(net.res_bus.va_degree[i]))
        for i in net.bus.index
    }
    turn = voltages[data.slack] / abs(voltages[data.slack])
    limits = {bus: (g.q_min_mvar / 100, g.q_max_mvar / 100) for bus, g in data.generation.items()}
    elements = data.buses, lines, loads, units, data.slack, shunts, limits
    return elements, {b: v / turn for b, v in voltages.items()}, net


@pytest.mark.parametrize(
    "name",
    [
        *SMALL,
        pytest.param("case300", marks=pytest.mark.slow),
        pytest.param("case1354pegase", marks=pytest.mark.slow),
    ],
)
def test_voltages_are_pandapowers(name):
    elements, voltages, _ = of_pandapower(name)
    flow = solve_power_flow(*elements)
    # a branch of negative reactance is merged with its star point, which is no bus then
    assert len(flow.voltages) >= len(voltages) - 1
    assert max(abs(v - voltages[bus]) for bus, v in flow.voltages.items()) < 1e-9
    assert flow.residual < 1e-10


@pytest.mark.parametrize("name", ["case9", "case14", "case39"])
def test_flows_and_losses_are_pandapowers(name):
    elements, _, net = of_pandapower(name)
    flow = solve_power_flow(*elements)
    ours = [
        line.powers(flow.voltages[line.from_bus], flow.voltages[line.to_bus]) for line in flow.lines
    ]
    lines, trafos = net.res_line, net.res_trafo
    theirs = [
        *zip(
            lines.p_from_mw + 1j * lines.q_from_mvar,
            lines.p_to_mw + 1j * lines.q_to_mvar,
            strict=True,
        ),
        *zip(
            trafos.p_hv_mw + 1j * trafos.q_hv_mvar,
            trafos.p_lv_mw + 1j * trafos.q_lv_mvar,
            strict=True,
        ),
    ]
    assert len(ours) == len(theirs)
    for part in (np.real, np.imag):
        sums = [
            np.sort([100 * part(a + b) for a, b in ours]),
            np.sort([part(a + b) for a, b in theirs]),
        ]
        ends = [
            np.sort([100 * part(x) for pair in ours for x in pair]),
            np.sort([part(x) for p in theirs for x in p]),
        ]
        assert np.abs(sums[0] - sums[1]).max() < 1e-5
        assert np.abs(ends[0] - ends[1]).max() < 1e-5


def equations_of(elements):
    buses, lines, loads, units, slack, shunts, _ = elements
    active = {u.bus: u.P_0 * u.S_n / 100 for u in units}
    return FlowEquations.of(
        buses, lines, loads, shunts, active, {u.bus: u.v_0 for u in units}, slack
    )


def test_the_solution_does_not_depend_on_the_start(monkeypatch):
    """From the DC angles and from a flat start: the same numbers but for the last bit."""
    equations = equations_of(of_pandapower("case118")[0])
    first = solve(equations)
    monkeypatch.setattr(FlowEquations, "dc_angles", lambda self: np.zeros(len(self.buses)))
    flat = solve(equations)
    assert flat.history != first.history
    assert np.abs(flat.voltages - first.voltages).max() < 1e-15


def test_the_jacobian_is_the_derivative_of_the_mismatch():
    equations = equations_of(of_pandapower("case14")[0])
    rng = np.random.default_rng(5)
    angle, magnitude = rng.uniform(-0.3, 0.3, 14), rng.uniform(0.9, 1.1, 14)
    jacobian = equations.jacobian(magnitude * np.exp(1j * angle)).toarray()
    count, step = len(equations.angle_buses), 1e-6
    for k in range(jacobian.shape[1]):
        moved = []
        for sign in (1, -1):
            a, m = angle.copy(), magnitude.copy()
            if k < count:
                a[equations.angle_buses[k]] += sign * step
            else:
                m[equations.free_buses[k - count]] += sign * step
            moved.append(equations.mismatch(m * np.exp(1j * a)))
        assert jacobian[:, k] == pytest.approx((moved[0] - moved[1]) / (2 * step), abs=1e-7)


def test_limits_of_reactive_power_as_pandapower_keeps_them():
    elements, voltages, _ = of_pandapower("case118", enforce_q_lims=True)
    free = solve_power_flow(*elements)
    assert len(free.beyond_limits) > 3
    assert not free.at_limits
    kept = solve_power_flow(*elements, keep_limits=True)
    assert {e.bus for e in kept.at_limits} >= {e.bus for e in free.beyond_limits} - {elements[4]}
    assert max(abs(kept.voltages[bus] - v) for bus, v in voltages.items()) < 1e-8
    for excess in kept.at_limits:
        assert kept.powers[excess.bus].imag == pytest.approx(excess.limit, abs=1e-9)


def test_a_bus_at_its_limit_by_the_formula():
    """A unit that may feed Q = 0.2 pu over a line of X: v² − v·v₁ = X·Q without active power."""
    X, v_1, most = 0.2, 1.0, 0.2
    arguments = (
        ["a", "b"],
        [FlowLine("l", "a", "b", 0.0, X, 0.0)],
        [],
        [FlowUnit("s", "a", 100, 0, v_1), FlowUnit("u", "b", 50, 0, 1.1)],
        "a",
        (),
        {"b": (-0.1, most)},
    )
    flow = solve_power_flow(*arguments, keep_limits=True)
    assert abs(flow.voltages["b"]) == pytest.approx(
        (v_1 + np.sqrt(v_1**2 + 4 * X * most)) / 2, abs=1e-12
    )
    assert flow.powers["u"].imag == pytest.approx(0.4, abs=1e-12)  # on 50 MVA
    (excess,) = flow.at_limits
    assert (
        excess.text(kept=True) == "'b' at its limit of 20 Mvar, voltage 1.0385 instead of 1.1000 pu"
    )
    (named,) = solve_power_flow(*arguments).beyond_limits
    assert named.text(kept=False) == "'b' feeds 55 Mvar, its most being 20 Mvar"


def test_stray_capacitance_behind_a_large_reactance_is_named():
    """Behind X a bus with capacitance B gets P only if |1 − X·B|·X·P ≤ 1/2; with 9 MW and X = 5 pu, B ≤ 0.42 pu."""

    def flow(b):
        return solve_power_flow(
            ["a", "b"],
            [FlowLine("l", "a", "b", 0.0, 5.0, 0.0)],
            [FlowLoad("b", 9.0, 0.0)],
            [FlowUnit("u", "a", 100, 0, 1.0)],
            "a",
            [FlowShunt("b", 0.0, b, stray=True)],
        )

    assert abs(flow(0.0).voltages["b"]) < 1
    with pytest.raises(
        InputError, match=r"It has a solution with 75 % of stray_B: .*lower stray_B"
    ):
        flow(0.5)


def test_a_collapsed_voltage_is_no_solution():
    """With P below the limit of a line the equations have two solutions; the lower one is not taken for the state."""
    P, X = 0.5, 0.2
    buses, line = ["a", "b"], FlowLine("l", "a", "b", 0.0, X, 0.0)
    equations = FlowEquations.of(
        buses, [line], [FlowLoad("b", 100 * P, 0.0)], [], {"a": 0.0}, {"a": 1.0}, "a"
    )
    low = np.sqrt((1 - np.sqrt(1 - 4 * X**2 * P**2)) / 2)
    start = np.array([1.0, low * np.exp(-1j * np.arcsin(P * X / low))])
    result = _newton(equations, start)
    assert result.history[-1][0] < 1e-9
    assert abs(result.voltages[1]) == pytest.approx(low, abs=1e-9)
    assert not result.converged
    assert "collapsed voltages, 0.101 pu at bus 'b'" in explain(equations, result, None)


def test_a_transformer_with_a_leg_near_zero_and_a_shift_is_found():
    """From 1 pu everywhere no step of Newton's leads to the ratio behind a reactance of 8e-6 pu."""
    lines = [
        FlowLine("one", "a", "star", X=0.06, R=0.001, B=0.0, tap=400 / 380, shift=0.0),
        FlowLine("two", "b", "star", X=-8e-6, R=0.0, B=0.0, tap=120 / 110, shift=0.0),
        FlowLine("three", "c", "star", X=0.14, R=0.003, B=0.0, tap=1.0, shift=-math.pi / 6),
    ]
    units = [FlowUnit("u", "a", S_n=100, P_0=0.0, v_0=1.0)]
    flow = solve_power_flow(["a", "b", "c", "star"], lines, [FlowLoad("c", 5.0, 0.0)], units, "a")
    star = flow.voltages["star"]
    assert abs(star) == pytest.approx(380 / 400, abs=1e-3)
    assert flow.voltages["b"] == pytest.approx(star * 120 / 110, abs=1e-9)
    assert math.degrees(cmath.phase(flow.voltages["c"] / star)) == pytest.approx(-30.44, abs=0.01)
