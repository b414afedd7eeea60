"""Faults at buses: the events of a case file, and what the coupled system does."""

import numpy as np
import pytest

from orchestrator.cases.case import load_case
from orchestrator.core.errors import CaseError
from orchestrator.systems.coupling.events import BusFault, LineSwitching
from tests.cases.events.test_switching import RING, watch
from tests.support.scenarios import prepare_one

FAULT = '[[events]]\ntype = "bus_fault"\ntime = "0.1 s"\nbus = "b3"\n'


def prepared(folder, text, base=RING):
    (folder / "case.toml").write_text(base + text, encoding="utf-8")
    return load_case(folder / "case.toml").prepare()[0]


def test_a_fault_begins_ends_and_its_line_opens(tmp_path):
    ready = prepared(tmp_path, FAULT + 'R = 0.01\nduration = "50 ms"\ncleared_by = "l23"\n')
    assert ready.events == (
        BusFault(0.1, "grid", "b3", True, 0.01, 0.0),
        BusFault(0.15000000000000002, "grid", "b3", False),
        LineSwitching(0.15000000000000002, "grid", "l23", False),
    )
    found = watch(
        ready,
        ("grid.b3.v", "grid.l23.p", "grid.b3.fault.i_re", "sg.omega"),
        (0.0999, 0.149, 0.16, 0.3),
    )
    before, during, after, later = found
    assert before["grid.b3.v"] > 0.9
    assert before["grid.b3.fault.i_re"] == 0
    assert during["grid.b3.v"] == pytest.approx(0.01 * 50, rel=0.6)  # R times tens of pu
    assert abs(later["grid.l23.p"]) < 1e-6
    assert abs(later["grid.b3.fault.i_re"]) < 1e-6
    assert later["grid.b3.v"] > 0.8
    assert after["grid.b3.v"] < 1.5


@pytest.mark.parametrize(("line", "asked"), [("l12", True), ("l23", False), ("l31", False)])
def test_a_line_elsewhere_that_clears_a_fault_is_asked_about(tmp_path, line, asked):
    ready = prepared(tmp_path, FAULT + f'duration = "50 ms"\ncleared_by = "{line}"\n')
    said = [str(q) for q in ready.questions if "is another line meant?" in str(q)]
    assert bool(said) is asked
    assert all("l12 opens for a fault at b3, but it joins b1 and b2" in text for text in said)


def test_a_fault_without_an_end_stays(tmp_path):
    ready = prepared(tmp_path, FAULT)
    assert len(ready.events) == 1
    (last,) = watch(ready, ("grid.b3.v",), (0.15,))
    assert last["grid.b3.v"] < 2e-3


def test_it_is_known_to_every_scenario_and_the_steady_state_does_not_see_it(tmp_path):
    text = "[scenarios.calm]\nevents = []\n[scenarios.faulted]\n" + FAULT.replace(
        "[[events]]", "[[scenarios.faulted.events]]"
    )
    (tmp_path / "case.toml").write_text(RING + text, encoding="utf-8")
    calm, faulted = load_case(tmp_path / "case.toml").prepare()
    grids = [ready.system.components["grid"].description for ready in (calm, faulted)]
    assert grids[0].guid == grids[1].guid
    assert "b3.fault.on" in grids[0].variables


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (FAULT.replace("b3", "b4"), "component 'grid' has no bus 'b4'; did you mean"),
        (FAULT.replace("b3", "l31"), "it is a line: along it, .* as in 'l31 at 50 %, 100 ms'"),
        (FAULT + 'cleared_by = "l23"\n', "'cleared_by' needs 'duration'"),
        (
            FAULT + 'duration = "0.1 s"\ncleared_by = "l32"\n',
            "has no line 'l32'; did you mean l31 or l23",
        ),
        (FAULT + "R = -0.1\n", "R"),
        (FAULT + 'duration = "12.34567 ms"\n', "communication"),
    ],
)
def test_what_is_wrong_is_named(text, words, tmp_path):
    with pytest.raises(CaseError, match=words):
        prepared(tmp_path, text)


@pytest.mark.parametrize("name", ["two_area", "two_area_rms"])
def test_the_built_in_two_area_systems_take_faults(name, tmp_path):
    """Their grid has a network of its own, which is built anew with the fault."""
    case = load_case(name)
    text = case.path.read_text(encoding="utf-8").replace(
        "[[events]]",
        '[[events]]\ntype = "bus_fault"\ntime = "0.1 s"\nbus = "bus_3"\nX = 0.02\nduration = "0.1 s"\n[[events]]',
        1,
    )
    (tmp_path / "case.toml").write_text(text, encoding="utf-8")
    ready = prepare_one(tmp_path / "case.toml", "base")
    before, during, after = watch(ready, ("grid.bus_3.v", "sg1.omega"), (0.09, 0.19, 0.6))
    assert before["grid.bus_3.v"] == pytest.approx(1.0, abs=0.05)
    assert 0.2 < during["grid.bus_3.v"] < 0.8
    assert after["grid.bus_3.v"] > 0.8
    assert np.isfinite(after["sg1.omega"])
