"""What is read first: verdict and mode of each scenario, and the power flow beside pandapower's."""

import csv
import io
import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr
from rich.console import Console

from orchestrator.cases.form.schema import KindTable
from orchestrator.face.cli import main
from orchestrator.face.cli.verdict import print_answers
from orchestrator.linear.spectra.modes import make_mode
from orchestrator.linear.spectra.stability import Hidden, Stability
from orchestrator.output.report.html.verdict_lines import VerdictLine
from orchestrator.output.report.short_texts import LONGEST_REMARK
from orchestrator.simulation.watch.finding import Finding
from orchestrator.studies.runs.answer_of_modes import of_modes
from orchestrator.studies.runs.answer_of_run import of_run
from orchestrator.studies.runs.answers_table import answers_table, outside
from orchestrator.studies.runs.run import RunResult
from tests.support.scenarios import bare_scenario


def lines(capsys, *words):
    assert main([*map(str, words)]) in (0, 1)
    return capsys.readouterr().out.splitlines()


def test_the_first_screen_of_modes_has_one_line_a_scenario(capsys):
    text = lines(capsys, "modes", "two_area_rms")
    rows = [[cell.strip() for cell in line.strip("│").split("│")] for line in text[3:8]]
    assert [row[1] for row in rows] == ["UNSTABLE", "stable", "stable", "stable", "stable"]
    assert float(rows[1][3].split()[0]) == pytest.approx(10.6, abs=0.3)  # and the paper's
    assert all("sg1" in row[4] for row in rows)
    assert not [line for line in text if "largest real part" in line or "a mode grows" in line]


SPEEDS = ("sg1.machine.omega", "sg2.machine.omega")


def result(findings=(), stable=True, events=(1.0,), failure=None, kind=None, stop=5.0):
    shape = np.array([1.0 + 0j, -0.8 + 0j])
    mode = make_mode(-0.2 + 5j, shape / 1.64, shape, SPEEDS)
    case = SimpleNamespace(
        table=SimpleNamespace(
            analysis=SimpleNamespace(modes={}),
            models=kind,
            emt=KindTable(step_size=1e-4),
            protection=None,
        )
    )
    # leaves nothing changed
    passing = [SimpleNamespace(time=t, changes=dict) for t in events if t < 5]
    prepared = bare_scenario(
        title="S",
        events=passing,
        stop_time=stop,
        case=case,
        not_reached=tuple(t for t in events if t >= 5),
    )
    modes = SimpleNamespace(
        prepared=prepared,
        modes=[mode],
        hidden=None,
        named={},
        unnamed={},
        misfits={},
        swing=SPEEDS,
        stability=Stability(stable, mode, reason="" if stable else "not searched"),
    )
    return RunResult(modes, None, findings=list(findings), failure=failure)


def test_a_growth_that_the_step_hides_is_told_beside_the_damping_that_hides_it():
    """In a row, a positive damping and the word UNSTABLE contradict each other without a reason."""
    modes = result().modes
    growing = make_mode(0.01 + 5j, np.ones(2) / 2, np.ones(2), SPEEDS)
    modes.stability = Stability(False, growing, hidden_by_step=1e-4)
    answer = of_modes(modes)
    assert answer.mode.damping_percent > 0
    assert "without a communication step; a step of 0.0001 s" in answer.remark
    modes.stability = Stability(False, growing)
    assert "step" not in of_modes(modes).remark


def finding(kind, **more):
    return Finding(kind, 1.0, "gfor", "x", "message", **more)


@pytest.mark.parametrize(
    ("findings", "stable", "word", "remark"),
    [
        ([], True, "stable", "keeps synchronism and settles by 5 s"),
        # a limit that the model has
        (
            [finding("active_limit", what="limit", until=2.0)],
            True,
            "stable",
            "keeps synchronism and settles by 5 s",
        ),
        (
            [finding("active_limit", what="limit")],
            True,
            "stable",
            "the limit of gfor acts at the end, and modes are those without it; keeps synchronism",
        ),
        ([finding("active_limit", represented=False)], True, "not known", "repeat with EMT models"),
        ([finding("not_judged")], True, "not known", "not judged"),
        ([finding("loss_of_synchronism")], True, "UNSTABLE", "gfor: loses synchronism from 1 s"),
        (
            [finding("active_limit", represented=False), finding("run_away")],
            True,
            "UNSTABLE",
            "runs away",
        ),
        ([], None, "not known", "not searched"),
    ],
)
def test_the_verdict_of_a_run_is_its_own(findings, stable, word, remark):
    answer = of_run(result(findings, stable))
    assert (answer.verdict, answer.good) == (word, {"stable": True, "UNSTABLE": False}.get(word))
    assert remark in answer.remark
    if remark.startswith("repeat"):
        assert of_run(result(findings, stable, kind="phasor")).remark.endswith(
            "repeat with --set models=emt"
        )


