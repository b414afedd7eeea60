"""A run whose events leave a line open is judged by the system that is left as well, however short it is."""

import io
import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from rich.console import Console

import orchestrator as gfor_api
from orchestrator.studies.modes.modes import ModesResult
from orchestrator.studies.runs import answer_of_run
from orchestrator.studies.runs.after_events import lasting_changes, modes_after
from orchestrator.studies.runs.answer import ScenarioAnswer
from orchestrator.studies.runs.answers_table import answers_table
from tests.studies.screening.five_machines import five_machines
from tests.support.scenarios import bare_scenario

pytestmark = [
    pytest.mark.filterwarnings("ignore::orchestrator.face.api.scenario.UnusualDataWarning"),
    pytest.mark.usefixtures("undrawn"),
]

# governors that feed the swing once the ring is open
FAST = {"R": 0.02, "T_1": 0.3, "T_2": 0.0, "T_3": 0.6}
VALUES = {f"sg[1235].governor.{name}": value for name, value in FAST.items()} | {
    "grid.X_line_15_11": 0.5
}
FAULT = "bus_14, 60 ms, opens line_13_14, from 0.5 s"


@pytest.fixture
def case(tmp_path):
    five_machines(tmp_path)
    return tmp_path / "five.toml"


@pytest.fixture(scope="module")
def before(tmp_path_factory):
    """The modes of the case as it is."""
    folder = tmp_path_factory.mktemp("before")
    five_machines(folder)
    return gfor_api.load(folder / "five.toml").scenario("base").modes().result


def run(gfor, case, *further, stop="3"):
    code, out, err = gfor(
        "run",
        case,
        *further,
        "--stop",
        stop,
        "--json",
        "--fail-unstable",
        "--no-csv",
        "--out",
        case.parent / "r",
    )
    assert code in (0, 1), err
    (found,) = json.loads(out)
    return code, found


def test_a_network_that_is_unstable_after_the_fault_is_told(gfor, case):
    values = [word for key, value in VALUES.items() for word in ("--set", f"{key}={value}")]
    code, found = run(gfor, case, "--fault", FAULT, *values)
    by_hand = (
        gfor_api.load(case).scenario("base", VALUES | {"grid.line_13_14.connected": False}).modes()
    )
    least = min(by_hand, key=lambda mode: mode.damping_percent)
    after, answer = found["answer"]["after_events"], found["answer"]
    assert least.damping_percent < -1
    assert (after["frequency_hz"], after["damping_percent"]) == pytest.approx(
        (least.frequency_hz, least.damping_percent)
    )
    assert (code, answer["stable"], answer["verdict"]) == (1, False, "UNSTABLE")
    assert (
        "the system that the events leave: grows at" in answer["remark"]
        or "grows from" in answer["remark"]
    )
    assert answer["damping_percent"] > 7


def test_modes_after_the_events_that_are_near_zero_leave_the_verdict_to_a_long_run(gfor, case):
    """A power flow with a line open lets units hold their voltages; the event leaves their references."""
    values = [word for key, value in VALUES.items() for word in ("--set", f"{key}={value}")]
    values += ["--set", "sg[1235].governor.R=0.0285"]
    _, found = run(gfor, case, "--fault", FAULT.replace("60", "5"), *values)
    assert -0.4 < found["answer"]["after_events"]["damping_percent"] < -0.1
    assert found["answer"]["stable"] is None
    assert (
        "too short to show whether what the events leave settles: --stop 42.6"
        in found["answer"]["remark"]
    )


DAMPINGS = [
    (-0.4, 0, 3, True),
    (0.4, 0, 3, True),
    (-0.6, 0, 3, False),
    (-0.6, 0, 60, True),
    (-0.4, 1, 60, False),
    (0.6, 1, 60, False),
]


@pytest.mark.parametrize(("damping", "fast", "stop", "good"), DAMPINGS)
def test_a_whole_run_decides_about_modes_near_zero_and_not_of_others_that_grow(
    before, monkeypatch, damping, fast, stop, good
):
    least, other = (
        replace(before.modes[0], eigenvalue=value)
        for value in (complex(-damping / 20, 5), fast + 300j)
    )
    stable = damping > 0 and not fast
    grows = None if stable else other if fast else least
    after = replace(
        before, modes=[least], stability=replace(before.stability, stable=stable, mode=grows)
    )
    monkeypatch.setattr(
        answer_of_run,
        "_by_response",
        lambda _: ScenarioAnswer("", True, "stable", None, "settles"),
    )
    prepared = bare_scenario(
        events=(SimpleNamespace(time=0.5),), stop_time=stop, case=before.prepared.case
    )
    modes = SimpleNamespace(prepared=prepared, modes=before.modes, model=before.model)
    found = answer_of_run.of_run(SimpleNamespace(after=after, modes=modes, trips=(), findings=()))
    assert found.good is good
    assert ("by a power flow, decides nothing" in found.remark) is (good and damping < 0.5)


