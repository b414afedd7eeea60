"""After Ctrl-C or SIGTERM the last line says how a command goes on, and what it says is not refused."""

import os
import shlex
import signal

import pytest

from orchestrator.face.cli import run as command
from orchestrator.face.cli import study as study_command
from orchestrator.face.cli.checkpoints import Checkpoints
from orchestrator.face.cli.interrupted import is_interrupt
from orchestrator.studies.points.store import PointStore
from orchestrator.studies.points.study import PointStudy
from orchestrator.studies.runs import run as study
from orchestrator.systems.coupling.observers import Progress

RUN = ("run", "infinite_bus", "--scenario", "dip", "--stop", "1.3")
SWEEP = (
    "sweep",
    "infinite_bus",
    "--scenario",
    "dip",
    "--vary",
    "gfor.P_0=0.4,0.6",
    "--workers",
    "1",
)


def interrupts(*_, **__):
    raise KeyboardInterrupt


def resumed(gfor, said):
    """Do what the last line advises."""
    advice = said.splitlines()[-1]
    words = shlex.split(
        advice[
            advice.index("gfor run --resume") : advice.index(" begins")
            if " begins" in advice
            else advice.index(" goes on")
        ]
    )
    code, _, error = gfor(*words[1:])
    return code, error


@pytest.mark.parametrize("stage", ["modes_of", "save_study"])
def test_a_run_before_its_first_checkpoint(gfor, tmp_path, monkeypatch, stage):
    """While modes are computed, and while the files of a study too short for a checkpoint are written."""
    out = tmp_path / "a night"
    with monkeypatch.context() as planted:
        planted.setattr(study if stage == "modes_of" else command, stage, interrupts)
        code, _, error = gfor(*RUN, "--out", out)
    assert code == 130
    said = f"interrupted: gfor run --resume '{out}' begins it again; there was no checkpoint yet"
    assert error.splitlines()[-1] == said
    assert resumed(gfor, error)[0] == 0
    assert (out / "dip" / "trajectory.nc").exists()


def test_a_run_after_a_checkpoint(gfor, tmp_path, monkeypatch):
    class Stops(Progress):
        def observe(self, run):
            if run.time > 0.5:
                os.kill(os.getpid(), signal.SIGTERM)

    with monkeypatch.context() as planted:
        planted.setattr(command, "Progress", Stops)
        code, _, error = gfor(*RUN, "--out", tmp_path)
    assert code == 143
    assert "ended by SIGTERM at t = 0.6 s" in error
    assert error.splitlines()[-1] == f"gfor run --resume {tmp_path} goes on from there"
    code, error = resumed(gfor, error)
    assert (code, "it goes on from t = 0.6 s" in error) == (0, True)


@pytest.mark.parametrize("engine", [(), ("--checkpoint", "0")])
def test_a_run_of_which_nothing_is_kept(gfor, tmp_path, monkeypatch, engine):
    """During the power flow, also where another run's checkpoints lie in the folder, and without checkpoints."""
    with monkeypatch.context() as planted:
        planted.setattr(study, "modes_of", interrupts)
        assert gfor(*RUN, "--out", tmp_path)[0] == 130
    assert (tmp_path / ".checkpoints").exists()
    with monkeypatch.context() as planted:
        planted.setattr(*((command, "chosen") if not engine else (study, "modes_of")), interrupts)
        assert gfor(*RUN, *engine, "--out", tmp_path) == (130, "", "interrupted\n")
    if engine:
        assert gfor("run", "--resume", tmp_path)[0] == 2


def test_a_resumed_run_that_is_interrupted_early(gfor, tmp_path, monkeypatch):
    with monkeypatch.context() as planted:
        planted.setattr(study, "modes_of", interrupts)
        assert gfor(*RUN, "--out", tmp_path)[0] == 130
        planted.setattr(command, "chosen", interrupts)
        said = f"interrupted: gfor run --resume {tmp_path} begins it again; there was no checkpoint yet\n"
        assert gfor("run", "--resume", tmp_path) == (130, "", said)


def test_the_interval_of_the_checkpoints_is_kept(gfor, tmp_path, monkeypatch):
    seen = []

    def noted(self, prepared, folder, every, *, begin=Checkpoints.__init__, **options):
        seen.append(every)
        begin(self, prepared, folder, every, **options)

    monkeypatch.setattr(Checkpoints, "__init__", noted)
    with monkeypatch.context() as planted:
        planted.setattr(study, "modes_of", interrupts)
        for words in (
            (*RUN, "--checkpoint", "7", "--out"),
            ("run", "--resume"),
            ("run", "--checkpoint", "5", "--resume"),
            ("run", "--resume"),
        ):
            assert gfor(*words, tmp_path)[0] == 130
    assert gfor("run", "--resume", tmp_path)[0] == 0
    assert seen == [7, 7, 5, 5, 5]


def test_a_sweep_of_which_nothing_is_kept(gfor, tmp_path, monkeypatch):
    for place, stage in ((study_command, "print_questions"), (PointStudy, "compute")):
        with monkeypatch.context() as planted:
            planted.setattr(place, stage, interrupts)
            assert gfor(*SWEEP, "--out", tmp_path) == (130, "", "interrupted\n")


def test_a_sweep_whose_points_are_kept(gfor, tmp_path, monkeypatch):
    """It is interrupted while its files are written, and another time before its points are counted."""
    said = f"points are in {tmp_path}; the same command continues from there\n"
    with monkeypatch.context() as planted:
        planted.setattr(study_command, "present", interrupts)
        assert gfor(*SWEEP, "--out", tmp_path) == (130, "", f"interrupted: 2 of 2 {said}")
        planted.setattr(study_command, "print_questions", interrupts)
        assert gfor(*SWEEP, "--out", tmp_path) == (130, "", f"interrupted: {said}")
    _, text, _ = gfor(*SWEEP, "--out", tmp_path)
    assert "0 points computed, 2 were there already" in text


def test_a_design_of_which_nothing_is_kept(gfor, tmp_path, monkeypatch):
    monkeypatch.setattr(PointStore, "load", interrupts)
    words = ("design", "two_area", "--controller", "pod_p", "--out", tmp_path / "pod.toml")
    code, out, err = gfor(*words)
    assert (code, out) == (130, "")
    assert err.splitlines()[-1] == "interrupted"  # behind the stages that it went through
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("behind", [ValueError("a"), KeyboardInterrupt()])
def test_an_error_that_stands_behind_its_own_cause(behind):
    error = RuntimeError("kept, and raised again")
    error.__cause__, behind.__context__ = behind, error
    assert is_interrupt(error) == isinstance(behind, KeyboardInterrupt)
