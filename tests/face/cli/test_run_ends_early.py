"""`gfor run` that ends before its time: what was computed is kept, and said to be there."""

import json
import os
import subprocess
import sys

import pytest
import xarray as xr

from orchestrator.core.errors import AnalysisError
from orchestrator.face.cli import run as command
from orchestrator.studies.runs import run as study
from orchestrator.studies.runs.run import run_scenario
from orchestrator.systems.coupling.observers import Progress

pytestmark = pytest.mark.usefixtures("undrawn")

WORDS = (
    "run",
    "two_area",
    "--scenario",
    "base",
    "--scenario",
    "gfor",
    "--scenario",
    "pod_p",
    "--stop",
    "2",
    "--workers",
    "1",
)
NEVER = "SG + GFOR; never begun: SG + GFOR POD-P"


class Stops(Progress):
    """Ctrl-C as it arrives between two steps, in the second scenario."""

    def observe(self, master):
        if "gfor" in master.components and master.time > 1.5:
            raise KeyboardInterrupt


@pytest.mark.parametrize("output", [(), ("--json",)])
def test_in_the_middle_of_a_scenario(gfor, monkeypatch, tmp_path, output):
    monkeypatch.setattr(command, "Progress", Stops)
    code, text, error = gfor(*WORDS, "--out", tmp_path, *output)
    assert code == 130
    assert "scenario 'gfor': interrupted at t = 1.6 s" in error
    assert "error" not in error
    assert f"What was computed until then is in {tmp_path}" in error
    whole, part = (xr.load_dataset(tmp_path / name / "trajectory.nc") for name in ("base", "gfor"))
    assert float(whole["time"].max()) == pytest.approx(2.0)
    assert float(part["time"].max()) == pytest.approx(1.6)
    summary = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))
    assert summary["ended_early"] == {
        "word": "interrupted",
        "place": f"in {NEVER}",
        "not_begun": ["pod_p"],
    }
    base, other = summary["scenarios"]
    assert (base["failure"], base["interrupted"]) == (None, False)
    assert (other["failure"], other["interrupted"]) == ("interrupted at t = 1.6 s", True)
    assert output or text.startswith(f"interrupted in {NEVER}\n")
    assert gfor("report", tmp_path)[0] == 0
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert f'<b class="soft">interrupted</b> in {NEVER}<' in page
    assert "the run was interrupted at t = 1.6 s" in page
    assert "the run failed" not in page
    assert not output or len(json.loads(text)) == 2


@pytest.mark.parametrize(
    ("error", "code", "said"),
    [
        (KeyboardInterrupt(), 130, "scenario 'gfor': interrupted"),
        (AnalysisError("no steady state"), 1, "error: scenario 'gfor': no steady state"),
    ],
)
def test_between_two_scenarios(gfor, monkeypatch, tmp_path, error, code, said):
    def only_one(prepared, **options):
        if prepared.name == "gfor":
            raise error
        return run_scenario(prepared, **options)

    monkeypatch.setattr(study, "run_scenario", only_one)
    ended, printed, text = gfor(*WORDS, "--out", tmp_path)
    assert ended == code
    word = "interrupted" if code == 130 else "failed"
    assert printed.startswith(f"{word} in {NEVER.replace(';', ', of which nothing is kept;')}\n")
    assert text.startswith(f"{said}\nWhat was computed until then is in ")
    assert (
        len(json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))["scenarios"]) == 1
    )


def test_before_anything_is_done(gfor, monkeypatch, tmp_path):
    def none(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(study, "run_scenario", none)
    said = (
        f"interrupted: gfor run --resume {tmp_path} begins it again; there was no checkpoint yet\n"
    )
    assert gfor(*WORDS, "--out", tmp_path) == (130, "", said)
    assert gfor(*WORDS, "--out", tmp_path, "--checkpoint", "0") == (130, "", "interrupted\n")


def test_a_library_in_c_made_another_error_of_the_interrupt(gfor, monkeypatch, tmp_path):
    def as_h5py_does(*_, **__):
        try:
            raise KeyboardInterrupt
        except KeyboardInterrupt as interrupt:
            raise SystemError("returned a result with an exception set") from interrupt

    monkeypatch.setattr(study, "run_scenario", as_h5py_does)
    said = (
        f"interrupted: gfor run --resume {tmp_path} begins it again; there was no checkpoint yet\n"
    )
    assert gfor(*WORDS, "--out", tmp_path) == (130, "", said)


def test_an_interrupt_inside_exec_leaves_the_exit_code_alone(tmp_path):
    code = """
import sys
from orchestrator.face import cli
cli._execute = lambda words, alone: exec("raise KeyboardInterrupt")
sys.exit(cli.main())
"""
    (tmp_path / "planted.py").write_text(code, encoding="utf-8")
    call = [sys.executable, "-m", "planted", "modes"]  # of a script, Python forgets the interrupt
    done = subprocess.run(
        call,
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | {"PYTHONPATH": str(tmp_path)},
    )
    assert (done.returncode, done.stderr) == (130, "interrupted\n")
