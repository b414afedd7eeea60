"""What a saved page answers of the questions that are asked of a live one."""

import json

import pytest

from orchestrator.core.errors import InputError
from orchestrator.face.explore.asked_before import (
    answered_questions,
    converter_apart,
    line_to_lose,
)


def line(name, start, end, switch=None):
    return {"name": name, "from": start, "to": end, "open": switch}


LINES = (
    line("to_c", "b", "c", "grid.to_c.connected"),
    line("once", "a", "b", "grid.once.connected"),
    line("twice", "a", "b", "grid.twice.connected"),
    line("fixed", "a", "b"),
    line("off", "a", "c", "grid.off.connected"),
)
SHOWN = {
    "diagram": {"buses": [{"name": name} for name in "abc"], "lines": LINES},
    "parameters": [
        {"parameter": one["open"], "value": one["name"] != "off"} for one in LINES if one["open"]
    ],
}
CARRIED = {"to_c": 900.0, "once": -70.0, "twice": 80.0, "fixed": 500.0, "off": 0.0}
FLOW = {"branches": [{"name": name, "p_from_mw": p} for name, p in CARRIED.items()]}


def test_the_line_to_lose_has_the_largest_flow_of_those_without_which_the_network_hangs_together():
    assert line_to_lose(SHOWN, FLOW)["name"] == "twice"
    only = {**SHOWN, "diagram": {**SHOWN["diagram"], "lines": LINES[:2]}}
    assert line_to_lose(only, FLOW) is None
    assert line_to_lose({"parameters": []}, FLOW) is None


def systems(**scenarios):
    plain = {"remove": [], "parameters": [], "set": {}}
    return {name: json.dumps({**plain, **one}) for name, one in scenarios.items()}


def test_the_scenario_without_a_converter_is_the_one_that_differs_least_in_the_rest():
    found = systems(
        pod={"set": {"gfor.pod_p.enabled": True}},
        base={"remove": ["gfor"]},
        weak={"remove": ["gfor"], "set": {"grid.X_L": 0.3}},
        gfor={},
    )
    assert converter_apart(found, "pod") == "base"
    assert converter_apart(found, "weak") == "gfor"
    assert converter_apart(systems(pod={}, gfor={}), "pod") is None
    assert converter_apart(found, "another") is None


def answer_of(stable, *dampings):
    modes = [{"frequency_hz": 1.0, "damping_percent": one, "shape": []} for one in dampings]
    return {"modes": {"scenarios": [{"stable": stable, "modes": modes, "power_flow": FLOW}]}}


def test_each_answer_is_what_a_sentence_tells_of_it():
    asked = []

    def computed(scenario, values):
        asked.append((scenario, values))
        if scenario == "base":
            raise InputError("no steady state")
        return answer_of(not values.get("grid.twice.connected", True), 12.0, 7.0)

    opened = {
        "systems": systems(pod={}, base={"remove": ["gfor"]}),
        "scenarios": {"pod": "With POD", "base": "Machines alone"},
    }
    begun = {"scenario": "pod", "values": {"gfor.K": 2.0}}
    lost, apart = answered_questions(begun, SHOWN, opened, computed)
    assert asked == [
        ("pod", {"gfor.K": 2.0}),
        ("pod", {"gfor.K": 2.0, "grid.twice.connected": False}),
        ("base", {}),
    ]
    assert lost["question"] == "What if line twice is out?"
    least = [{"frequency_hz": 1.0, "damping_percent": 7.0}]
    assert lost["answer"] == {"modes": {"scenarios": [{"stable": True, "modes": least}]}}
    assert lost["now"]["modes"]["scenarios"][0]["stable"] is False
    assert apart["words"] == "Machines alone"
    assert apart["reason"] == "no steady state"


@pytest.mark.parametrize("opened", [{}, {"systems": systems(pod={})}])
def test_nothing_is_computed_where_nothing_is_asked(opened):
    assert answered_questions({"scenario": "pod", "values": {}}, {}, opened, None) == []
