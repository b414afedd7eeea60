"""The power flow against formulas for two buses and against the balance of every bus."""

import cmath
import math

import numpy as np
import pytest

from orchestrator.cases.flow.power_flow import FlowLine, FlowLoad, FlowUnit, solve_power_flow
from orchestrator.core.errors import InputError

TOLERANCE = 1e-9
X = 0.2


def test_a_load_at_the_end_of_a_line():
    """|v|² = (1 − 2XQ + √((1 − 2XQ)² − 4X²(P² + Q²)))/2 and sin δ = −PX/|v|."""
    P, Q = 0.8, 0.3
    flow = solve_power_flow(
        ["source", "end"],
        [FlowLine("line", "source", "end", R=0.0, X=X, B=0.0)],
        [FlowLoad("end", P * 100, Q * 100)],
        [FlowUnit("unit", "source", S_n=200.0, P_0=0.0, v_0=1.0)],
        "source",
    )
    b = 1 - 2 * X * Q
    v = math.sqrt((b + math.sqrt(b**2 - 4 * X**2 * (P**2 + Q**2))) / 2)
    expected = cmath.rect(v, -math.asin(P * X / v))
    assert flow.voltages["source"] == pytest.approx(1.0, abs=TOLERANCE)
    assert flow.voltages["end"] == pytest.approx(expected, abs=TOLERANCE)
    losses = X * (P**2 + Q**2) / v**2
    # on 200 MVA
    assert flow.powers["unit"] == pytest.approx(complex(P, Q + losses) / 2, abs=TOLERANCE)
    assert flow.residual < TOLERANCE


def test_two_sources_at_the_ends_of_a_line():
    """P = v₁v₂ sin δ/X, and what each unit feeds is on its own rating."""
    v_1, v_2, P = 1.02, 0.97, 1.5
    flow = solve_power_flow(
        ["one", "two"],
        [FlowLine("line", "one", "two", R=0.0, X=X, B=0.0)],
        [],
        [FlowUnit("slack", "two", 400.0, 0.0, v_2), FlowUnit("unit", "one", 300.0, P / 3, v_1)],
        "two",
    )
    delta = math.asin(P * X / (v_1 * v_2))
    assert flow.voltages["one"] == pytest.approx(cmath.rect(v_1, delta), abs=TOLERANCE)
    q_1 = (v_1**2 - v_1 * v_2 * math.cos(delta)) / X
    q_2 = (v_2**2 - v_1 * v_2 * math.cos(delta)) / X
    assert flow.powers["unit"] == pytest.approx(complex(P, q_1) / 3, abs=TOLERANCE)
    assert flow.powers["slack"] == pytest.approx(complex(-P, q_2) / 4, abs=TOLERANCE)


@pytest.mark.parametrize("shift", [0.3, -0.2])
def test_a_phase_shifter_turns_the_voltage_behind_it_back(shift):
    """The ratio tap·e^{j·shift} stands at the from side, as MATPOWER has it: behind it v = v₁/(tap·e^{j·shift})."""
    flow = solve_power_flow(
        ["one", "two"],
        [FlowLine("shifter", "one", "two", R=0.0, X=X, B=0.0, tap=1.05, shift=shift)],
        [FlowLoad("two", 60.0, 0.0)],
        [FlowUnit("unit", "one", 100.0, 0.0, 1.02)],
        "one",
    )
    behind = 1.02 / 1.05
    v = math.sqrt((behind**2 + math.sqrt(behind**4 - 4 * (0.6 * X) ** 2)) / 2)
    expected = cmath.rect(v, -shift - math.asin(0.6 * X / (v * behind)))
    assert flow.voltages["two"] == pytest.approx(expected, abs=TOLERANCE)


def test_every_bus_of_a_meshed_network_is_in_balance():
    buses = ["a", "b", "c", "d"]
    lines = [
        FlowLine("ab", "a", "b", 0.01, 0.10, 0.04),
        FlowLine("bc", "b", "c", 0.02, 0.15, 0.00),
        FlowLine("ca", "c", "a", 0.00, 0.08, 0.06),
        FlowLine("cd", "c", "d", 0.03, 0.20, 0.02),
        FlowLine("cd again", "c", "d", 0.05, 0.25, 0.02),
    ]
    loads = [
        FlowLoad("b", 90, 30),
        FlowLoad("d", 60, -10),
        FlowLoad("d", 20, 5),
        FlowLoad("a", 10, 0),
    ]
    units = [
        FlowUnit("s", "a", 100.0, 0.9, 1.01),
        FlowUnit("t", "a", 50.0, 0.1, 1.01),
        FlowUnit("g", "d", 100.0, 0.5, 1.0),
    ]
    flow = solve_power_flow(buses, lines, loads, units, "a")

    Y = np.zeros((4, 4), complex)
    for line in lines:
        i, j = buses.index(line.from_bus), buses.index(line.to_bus)
        y = 1 / complex(line.R, line.X)
        Y[[i, j], [i, j]] += y + 0.5j * line.B
        Y[[i, j], [j, i]] -= y
    v = np.array([flow.voltages[bus] for bus in buses])
    injected = np.zeros(4, complex)
    for unit in units:
        injected[buses.index(unit.bus)] += flow.powers[unit.name] * unit.S_n / 100
    for load in loads:
        injected[buses.index(load.bus)] -= complex(load.p_mw, load.q_mvar) / 100
    assert np.abs(v * (Y @ v).conj() - injected).max() < TOLERANCE
    assert flow.residual < TOLERANCE
    assert np.abs(v[[0, 3]]) == pytest.approx([1.01, 1.0], abs=TOLERANCE)
    assert flow.powers["g"].real == 0.5