@pytest.mark.parametrize(
    ("until", "stop", "told"),
    [
        # exp(-0.2·15) = 5 % of the mode of 0.796 Hz are left 15 s after the event at 1 s
        (
            None,
            5.0,
            "; --stop 16 goes on until the least damped mode, 0.796 Hz with 4 %, leaves 5 % of its swing",
        ),
        (None, 21.0, "; --stop 31 goes on"),  # the mode is gone
        (3.0, 5.0, "the findings say where and why"),  # between events a longer run shows nothing
    ],
)
def test_a_response_that_is_not_judged_to_its_end_names_the_stop_to_type(until, stop, told):
    run = result([finding("not_judged", until=until)], stop=stop)
    answer = of_run(run)
    assert (answer.verdict, answer.good) == ("not known", None)
    assert answer.remark.endswith(told)


@pytest.mark.parametrize(
    ("findings", "but"),
    [
        ([finding("stall")], "gfor stalls"),
        ([finding("stall"), finding("stall")], "2 motors stall"),
        ([finding("interruption")], "the DC line of gfor is off at the end"),
        ([finding("interruption", until=2.0)], ""),  # it comes back
        (
            [finding("stall"), finding("interruption")],
            "gfor stalls and the DC line of gfor is off at the end",
        ),
        ([finding("stall"), finding("run_away")], ""),  # it is UNSTABLE already
    ],
)
def test_a_good_verdict_names_what_does_not_hold(findings, but):
    """The first words of a table, of Python and of a report say it; the verdict of JSON stays what it was."""
    answer = of_run(result(findings))
    words = "stable, but " + but if but else answer.verdict
    assert answer.word == words
    assert answer.as_json()["verdict"] in ("stable", "UNSTABLE")
    (cell,) = answers_table([answer], (0.1, 2.0)).columns[1].cells
    assert str(cell) == words
    line = VerdictLine.of({"name": "S", "answer": answer.as_json()})
    assert line.words.startswith(f"S: {words}, least damped")


def test_a_long_remark_is_whole_in_json_and_short_in_the_table():
    acting = [finding("active_limit", what=f"limit of the current number {k}") for k in range(4)]
    answer = of_run(result(acting))
    assert len(answer.remark) > LONGEST_REMARK
    assert answer.as_json()["remark"] == answer.remark
    assert answer.remark.endswith("sg1 against sg2")
    table = answers_table([answer], (0.1, 2.0), longest=LONGEST_REMARK)
    cut = str(next(iter(table.columns[-1].cells)))
    assert cut.endswith(" …")
    assert answer.remark.startswith(cut.removesuffix(" …"))


@pytest.mark.parametrize("on_terminal", [True, False])
def test_a_remark_is_cut_on_a_terminal_and_whole_in_a_pipe(on_terminal):
    acting = [finding("active_limit", what=f"limit of the current number {k}") for k in range(4)]
    answer = of_run(result(acting))
    console = Console(
        width=160, record=True, file=io.StringIO(), force_terminal=on_terminal, no_color=True
    )
    print_answers(console, [answer], [result(acting).modes], (), details=False)
    text = " ".join(console.export_text().replace("│", " ").split())
    assert (answer.remark in text) is not on_terminal
    assert ("…" in text) is on_terminal


@pytest.mark.parametrize(
    ("events", "good", "remark"),
    [
        ((), True, "sg1 against sg2"),
        ((4.9,), True, "settles by 5 s; sg1"),
        ((1.0, 6.0), True, "settles by 5 s, before the events at 6 s; sg1"),
        ((5.0, 6.0), None, "the run ends at 5 s, before its events (t = 5 s, 6 s)"),
    ],
)
def test_a_run_that_ends_before_its_events_has_no_verdict(events, good, remark):
    """A run has no events at its end; growth that it shows before stays told."""
    run = result(events=events)
    answer = of_run(run)
    assert (answer.good, run.stable_in_simulation) == (good, good)
    assert remark in answer.remark
    grows = of_run(result([finding("growth")], events=events))
    assert (grows.good, grows.verdict) == (False, "UNSTABLE")


