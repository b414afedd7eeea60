"""Units that feed a given reactive power: the voltage of their bus follows, in the power flow and in a case."""

import cmath
import math

import pytest

from orchestrator.cases.flow.power_flow import FlowLine, FlowLoad, FlowUnit, solve_power_flow
from orchestrator.core.errors import CaseError, InputError
from tests.cases.form.test_case_files import THREE_BUSES
from tests.support.scenarios import prepare_one

FOLLOWING = THREE_BUSES.replace('model = "gfor"', 'model = "gfl"')
LINE = [FlowLine("line", "a", "b", R=0.0, X=0.2, B=0.0)]
SOURCE = FlowUnit("source", "a", 100.0, 0.0, 1.0)


def prepared(tmp_path, text):
    path = tmp_path / "case.toml"
    path.write_text(text, encoding="utf-8")
    ready = prepare_one(path)
    return ready


def only_problem(tmp_path, text):
    with pytest.raises(CaseError) as caught:
        prepared(tmp_path, text)
    (problem,) = caught.value.problems
    return f"{problem.place}: {problem.text}"


def test_the_voltage_follows_a_given_reactive_power():
    """As a load at the end of a line, which a formula gives; a unit feeds where a load draws."""
    P, Q = -0.8, -0.3  # drawn
    flow = solve_power_flow(
        ["a", "b"], LINE, [], [SOURCE, FlowUnit("u", "b", 50.0, 1.6, 1.3, Q_0=0.6)], "a"
    )
    b = 1 - 2 * 0.2 * Q
    v = math.sqrt((b + math.sqrt(b**2 - 4 * 0.04 * (P**2 + Q**2))) / 2)
    assert flow.voltages["b"] == pytest.approx(cmath.rect(v, -math.asin(P * 0.2 / v)), abs=1e-9)
    assert flow.powers["u"] == 1.6 + 0.6j
    assert flow.residual < 1e-9


def test_another_unit_at_the_bus_holds_its_voltage_and_feeds_the_rest():
    """Together they feed what one that holds the voltage feeds alone; at the slack bus, P as well."""
    fixed = FlowUnit("u", "b", 50.0, 0.4, 1.0, Q_0=0.1)
    loads = [FlowLoad("b", 60.0, 20.0)]
    alone = solve_power_flow(
        ["a", "b"], LINE, loads, [SOURCE, FlowUnit("v", "b", 100.0, 0.5, 1.02)], "a"
    )
    for slack in "ab":
        units = [SOURCE, fixed, FlowUnit("v", "b", 200.0, 0.15, 1.02)]
        both = solve_power_flow(["a", "b"], LINE, loads, units, slack)
        if slack == "a":
            assert 200 * both.powers["v"] + 50 * both.powers["u"] == pytest.approx(
                100 * alone.powers["v"], abs=1e-7
            )
        assert both.powers["u"] == 0.4 + 0.1j
        assert abs(both.voltages["b"]) == pytest.approx(1.02)
        assert both.residual < 1e-9


def test_limits_of_a_bus_hold_for_what_all_its_units_feed():
    units = [
        SOURCE,
        FlowUnit("u", "b", 100.0, 0.0, 1.0, Q_0=0.3),
        FlowUnit("v", "b", 100.0, 0.0, 1.05),
    ]
    free = solve_power_flow(
        ["a", "b"], LINE, [FlowLoad("b", 60, 20)], units, "a", (), {"b": (-1.0, 0.5)}
    )
    assert not free.at_limits + free.beyond_limits
    kept = solve_power_flow(
        ["a", "b"],
        LINE,
        [FlowLoad("b", 60, 20)],
        units,
        "a",
        (),
        {"b": (-1.0, 0.4)},
        keep_limits=True,
    )
    assert kept.powers["v"].imag == pytest.approx(0.1)
    assert abs(kept.voltages["b"]) < 1.05
    (excess,) = solve_power_flow(
        ["a", "b"], LINE, [], units[:2], "a", (), {"b": (-0.1, 0.25)}
    ).beyond_limits
    assert excess.text(kept=False) == "'b' feeds 30 Mvar, its most being 25 Mvar"


def test_a_limit_that_is_met_but_for_rounding_is_not_told():
    """Of 96 units of ACTIVSg2000 that are beyond a limit, two are by more than 0.1 Mvar, and were not seen."""
    for most, told in ((0.2995, 0), (0.2985, 1)):
        unit = FlowUnit("u", "b", 100.0, 0.0, 1.0, Q_0=0.3)
        flow = solve_power_flow(["a", "b"], LINE, [], [SOURCE, unit], "a", (), {"b": (-0.1, most)})
        assert len(flow.beyond_limits) == told


def test_the_slack_needs_a_unit_that_holds_a_voltage():
    with pytest.raises(
        InputError, match="no unit that holds a voltage is connected at the slack bus 'b'"
    ):
        solve_power_flow(
            ["a", "b"], LINE, [], [SOURCE, FlowUnit("u", "b", 100.0, 0.0, 1.0, Q_0=0.0)], "b"
        )


@pytest.mark.parametrize("model", ["gfl", "gfor"])
def test_a_converter_of_a_case_feeds_its_reactive_power(model, tmp_path):
    ready = prepared(
        tmp_path, FOLLOWING.replace('"gfl"', f'"{model}"').replace("v_0 = 1.01", "Q_0 = 0.1")
    )
    flow = ready.power_flow
    assert flow.powers["vsc"] == 0.8 + 0.1j
    assert ready.system.components["vsc"].parameters["v_0"] == abs(flow.voltages["b2"])
    assert 0.9 < abs(flow.voltages["b2"]) < 0.9999
    assert not ready.questions


def test_a_unit_that_says_neither_is_questioned(tmp_path):
    """Before, 1 pu was taken silently, with the reactive power that it happens to need."""
    text = FOLLOWING.replace(", v_0 = 1.01", "")
    (asked,) = prepared(tmp_path, text).questions
    assert asked.place == "line 16, components.vsc, v_0 (its default)"
    assert asked.text.startswith(
        "vsc: neither v_0 nor Q_0 is given: its default, v_0 = 1 pu, holds its bus there"
    )
    assert not prepared(tmp_path, 'meant = ["vsc.v_0"]\n' + text).questions


def test_a_unit_that_says_both_is_refused(tmp_path):
    text = FOLLOWING.replace("v_0 = 1.01", "v_0 = 1.01, Q_0 = 0.1")
    assert only_problem(tmp_path, text) == (
        "line 19, components.vsc.parameters.Q_0: vsc: Q_0 = 0.1 pu and v_0 = 1.01 pu are both set, and the power flow "
        "computes one from the other; remove v_0, and the unit feeds Q_0, or remove Q_0, and it holds v_0"
    )
