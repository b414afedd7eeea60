"""`gfor run` on cases that are well, and on cases with something planted in them: what it says, and where."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest

from orchestrator.cases.case import load_case
from orchestrator.linear.models.steady_state import find_operating_point
from orchestrator.studies.modes.modes import running
from orchestrator.studies.runs.run import run_scenario
from orchestrator.systems.coupling.events import LoadChange, UnitSwitching
from orchestrator.systems.coupling.recorder import Recorder
from tests.support.scenarios import prepare_one

pytestmark = pytest.mark.usefixtures("undrawn")

DEEP = """
name = "deep"
[solver]
stop_time = "3 s"
groups = [["gfor"], ["grid"]]
[components.gfor]
model = "gfor"
parameters = { S_n = "1500 MVA", P_0 = 0.6, Q_0 = 0.05, v_0 = 1.0 }
[components.grid]
model = "infinite_bus"
parameters = { P_0 = 9.0, Q_0 = 0.75, v_0 = 1.0 }
[[connections]]
from = "grid.v_re"
to = "gfor.v_re"
[[connections]]
from = "grid.v_im"
to = "gfor.v_im"
[[connections]]
from = "gfor.i_re"
to = "grid.i_re"
[[connections]]
from = "gfor.i_im"
to = "grid.i_im"
[[events]]
type = "parameter_change"
time = "1 s"
component = "grid"
parameter = "dip.depth"
value = 0.8
[[events]]
type = "parameter_change"
time = "1.3 s"
component = "grid"
parameter = "dip.depth"
value = 0.0
[[plots]]
name = "power"
title = "Power"
panels = [{ signal = "gfor.p", label = "P [pu]" }]
"""


NATIVE = {"*__native": True}  # as machine code, which steps EMT models eight times as fast


def findings(case, scenario, stop=None, **overrides):
    loaded = load_case(case)
    (ready,) = loaded.prepare(
        [scenario], {k.replace("__", "."): v for k, v in overrides.items()}, stop_time=stop
    )
    return run_scenario(ready).findings


@pytest.mark.parametrize("scenario", ["gfor", "pod_p", "pod_q", "pod_pq"])
def test_what_is_well_is_silent(scenario):
    assert findings("two_area_rms", scenario) == []


@pytest.mark.parametrize("scenario", ["dip", "load_step"])
def test_a_shallow_dip_and_a_load_step_are_silent(scenario):
    assert findings("infinite_bus", scenario) == []


@pytest.mark.slow
@pytest.mark.parametrize("scenario", ["gfor", "pod_pq"])
def test_the_papers_scenarios_are_silent(scenario):
    """Of EMT models: without a POD controller, and with both; each alone is silent among the phasor models."""
    assert findings("two_area", scenario, **NATIVE) == []


@pytest.mark.parametrize(
    ("case", "own", "rate"),
    [
        ("two_area_rms", {}, 0.033),
        pytest.param("two_area", NATIVE, 0.0285, marks=pytest.mark.slow),
    ],
    ids=["phasors", "EMT"],
)
def test_the_papers_base_case_grows_after_its_load_step(case, own, rate):
    (finding,) = findings(case, "base", **own)
    assert (finding.kind, finding.component, finding.time) == ("growing_oscillation", "sg1", 1.0)
    assert finding.figures["growth_rate"] == pytest.approx(rate, abs=0.001)
    assert finding.figures["frequency_hz"] == pytest.approx(0.573, abs=0.001)


@pytest.mark.parametrize("scale", [1.0, 1.02])
def test_an_event_shortly_before_the_end_hides_no_growth(scale):
    """The first sets what holds already, the second is noticed."""
    loaded = load_case("two_area_rms")
    (ready,) = loaded.prepare(["base"], stop_time=15.0)
    (first,) = ready.events
    late = LoadChange(14.8, first.component, first.load, first.scale * scale)
    (finding,) = run_scenario(replace(ready, events=[first, late])).findings
    assert (finding.kind, finding.time) == ("growing_oscillation", 1.0)
    assert finding.until == (14.8 if scale == 1.02 else None)
    assert finding.figures["growth_rate"] == pytest.approx(0.033, abs=0.001)


def test_speeds_without_governors_run_away():
    off = {"sg1.governor.enabled": False, "sg2.governor.enabled": False}
    loaded = load_case("two_area_rms")
    (ready,) = loaded.prepare(["gfor"], off, stop_time=15.0)
    trip = UnitSwitching(1.0, ready.events[0].component, "gfor", connected=False)
    found = run_scenario(replace(ready, events=[trip])).findings
    speed = next(finding for finding in found if finding.variable == "omega")
    assert (speed.kind, speed.time) == ("run_away", 1.0)
    assert speed.figures["value"] < 0.9
    assert {finding.kind for finding in found} == {"run_away"}


@pytest.mark.slow
def test_an_undisturbed_state_that_grows():
    """λ = 68.85 ± j215.8 (34.35 Hz) with that droop; the reference moves it off its exact rest by 1e-9 pu."""
    found = findings("two_area", "gfor", 0.9, gfor__droop__R_f=5.0, gfor__droop__delta_P_ref=1e-9)
    assert [f.kind for f in found] == [
        "growth",
        "active_limit",
        "run_away",
        "active_limit",
        "loss_of_synchronism",
    ]
    growth, lost = found[0], found[-1]
    assert growth.figures["growth_rate"] == pytest.approx(68.85, rel=0.01)
    assert growth.figures["frequency_hz"] == pytest.approx(34.35, rel=0.01)
    assert 0.1 < growth.time < 0.3
    assert (lost.kind, lost.component) == ("loss_of_synchronism", "gfor")


def test_limits_and_lost_synchronism_are_said_once_in_terminal_summary_and_report(gfor, tmp_path):
    file = tmp_path / "case.toml"
    file.write_text(DEEP, encoding="utf-8")
    code, printed, said = gfor("run", file, "--out", tmp_path, "--fail-unstable")
    assert code == 1
    row = printed.splitlines()[3]  # the run's verdict; that of its eigenvalues is another
    assert re.search(r"UNSTABLE .* gfor: loses synchronism from 1.55", row)
    (summary,) = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))["scenarios"]
    assert (summary["stable"], summary["stable_in_simulation"]) == (True, False)
    kinds = [(f["kind"], f["component"], f["variable"]) for f in summary["findings"]]
    assert sorted(kinds) == [
        ("active_limit", "gfor", "filter.i_s_d"),
        ("active_limit", "gfor", "filter.i_s_q"),
        ("loss_of_synchronism", "gfor", "droop.theta"),
    ]
    by_variable = {f["variable"]: f for f in summary["findings"]}
    assert by_variable["filter.i_s_q"]["time"] == pytest.approx(1.0, abs=0.02)
    assert by_variable["filter.i_s_q"]["duration_s"] > 0.3
    lost = by_variable["droop.theta"]
    assert lost["time"] == pytest.approx(1.55, abs=0.02)
    assert lost["turns"] > 1
    assert "gfor loses synchronism with grid: from t = 1.55 s" in lost["message"]
    for finding in summary["findings"]:
        assert said.count(finding["message"]) == 1
    assert gfor("report", tmp_path)[0] == 0
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    for finding in summary["findings"]:
        assert page.count(finding["message"]) == 1
    assert "What was found in the runs" in page


@pytest.mark.parametrize("limit", [0.5984, 0.6])
def test_a_limit_that_is_only_near_does_not_act(tmp_path, limit):
    """The converter rests at 0.59825 pu."""
    file = tmp_path / "case.toml"
    file.write_text(DEEP, encoding="utf-8")
    assert findings(file, "deep", 0.3, gfor__voltage_control__i_q_max=limit) == []


def test_a_run_without_findings_says_so_in_its_report(gfor, tmp_path):
    code, _, said = gfor("run", "two_area_rms", "--scenario", "gfor", "--out", tmp_path)
    assert (code, said) == (0, "")
    gfor("report", tmp_path)
    assert "nothing of it was found" in (tmp_path / "report.html").read_text(encoding="utf-8")


def test_a_pod_at_its_limit_is_told_with_its_duration():
    found = findings("two_area_rms", "pod_p", gfor__pod_p__limit=1e-4)
    (limit,) = [f for f in found if f.kind == "active_limit"]
    assert (limit.component, limit.variable) == ("gfor", "delta_p_pod")
    assert 1.0 <= limit.time < 1.5
    assert limit.figures["duration_s"] > 0.1


def test_a_limit_that_acts_without_a_break_is_told_for_its_whole_interval():
    """0.105 s were told between 1.04 s and 1.14 s."""
    ready = prepare_one("two_area_rms", "pod_p", {"gfor.pod_p.limit": 1e-4}, stop_time=3.0)
    trip = UnitSwitching(1.2, "grid", "gfor", False)
    result = run_scenario(replace(ready, events=[*ready.events, trip]))
    (limit,) = [f for f in result.findings if f.kind == "active_limit"]
    assert limit.figures["stretches"] == 1
    assert limit.until - limit.time == pytest.approx(limit.figures["duration_s"])


@pytest.mark.parametrize(("limit", "trip"), [(0.1, 1.0), (1e-4, 3.0)])
def test_no_limit_of_a_tripped_converter_is_told(limit, trip):
    """Its frequency goes its own way, so its POD is at its limit; what acted before the trip is told until then."""
    ready = prepare_one("two_area_rms", "pod_p", {"gfor.pod_p.limit": limit}, stop_time=6.0)
    result = run_scenario(
        replace(ready, events=[*ready.events, UnitSwitching(trip, "grid", "gfor", False)])
    )
    last = np.abs(result.dataset["gfor.delta_p_pod"].sel(time=slice(5, None)).values)
    assert last.min() > 0.999 * limit
    found = [f for f in result.findings if f.kind == "active_limit"]
    assert [f.component for f in found] == (["gfor"] if trip > 1 else [])
    assert all(f.time < f.until <= trip for f in found)


def test_watching_changes_no_number(tmp_path):
    """What is recorded with the watch is what a master gives that only records."""
    case = load_case("two_area_rms")
    (ready,) = case.prepare(["pod_pq"], stop_time=3.0)
    watched = run_scenario(ready).dataset
    plain = Recorder(ready.record, ready.record_every)
    with running(ready) as master:
        find_operating_point(master)
        master.run(ready.stop_time, ready.events, [plain])
    for column, name in enumerate(ready.record):
        assert np.array_equal(watched[name].values, plain.values[:, column], equal_nan=True)
