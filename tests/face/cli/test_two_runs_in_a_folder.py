"""Two commands in one folder of results: the second is refused, and no mixed recording is published."""

import json
import os
import shutil
import signal
import time

import pytest
import xarray as xr

from orchestrator.core.errors import InputError
from orchestrator.face.api.case import load
from orchestrator.face.cli import main
from orchestrator.face.cli import run as command
from orchestrator.output.results.lock import LOCK, hold_folder
from orchestrator.systems.coupling.observers import Progress
from tests.face.cli.test_resume import checkpoints_in

fcntl = pytest.importorskip("fcntl", reason="Windows has no such lock")

pytestmark = pytest.mark.usefixtures("undrawn")

SHORT = ("run", "infinite_bus", "--scenario", "dip", "--stop", "0.1")


@pytest.fixture
def live(warm, tmp_path):
    """A run that goes on for long in another process, and its folder."""
    words = (
        "infinite_bus",
        "--scenario",
        "dip",
        "--stop",
        "2000",
        "--checkpoint",
        "0.1",
        "--out",
        tmp_path / "out",
    )
    process = warm.started("run", *words, env=os.environ | {"TMPDIR": str(tmp_path)})
    end = time.monotonic() + 120
    while not checkpoints_in(tmp_path / "out"):
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < end
        time.sleep(0.02)
    yield process, tmp_path / "out"
    if process.poll() is None:
        process.kill()
        process.communicate()


@pytest.mark.slow
def test_a_live_run_keeps_its_folder(gfor, live):
    process, out = live
    request = (out / ".checkpoints" / "request.json").read_bytes()
    for words in (
        ("run", "--resume", out),
        (*SHORT, "--out", out),
        (*SHORT, "--like", "fmpy_ssp", "--out", out),
    ):
        code, _, error = gfor(*words)
        assert code == 2, words
        assert f"process {process.pid} works in this folder" in error
    assert (out / ".checkpoints" / "request.json").read_bytes() == request
    assert process.poll() is None
    process.send_signal(signal.SIGTERM)
    _, error = process.communicate(timeout=120)
    assert process.returncode == 143, error
    assert checkpoints_in(out)
    with xr.open_dataset(out / "dip" / "trajectory.nc") as data:
        assert data.sizes["time"] > 10
    assert not (out / LOCK).exists()


@pytest.mark.slow
def test_a_killed_run_leaves_its_folder_to_the_next(gfor, live):
    process, out = live
    process.kill()
    process.communicate()
    assert (out / LOCK).read_text().startswith(f"{process.pid} ")
    asked = json.loads((out / ".checkpoints" / "request.json").read_text())
    code, _, error = gfor(*SHORT, "--out", out)
    assert code == 0, error
    assert "holds an interrupted run, which is given up" in error
    with xr.open_dataset(out / "dip" / "trajectory.nc") as data:
        assert data.attrs["run"] != asked["run"]
    assert not (out / LOCK).exists()


def test_the_lock_is_given_back_after_an_error(tmp_path):
    with (
        hold_folder(tmp_path),
        pytest.raises(InputError, match=f"process {os.getpid()} works in this folder"),
    ):
        hold_folder(tmp_path).__enter__()
    with pytest.raises(ZeroDivisionError), hold_folder(tmp_path):
        1 / 0  # noqa: B018
    with hold_folder(tmp_path):
        assert (tmp_path / LOCK).exists()
    assert list(tmp_path.iterdir()) == []


class Loses(Progress):
    """Somebody empties the folder of the recording in the middle of the run, as a second run did."""

    done = False

    def observe(self, run):
        if run.time > 0.1 and not self.done:
            self.done = True
            (folder,) = self.out.glob("dip.part-*/recording")
            shutil.rmtree(folder)
            folder.mkdir()
            if self.planted is not None:
                shutil.copy(self.planted, folder / "000000000000.nc")