def test_a_run_that_is_stopped_before_its_event_says_so(tmp_path, capsys):
    text = lines(
        capsys, "run", "two_area_rms", "--scenario", "pod_p", "--stop", "0.1", "--out", tmp_path
    )
    assert "not known" in text[3]
    assert "the run ends at 0.1 s, before its events (t = 1 s)" in " ".join(
        " ".join(text[3:6]).replace("│", " ").split()
    )
    assert (
        json.loads((tmp_path / "summary.json").read_text())["scenarios"][0]["answer"]["stable"]
        is None
    )


def test_stable_eigenvalues_are_no_verdict_of_a_run_with_a_fault():
    run = result([finding("active_limit", represented=False)])
    assert of_modes(run.modes).good is True
    assert run.stable_in_simulation is None


def test_the_power_flow_is_given_and_written(capsys, tmp_path):
    assert main(["modes", "wscc9", "--scenario", "base", "--json", "--out", str(tmp_path)]) == 0
    (scenario,) = json.loads(capsys.readouterr().out)["scenarios"]
    flow = scenario["power_flow"]
    assert {"name", "v_pu", "angle_deg"} <= set(flow["buses"][0])
    assert {"name", "p_mw", "q_mvar", "loading_percent"} <= set(flow["machines"][0])
    assert flow["slack"]["units"] == ["sg1"]
    # what is fed is drawn by the loads and lost in branches
    assert flow["generation_mw"] - flow["losses_mw"] == pytest.approx(315.0, abs=1e-6)
    for machine in flow["machines"]:
        apparent = abs(complex(machine["p_mw"], machine["q_mvar"]))
        assert machine["loading_percent"] == pytest.approx(100 * apparent / machine["rating_mva"])
    with (tmp_path / "power_flow_branches.csv").open(encoding="utf-8", newline="") as file:
        assert len(list(csv.DictReader(file))) == len(flow["branches"])


def test_a_swing_that_grows_beside_a_faster_root_is_named():
    run = result()
    shape = np.array([1.0 + 0j, -0.8 + 0j])
    run.modes.modes[:] = [make_mode(0.05 + 4j, shape / 1.64, shape, SPEEDS)]
    root = make_mode(0.06 + 0j, shape / 1.64, shape, SPEEDS)
    run.modes.stability = Stability(False, root)
    run.modes.hidden = SimpleNamespace(frequency_range=(0.1, 2.0))
    remark = of_modes(run.modes).remark
    assert remark.startswith("grows at +0.06 1/s without oscillation: sg1.machine.omega; ")
    assert "the mode at 0.637 Hz grows as well: sg1 against sg2" in remark


@pytest.mark.parametrize(
    ("damping", "named"),
    [
        # 2.21 Hz with less than the answer's 4 %, and with more
        (-0.4, "of which machines swing in 1, LESS damped than those above: 2.210 Hz, 2.88 %"),
        (-4.0, "of which machines swing in 1; --details"),
    ],
)
def test_a_swing_outside_of_the_range_is_named_where_it_has_less_damping(damping, named):
    modes = result().modes
    swing = complex(damping, 2 * np.pi * 2.21)
    modes.hidden = Hidden((0.1, 2.0), 9, swing, (swing,))
    modes.prepared.case.path = Path("my grid.toml")
    text = outside([modes])
    assert named in text
    assert text.endswith("; --details tells of them.")
    assert ("(`gfor modes 'my grid.toml' --range 0.1:3`)" in text) == (damping == -0.4)
    assert "--details" not in outside([modes], details=True)


@pytest.mark.parametrize(
    ("decay", "stop", "said"),
    [
        # 1 s, not quite one period of 0.8 Hz, and 9 s with 4 % and without damping
        (0.2, 2.0, "keeps synchronism; has not settled by 5 s"),
        (0.2, 10.0, "keeps synchronism and settles by 5 s"),
        (0.0, 10.0, "keeps synchronism; has not settled by 5 s"),
    ],
)
def test_a_run_settles_where_its_last_swing_is_a_small_part_of_its_largest(decay, stop, said):
    run = result()
    times = np.arange(0.0, stop, 0.01)
    since = np.maximum(times - 1.0, 0.0)
    common = 1e-3 * times  # a frequency that drifts is no swing
    swing = 1e-3 * np.exp(-decay * since) * np.sin(5 * since)
    speeds = {"sg1.omega": 1 + common + swing, "sg2.omega": 1 + common - swing}
    run.dataset = xr.Dataset(
        {name: ("time", values) for name, values in speeds.items()}, coords={"time": times}
    )
    answer = of_run(run)
    assert (answer.verdict, answer.remark.partition("; sg1")[0]) == ("stable", said)