def of_two_modes(before, monkeypatch, moved, other):
    """The table and the JSON of a run whose least damped mode goes to ``moved`` and whose next one to ``other``."""
    least, next_one = sorted(before.modes, key=lambda mode: mode.damping_percent)[:2]
    left = [replace(least, eigenvalue=moved), replace(next_one, eigenvalue=other)]
    after = replace(before, modes=left, stability=replace(before.stability, stable=True, mode=None))
    first = ScenarioAnswer("", True, "stable", least, "settles")
    monkeypatch.setattr(answer_of_run, "_by_response", lambda _: first)
    found = answer_of_run.of_run(SimpleNamespace(after=after, modes=before, trips=(), findings=()))
    console = Console(width=200, record=True, file=io.StringIO())
    console.print(answers_table([found], (0.1, 2.5)))
    return found, console.export_text(), least, after


def test_an_arrow_leads_from_a_mode_to_itself(before, monkeypatch):
    """The least damped mode before the events is well damped after them, and another one is the least damped."""
    found, table, least, after = of_two_modes(before, monkeypatch, -2.0 + 8.0j, -0.3 + 6.0j)
    assert (found.became, found.after) == tuple(after.modes)
    assert f"{least.frequency_hz:.3f} → {8 / 2 / np.pi:.3f}" in table
    assert f"{6 / 2 / np.pi:.3f}" in table
    assert "least damped after the events, another mode: " in table
    told = found.as_json()["after_events"]
    assert told["frequency_hz"] == pytest.approx(6 / 2 / np.pi)
    assert told["same_mode"]["frequency_hz"] == pytest.approx(8 / 2 / np.pi)


def test_the_same_mode_after_the_events_is_one_row(before, monkeypatch):
    found, table, least, _ = of_two_modes(before, monkeypatch, -0.3 + 6.0j, -2.0 + 8.0j)
    assert found.became is found.after
    assert f"{least.frequency_hz:.3f} → {6 / 2 / np.pi:.3f}" in table
    assert "least damped after" not in table


def test_no_arrow_leads_to_a_mode_that_is_not_clearly_the_same(before, monkeypatch):
    monkeypatch.setattr(answer_of_run, "same_mode", lambda *_: None)
    found, table, least, _ = of_two_modes(before, monkeypatch, -0.3 + 6.0j, -2.0 + 8.0j)
    assert "→" not in table
    assert f"{least.frequency_hz:.3f}" in table
    assert f"{6 / 2 / np.pi:.3f}" in table
    assert "least damped after the events, not clearly the same mode: " in table
    assert found.as_json()["after_events"]["same_mode"] is None


def test_a_network_that_stays_stable_is_stable(gfor, case):
    code, found = run(gfor, case, "--fault", FAULT, stop="8")
    assert (code, found["answer"]["verdict"]) == (0, "stable")
    assert found["answer"]["after_events"]["damping_percent"] == pytest.approx(10.19, abs=0.05)


def test_a_fault_that_opens_nothing_leaves_the_system_as_it_was(gfor, case):
    _, found = run(gfor, case, "--fault", "bus_14, 60 ms, from 0.5 s")
    assert "after_events" not in found["answer"]
    scenario = gfor_api.load(case).scenario("base", fault=FAULT)
    assert lasting_changes(scenario.prepared) == {"grid.line_13_14.connected": False}


def test_settling_is_not_judged_while_something_is_forced(gfor, case):
    _, found = run(
        gfor, case, "--fault", "bus_14, 60 ms, from 0.5 s", "--force", "sg1 0.8 Hz 0.1 %", stop="8"
    )
    assert found["answer"]["stable"] is None
    assert (
        "sg1.governor.delta_P_ref: forced until then, so settling is not judged"
        in found["answer"]["remark"]
    )


def test_a_run_without_events_says_so(gfor, case):
    _, found = run(gfor, case)
    assert found["answer"]["remark"].startswith("no event disturbs it")


LOAD = '[[events]]\ntype = "load_change"\ntime = "0.5 s"\ncomponent = "grid"\nload = "load_11"\nscale = 1.5\n'
TRIP = '[[events]]\ntype = "line_trip"\ntime = "0.5 s"\nline = "line_13_14"\n'


@pytest.mark.parametrize(
    ("events", "kind"),
    [(LOAD, type(None)), (TRIP, ModesResult), (LOAD + TRIP, str)],
    ids=("load", "trip", "both"),
)
def test_who_feeds_a_load_that_changed_is_for_the_run_to_show(case, events, kind):
    case.write_text(f"{case.read_text()}\n{events}")
    after = modes_after(gfor_api.load(case).scenario("base").prepared, (0.1, 2.0))
    assert isinstance(after, kind), after


def test_a_change_whose_modes_are_not_known_is_no_verdict_of_a_short_run(gfor, case):
    case.write_text(f"{case.read_text()}\n{LOAD.replace('1.5', '0.95')}")
    short, found = run(gfor, case, stop="3")
    assert (short, found["answer"]["stable"]) == (1, None)
    assert (
        "too short to show whether what the events leave settles: --stop 3.6"
        in found["answer"]["remark"]
    )
    whole, found = run(gfor, case, stop="6")
    assert (whole, found["answer"]["stable"]) == (0, True)
