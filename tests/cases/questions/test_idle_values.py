"""A value that cannot act is asked about, and none that acts."""

import pytest

from orchestrator.cases.case import load_case
from orchestrator.cases.questions.idle_values import idle_everywhere, idle_values, why_idle
from orchestrator.studies.sweep.axes import parse_vary
from orchestrator.studies.sweep.request import SweepRequest
from orchestrator.studies.sweep.sweep import plan_sweep
from orchestrator.systems.coupling.system import System

CASE = load_case("two_area")


def asked(scenarios, values):
    first = CASE.prepare(scenarios, values)[0]
    return [
        str(question) for question in first.questions if question in idle_everywhere([first.idle])
    ]


@pytest.mark.parametrize(
    ("key", "name"), [("gfor.pod_p.K", "K"), ("gfor.pod_p.T_S1", "T_S1"), ("g*.pod_p.K", "K")]
)
def test_a_part_that_is_off_is_named_with_its_switch(key, name):
    (text,) = asked(["gfor"], {key: 0.1})
    assert text == f"--set {key}: gfor.pod_p.{name} cannot act: gfor.pod_p.enabled is false"


@pytest.mark.parametrize(
    ("scenarios", "values"),
    [
        (["pod_p"], {"gfor.pod_p.K": 250, "gfor.pod_p.T_S1": 0.1, "grid.X_L": 0.3}),
        (["gfor"], {"gfor.pod_p.K": 250, "gfor.pod_p.enabled": True}),
        (["gfor"], {"gfor.pod_p.K": 250, "gfor.pod_p.enabled": False}),  # who says so knows it
        (["gfor", "pod_p"], {"gfor.pod_p.K": 250}),  # it acts in one of them
        (["gfor"], {"gfor.P_0": 0.8}),
    ],
)
def test_what_acts_is_not_accused(scenarios, values):
    prepared = CASE.prepare(scenarios, values)
    assert idle_everywhere([one.idle for one in prepared]) == []
    assert not any("cannot act" in str(question) for one in prepared for question in one.questions)


def test_a_title_says_which_value_has_no_effect_in_its_scenario():
    """Of a value that is given to several scenarios where it cannot act alone; patterns count."""
    values = {"gfor.pod_p.K": 250, "grid.X_L": 0.3}
    off, on, lacking = CASE.prepare(["gfor", "pod_p", "base"], values)
    idle = "gfor.pod_p.K = 250 (without effect here), grid.X_L = 0.3"
    assert off.subject == f"{off.title}, with {idle}"
    assert on.subject == f"{on.title}, with gfor.pod_p.K = 250, grid.X_L = 0.3"
    assert lacking.about["subject"] == f"{lacking.title}, with {idle}"
    (of_pattern,) = CASE.prepare(["gfor"], {"g*.pod_p.K": 250})
    assert of_pattern.subject.endswith(", with g*.pod_p.K = 250 (without effect here)")


def test_lead_and_lag_of_a_gain_of_0_and_what_is_connected_with_nothing():
    (prepared,) = CASE.prepare(["pod_p"], {"gfor.pod_p.K": 0.0})
    assert why_idle(prepared.system, "gfor", "pod_p.T_S1") == "gfor.pod_p.K is 0.0"
    assert why_idle(prepared.system, "gfor", "pod_p.K") == ""
    assert why_idle(prepared.system, "gfor", "pod_p.T_S1", {"gfor.pod_p.K"}) == ""
    alone = System()
    alone.components.update(prepared.system.components)
    idle = idle_values(alone, frozenset(["grid.X_L"]), {"grid.X_L": "here"}, ())
    assert [str(q) for q in idle_everywhere([idle])] == [
        "here: grid.X_L cannot act: grid is connected with no other component"
    ]


@pytest.mark.parametrize(
    ("scenarios", "told"), [(["base"], 1), (["gfor"], 0), (["base", "gfor"], 0)]
)
def test_values_for_a_component_of_another_scenario_are_told_once(scenarios, told):
    prepared = CASE.prepare(scenarios, {"gfor.P_0": 0.4, "gfor.v_0": 1.0})
    found = [str(q) for q in prepared[0].questions if "cannot act" in str(q)]
    assert (
        found == ["--set gfor.P_0: gfor.P_0, gfor.v_0 cannot act: the scenario has no gfor"] * told
    )


@pytest.mark.parametrize(("scenarios", "told"), [(["gfor"], 1), (["gfor", "pod_p"], 0)])
def test_a_sweep_tells_of_an_axis_that_acts_in_no_scenario(scenarios, told):
    plan = plan_sweep(CASE, SweepRequest([parse_vary("gfor.pod_p.K=100:200:3")], scenarios))
    assert [
        str(q).startswith("--vary gfor.pod_p.K: gfor.pod_p.K cannot act") for q in plan.idle
    ] == [True] * told


def test_the_power_of_a_unit_at_the_slack_is_what_is_left():
    case = load_case("wscc9")
    values = {"sg1.P_0": 0.6, "sg2.P_0": 0.7}
    (text,) = [
        str(q) for q in case.prepare(["base"], values)[0].questions if "cannot act" in str(q)
    ]
    assert text.startswith(
        "--set sg1.P_0: sg1.P_0 cannot act: bus_1 is the slack and feeds what is left, here P_0 = "
    )
