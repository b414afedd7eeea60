"""Of a mode: what switching each damping controller does, as the case's own scenarios have it; of the rest nothing."""

from types import SimpleNamespace

import pytest

import orchestrator as gfor
from orchestrator.studies.oscillations.levers import levers_of, with_levers
from orchestrator.studies.oscillations.verdict import Located


def seen(kind, hertz=0.58):
    found, evidence = SimpleNamespace(frequency=hertz), SimpleNamespace(kind=kind)
    return Located(found, evidence, (), None, None, "", "as it was")


@pytest.fixture(scope="module")
def case():
    return gfor.load("two_area_rms")


def test_controllers_switched_on_are_those_of_the_scenarios_that_have_them(case):
    _, (first, second) = levers_of(case.scenario("gfor").prepared, 0.58)
    for lever in (first, second):
        own = (
            case.scenario(lever["controller"].removeprefix("gfor."))
            .modes()
            .result.electromechanical
        )
        assert (lever["on"], lever["damping_percent"]) == (
            False,
            pytest.approx(own.damping_percent, rel=1e-3),
        )


def test_what_is_forced_gets_no_advice_on_damping_and_a_mode_that_is_far_none_either(case):
    prepared = case.scenario("gfor").prepared
    forced = seen("forced")
    assert with_levers(prepared, forced) is forced
    assert "no mode near" in with_levers(prepared, seen("mode", 1.3)).advice
    told = with_levers(prepared, seen("mode"))
    assert told.advice.startswith(
        "damp the mode, which nothing drives: the case's mode there has 10.6"
    )
    assert [x["controller"] for x in told.controllers] == ["gfor.pod_p", "gfor.pod_q"]
