"""What a user sees of an unstable system: on the terminal, in JSON, in files and in the exit code."""

import csv
import json
import re

import pytest

from orchestrator.face.cli import main

pytestmark = pytest.mark.usefixtures("undrawn")

FAST = ["--scenario", "gfor", "--set", "gfor.droop.R_f=10"]
"""A droop that makes the two-area system grow at 123 1/s and 37.9 Hz, far outside of the range that is shown."""


def output(capsys, *words):
    code = main([*map(str, words)])
    return code, capsys.readouterr().out


@pytest.mark.parametrize("more", [[], ["--critical"], ["--native", "--directional"]])
def test_modes_say_in_the_first_line_what_grows_outside_of_the_range(capsys, more):
    code, text = output(capsys, "modes", "two_area", *FAST, *more)
    assert code == 0
    assert re.search(
        r"SG \+ GFOR, with gfor.droop.R_f = 10.0.* +│ UNSTABLE .* grows at \+123 1/s at 37.86 Hz: gfor.droop.theta",
        text.splitlines()[3],
    )
    assert "a mode grows" not in text
    _, text = output(capsys, "modes", "two_area", *FAST, *more, "--details")
    assert "UNSTABLE: SG + GFOR: a mode grows at +123 1/s (37.86 Hz; gfor.droop.theta" in text
    assert "cause: the system" in text
    assert "outside 0.1 to 2 Hz; the least damped of them: 37.86 Hz, -45.93 %" in text


def test_json_has_the_verdict_and_fail_unstable_the_exit_code(capsys):
    code, text = output(capsys, "modes", "two_area", *FAST, "--json", "--fail-unstable")
    assert code == 1
    (scenario,) = json.loads(text)["scenarios"]
    assert scenario["stable"] is False
    assert scenario["largest_growth_rate"] == pytest.approx(123.0, abs=0.1)
    assert scenario["stability"]["cause"] == "system"
    assert scenario["outside_range"]["least_damped"]["frequency_hz"] == pytest.approx(
        37.86, abs=0.01
    )
    # nothing in the range shows it
    assert all(mode["damping_percent"] > 0 for mode in scenario["modes"])
    assert output(capsys, "modes", "two_area", "--scenario", "gfor", "--fail-unstable")[0] == 0


def test_a_run_says_it_in_terminal_summary_plots_and_report(tmp_path, capsys):
    code, text = output(
        capsys, "run", "two_area", *FAST, "--stop", "0.02", "--out", tmp_path, "--fail-unstable"
    )
    assert code == 1
    assert re.search(
        r"SG \+ GFOR, with gfor.droop.R_f = 10.0.* +│ UNSTABLE .* grows at \+123 1/s",
        text.splitlines()[3],
    )
    (scenario,) = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))["scenarios"]
    assert scenario["stable"] is False
    assert scenario["largest_growth_rate"] == pytest.approx(123.0, abs=0.1)
    assert output(capsys, "report", tmp_path)[0] == 0
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert 'SG + GFOR: <b class="bad">UNSTABLE: a mode grows at +123 1/s' in page


def test_a_linear_model_is_written_with_its_verdict(tmp_path, capsys):
    code, text = output(
        capsys, "export", "linear", "two_area", *FAST, "--out", tmp_path, "--fail-unstable"
    )
    assert code == 1
    assert text.startswith("UNSTABLE: SG + GFOR")
    verdict = json.loads((tmp_path / "gfor" / "stability.json").read_text(encoding="utf-8"))
    assert verdict["stable"] is False


def test_a_sweep_names_the_points_that_grow(tmp_path, capsys):
    words = (
        "sweep",
        "two_area",
        "--scenario",
        "gfor",
        "--vary",
        "gfor.droop.R_f=0.05,10",
        "--out",
        tmp_path,
    )
    code, text = output(capsys, *words, "--workers", "1", "--fail-unstable")
    assert code == 1
    first = text.splitlines()[0]
    assert first.startswith("UNSTABLE: SG + GFOR: at 1 of 2 points; least damping at gfor.droop.")
    assert "; worst at gfor.droop.R_f = 10 pu: " in first
    assert first.endswith(
        "; stable at gfor.droop.R_f = 0.05 pu, unstable at gfor.droop.R_f = 10 pu"
    )
    with (tmp_path / "sweep.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert {row["gfor.droop.R_f [pu]"]: row["stable"] for row in rows} == {
        "0.05": "true",
        "10.0": "false",
    }


def test_a_design_that_leaves_the_system_unstable_is_not_met(tmp_path, capsys):
    words = (
        "design",
        "two_area",
        "--controller",
        "pod_p",
        "--set",
        "gfor.droop.R_f=10",
        "--damping-increment",
        "5",
    )
    code, text = output(
        capsys, *words, "--no-margins", "--out", tmp_path / "pod.toml", "--json", "--fail-unstable"
    )
    sheet = json.loads(text)
    assert (code, sheet["stable"], sheet["met"]) == (1, False, False)
    assert "UNSTABLE" in sheet["verdict"]