@pytest.mark.parametrize("planted", [False, True])
def test_rows_that_are_not_the_runs_are_not_published(gfor, monkeypatch, tmp_path, planted):
    assert gfor(*SHORT, "--out", tmp_path / "other")[0] == 0
    monkeypatch.setattr(Loses, "out", tmp_path / "out", raising=False)
    source = tmp_path / "other" / "dip" / "trajectory.nc" if planted else None
    monkeypatch.setattr(Loses, "planted", source, raising=False)
    monkeypatch.setattr(command, "Progress", lambda report: Loses(report, 500))
    monkeypatch.setattr("orchestrator.systems.coupling.recording_blocks.BLOCK_ROWS", 8)
    monkeypatch.setattr("orchestrator.systems.coupling.recording_blocks._FEWEST_ROWS", 8)
    words = ("run", "infinite_bus", "--scenario", "dip", "--stop", "0.2")
    code, _, error = gfor(*words, "--out", tmp_path / "out")
    assert not (tmp_path / "out" / "dip").exists()
    assert code == 1
    assert "follow each other there without a gap" in error


@pytest.fixture(scope="module")
def nothing_recorded(undrawn, tmp_path_factory):
    """Results whose recording has no row; they are read only."""
    folder = tmp_path_factory.mktemp("empty")
    assert main([*SHORT, "--out", str(folder)]) == 0
    file = folder / "dip" / "trajectory.nc"
    whole = xr.load_dataset(file)
    whole.isel(time=slice(0, 0)).to_netcdf(file)
    for manifest in folder.rglob("manifest.json"):
        manifest.unlink()
    return folder


@pytest.mark.parametrize(
    "words",
    [
        ("report", "{0}"),
        ("signal", "identify", "{0}/dip", "gfor.omega"),
        ("signal", "compare", "{0}/dip", "{0}/dip"),
    ],
)
def test_an_empty_recording_is_one_error(gfor, nothing_recorded, words):
    code, _, error = gfor(*(word.format(nothing_recorded) for word in words))
    assert code == 2
    assert "nothing was recorded in it" in error


@pytest.mark.parametrize(
    "left", ["dip.checkpoint", "dip.previous", "../dip.part-{}/recording/000000000000.nc", ""]
)
def test_a_new_run_says_that_it_gives_up_an_interrupted_one(gfor, tmp_path, left):
    """What a run of another id left: a checkpoint, the one before it, rows without a checkpoint, or nothing."""
    request = tmp_path / ".checkpoints" / "request.json"
    request.parent.mkdir()
    request.write_text(json.dumps({"run": "20260101T000000-0"}), encoding="utf-8")
    if left:
        path = request.parent / left.format("20260101T000000-0")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    code, _, error = gfor(*SHORT, "--out", tmp_path)
    assert code == 0
    assert error.count("holds an interrupted run, which is given up") == bool(left)


def test_other_commands_hold_the_folder_of_their_results_as_well(gfor, tmp_path):
    commands = {
        "modes": ("modes", "infinite_bus", "--scenario", "dip"),
        "sweep": ("sweep", "infinite_bus", "--scenario", "dip", "--vary", "gfor.P_0=0.4,0.6"),
    }
    with hold_folder(tmp_path):
        for name, words in commands.items():
            code, _, error = gfor(*words, "--out", tmp_path)
            assert code == 2, name
            assert f"process {os.getpid()} works in this folder" in error, name
    assert list(tmp_path.iterdir()) == []


def test_python_holds_the_folder_of_checkpoints_and_points(tmp_path):
    case = load("infinite_bus")
    with hold_folder(tmp_path):
        with pytest.raises(InputError, match="works in this folder"):
            case.scenario("dip").run(stop=0.1, checkpoints=tmp_path)
        with pytest.raises(InputError, match="works in this folder"):
            case.sweep({"gfor.P_0": [0.4, 0.6]}, ["dip"], folder=tmp_path)
    case.scenario("dip").run(stop=0.1, checkpoints=tmp_path / "new")
    assert list((tmp_path / "new").iterdir()) == []