def test_units_at_one_bus_share_by_rating():
    """At the slack bus active and reactive power, elsewhere reactive power alone."""
    flow = solve_power_flow(
        ["a", "b"],
        [FlowLine("line", "a", "b", 0.0, X, 0.0)],
        [FlowLoad("a", 50, 20), FlowLoad("b", 60, 40)],
        [
            FlowUnit("large", "a", 300.0, 0.0, 1.0),
            FlowUnit("small", "a", 100.0, 0.9, 1.0),
            FlowUnit("busy", "b", 50.0, 0.8, 1.0),
            FlowUnit("idle", "b", 150.0, 0.0, 1.0),
        ],
        "a",
    )
    powers = flow.powers
    assert powers["large"] == pytest.approx(powers["small"], abs=TOLERANCE)
    assert powers["large"].real == pytest.approx((50 + 60 - 40) / 400, abs=TOLERANCE)
    assert (powers["busy"].real, powers["idle"].real) == (0.8, 0.0)
    assert powers["busy"].imag == pytest.approx(powers["idle"].imag, abs=TOLERANCE)
    # of 200 MVA: the load's 40 Mvar and half of what the line consumes
    assert powers["busy"].imag > 0.2


def test_more_than_a_line_can_carry():
    """At unity power factor no more than 1/(2X) reaches a bus whose voltage nobody holds."""

    def solve(p_mw):
        line = FlowLine("line", "a", "b", 0.0, X, 0.0)
        return solve_power_flow(
            ["a", "b"], [line], [FlowLoad("b", p_mw, 0)], [FlowUnit("u", "a", 1e3, 0, 1.0)], "a"
        )

    assert abs(solve(0.99 * 100 / (2 * X)).voltages["b"]) > math.sqrt(0.5)
    with pytest.raises(InputError) as caught:
        solve(1.01 * 100 / (2 * X))
    text = str(caught.value)
    assert text.startswith("power flow: no solution found. The iterations end with ")
    assert "at bus 'b' (largest mismatch by iteration: " in text
    assert (
        "With all loads and all units' power at 99 % it has a solution: the lines cannot carry the power"
        in text
    )
    assert "Lower P_0 or the loads, or the line reactances" in text
    assert text.endswith("deg), X = 0.2 pu, which would carry 252 MW")
    for times, share in ((1.0005, "99 %"), (4000, "0 %")):
        with pytest.raises(InputError, match=f"power at {share} it has a solution"):
            solve(times * 100 / (2 * X))
    with pytest.raises(InputError, match="Is a power in kW"):
        solve(4000 * 100 / (2 * X))


def test_units_at_one_bus_that_want_two_voltages():
    units = [
        FlowUnit("u", "a", 100, 0, 1.0),
        FlowUnit("w", "a", 100, 0, 1.02),
        FlowUnit("z", "b", 100, 0, 0.9),
    ]
    with pytest.raises(InputError) as caught:
        solve_power_flow(["a", "b"], [FlowLine("l", "a", "b", 0, X, 0)], [], units, "a")
    assert str(caught.value) == (
        "power flow: bus 'a' cannot have two voltages (u wants 1, w wants 1.02); give its units the same v_0"
    )


@pytest.mark.parametrize(
    "units", [[], [FlowUnit("w", "c", 100, 0.1, 1.0)]], ids=["load alone", "with a unit"]
)
def test_a_bus_without_a_way_to_the_slack(units):
    with pytest.raises(InputError, match="'c'"):
        solve_power_flow(
            ["a", "b", "c"],
            [FlowLine("l", "a", "b", 0, X, 0)],
            [FlowLoad("b", 50, 0), FlowLoad("c", 10, 0)],
            [FlowUnit("u", "a", 100, 0, 1.0), *units],
            "a",
        )


def test_limits_that_leave_no_solution_are_named_as_the_cause():
    """Power far beyond 1/(2X) goes to a bus that is held, but not to one whose unit is at its limit."""
    line = FlowLine("line", "a", "b", 0.0, X, 0.0)
    units = [FlowUnit("u", "a", 1e3, 0, 1.0), FlowUnit("w", "b", 1e3, 0, 1.0)]
    load = FlowLoad("b", 1.5 * 100 / (2 * X), 0)

    def solve(load, limits):
        return solve_power_flow(
            ["a", "b"], [line], [load], units, "a", limits=limits, keep_limits=True
        )

    assert abs(solve(load, {"b": (-9.0, 9.0)}).voltages["b"]) == pytest.approx(1.0)
    with pytest.raises(InputError) as caught:
        solve(load, {"b": (-0.1, 0.1)})
    text = str(caught.value)
    # Q at both ends is (1 - cos δ)/X with sin δ = 0.75
    assert f"'b' feeds {100 * (1 - math.sqrt(1 - 0.75**2)) / X:.4g} Mvar, its most being 10" in text
    assert "so these are the cause" in text
    assert "the lines cannot carry" not in text
    with pytest.raises(InputError, match="the lines cannot carry the power"):
        solve(FlowLoad("b", 2.1 * 100 / (2 * X), 0), {"b": (-0.1, 0.1)})
