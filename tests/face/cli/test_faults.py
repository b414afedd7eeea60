"""What a user meets when the disk, the folder, the terminal or the process fails: one clear error, and what is kept.

The table is `.docs/validation/faults.md`.
"""

import json
import os
import resource
import shutil
import subprocess
import sys
import time
from io import BytesIO, TextIOWrapper
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr

from orchestrator.cases.case import load_case
from orchestrator.face.cli import main
from orchestrator.face.cli import run as command
from orchestrator.output.results import recording_writer
from orchestrator.output.results.manifest import read_manifest
from orchestrator.systems.coupling.observers import Progress
from tests.support.undrawn import UNDRAWN

pytestmark = pytest.mark.usefixtures("undrawn")

RUN = ("run", "infinite_bus", "--scenario", "dip", "--scenario", "load_step", "--stop", "1.5")
ONE = ("--workers", 1)  # in this process, with what a test changes in it


@pytest.fixture(scope="module")
def whole(undrawn, tmp_path_factory):
    """Results of `RUN`."""
    folder = tmp_path_factory.mktemp("whole")
    assert main([*map(str, (*RUN, *ONE)), "--out", str(folder)]) == 0
    return folder


@pytest.fixture
def results(whole, tmp_path):
    """A copy of them, which a test may change; slow tests alone do, or the quick ones would make them as well."""
    return shutil.copytree(whole, tmp_path / "results")


@pytest.fixture
def interfere(monkeypatch):
    """Call something once, while the second scenario of a run is simulated."""

    def prepare(action):
        calls = []

        class Once(Progress):
            def begin(self, master, stop_index):
                calls.append("begin")
                super().begin(master, stop_index)

            def observe(self, master):
                if calls == ["begin", "begin"] and master.time > 0.5:
                    calls.append("done")
                    action()

        monkeypatch.setattr(command, "Progress", lambda report: Once(report, 500))

    yield prepare
    limit = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit[1], limit[1]))


def test_no_room_in_the_middle_of_a_run(gfor, interfere, tmp_path):
    hard = resource.getrlimit(resource.RLIMIT_FSIZE)[1]
    interfere(lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (1500, hard)))
    code, _, error = gfor(*RUN, *ONE, "--out", tmp_path)
    resource.setrlimit(resource.RLIMIT_FSIZE, (hard, hard))
    assert code == 1
    assert error.count("error:") == 1
    assert "Traceback" not in error
    assert "scenario 'load_step'" in error
    assert "it cannot be written: File too large; raise the limit" in error
    assert f"What was computed until then is in {tmp_path}" in error
    assert xr.load_dataset(tmp_path / "dip" / "trajectory.nc").sizes["time"] > 100
    assert not (tmp_path / "load_step").exists()
    assert not (tmp_path / "summary.json").exists()


def test_the_folder_is_removed_in_the_middle_of_a_run(gfor, interfere, tmp_path):
    interfere(lambda: shutil.rmtree(tmp_path / "out"))
    code, _, error = gfor(*RUN, *ONE, "--out", tmp_path / "out")
    assert code == 1
    assert error.count("error:") == 1
    assert "Traceback" not in error
    assert "the folder was removed meanwhile; leave it in place while the command runs" in error


def test_a_recording_that_the_disk_cannot_hold_is_refused_before_the_start(
    gfor, monkeypatch, tmp_path
):
    monkeypatch.setattr(
        recording_writer.shutil, "disk_usage", lambda folder: SimpleNamespace(free=100_000)
    )
    code, _, error = gfor(*RUN, "--out", tmp_path)
    assert code == 2
    assert "the recordings would take about" in error
    assert "and 100 kB are free" in error
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("stop", "reason"), [("1e9", "take about"), ("9e6", "TB there")])
def test_a_run_of_many_years_or_many_terabytes_is_refused_with_the_reason(
    gfor, tmp_path, stop, reason
):
    code, _, error = gfor(
        "run", "infinite_bus", "--scenario", "dip", "--stop", stop, "--out", tmp_path
    )
    assert code == 2
    assert reason in error
    assert "Traceback" not in error


@pytest.mark.slow
def test_a_second_run_that_is_killed_does_not_mix_with_the_first(gfor, interfere, results):
    """The first scenario is replaced, the second is not: the page is refused."""
    assert gfor("report", results)[0] == 0

    interfere(lambda: os.rename(results / "summary.json", results / "kept"))
    assert gfor(*RUN, *ONE, "--set", "gfor.P_0=0.3", "--out", results)[0] == 0
    # the first run's, as if the second had not ended
    os.rename(results / "kept", results / "summary.json")
    code, _, error = gfor("report", results)
    assert code == 2
    assert "summary.json: " in error
    assert "of another run" in error


@pytest.mark.slow
def test_torn_results_are_refused_by_name_by_all_who_read_them(gfor, results):
    file = results / "dip" / "trajectory.nc"
    content = file.read_bytes()
    for torn in (
        content[: len(content) // 2],
        content[: len(content) // 2] + bytes(len(content) - len(content) // 2),
    ):
        file.write_bytes(torn)
        for words in (
            ("report", results),
            ("signal", "identify", results / "dip", "gfor.p"),
            ("signal", "identify", file, "gfor.p"),
            ("signal", "compare", results / "dip", results / "load_step"),
        ):
            code, _, error = gfor(*words)
            assert code == 2, words
            assert error.count("error:") == 1
            assert f"{file}: " in error


@pytest.mark.slow
def test_results_without_a_manifest_are_read_with_one_warning(gfor, results):
    for path in results.rglob("manifest.json"):
        path.unlink()
    for words in (
        ("report", results),
        ("signal", "compare", results / "dip", results / "load_step", "--signal", "gfor.p"),
    ):
        code, _, error = gfor(*words)
        assert code == 0
        assert error.count("warning:") == (2 if "compare" in words else 1)
        assert "there is no manifest.json of these results" in error


def test_all_files_of_a_run_are_listed_with_its_id(gfor, tmp_path):
    assert gfor(*RUN, "--no-csv", "--out", tmp_path)[0] == 0
    top, inner = read_manifest(tmp_path), read_manifest(tmp_path / "dip")
    assert {file.run for file in (*top.files.values(), *inner.files.values())} == {
        *top.scenarios.values()
    }
    there = {p.name for p in tmp_path.iterdir() if p.is_file()} - {"manifest.json"}
    assert there == {*top.files}
    assert {p.name for p in (tmp_path / "dip").iterdir()} == {"manifest.json", *inner.files}
    assert set(inner.files) == {"trajectory.nc", "modes.csv"}
    assert (
        xr.load_dataset(tmp_path / "dip" / "trajectory.nc").attrs["run"] in top.scenarios.values()
    )


@pytest.fixture
def words_of_any_script(tmp_path):
    """A short run of a case whose title has characters that terminals lack."""
    case = tmp_path / "case.toml"
    text = load_case("infinite_bus").text.replace('title = "', 'title = "Überlast λ 😀 ', 1)
    case.write_text(text, encoding="utf-8")
    own = (str(case), "--out", str(tmp_path), "--json")
    return ["run", *own, "--scenario", "dip", "--stop", "0.1"]


def test_a_terminal_that_lacks_most_characters(words_of_any_script):
    done = subprocess.run(
        [*UNDRAWN, *words_of_any_script],
        capture_output=True,
        check=False,
        env={**os.environ, "PYTHONIOENCODING": "ascii"},
    )
    assert done.returncode == 0
    assert b"Traceback" not in done.stderr
    assert json.loads(done.stdout.decode("ascii"))[0]["name"] == "dip"


@pytest.mark.parametrize("encoding", ["latin-1", "utf-8"])
def test_a_terminal_that_lacks_some_or_no_characters(words_of_any_script, monkeypatch, encoding):
    printed = {name: BytesIO() for name in ("stdout", "stderr")}
    for name, kept in printed.items():
        errors = "strict" if name == "stdout" else "backslashreplace"  # as Python has them
        monkeypatch.setattr(sys, name, TextIOWrapper(kept, encoding, errors, write_through=True))
    assert main(words_of_any_script) == 0
    assert b"Traceback" not in printed["stderr"].getvalue()
    assert json.loads(printed["stdout"].getvalue().decode(encoding))[0]["name"] == "dip"


KILLED = ("run", "two_area", "--scenario", "base", "--scenario", "gfor", "--stop", "2000", "--out")


@pytest.mark.slow
@pytest.mark.parametrize("wait", [0.1, 2.0])
def test_what_was_recorded_until_a_kill_can_be_read(gfor, warm, tmp_path, wait):
    process = warm.started(*KILLED, tmp_path, env=os.environ)
    until = time.monotonic() + 120
    while not list(tmp_path.glob("*.part-*/recording/[!.]*.nc")) and time.monotonic() < until:
        time.sleep(0.05)
    time.sleep(wait)
    process.kill()
    process.communicate()
    # without half-written ones
    begun = [place for place in tmp_path.glob("*.part-*") if list(place.rglob("[!.]*.nc"))]
    for place in (
        *begun,
        *(tmp_path / name for name in ("base", "gfor") if (tmp_path / name).exists()),
    ):
        code, _, error = gfor(
            "signal", "identify", place, "sg1.omega - sg2.omega", "--start", "0", "--json"
        )
        assert code in (0, 1), error  # 1: too short, or constant
        assert "Traceback" not in error
    assert gfor("report", tmp_path)[0] == 2


@pytest.mark.parametrize("interval", ["0.25 ms", "100 s"])
def test_a_record_interval_that_is_not_kept_is_said(gfor, tmp_path, interval):
    text = load_case("infinite_bus").text
    assert "record_interval" in text
    lines = [
        f'record_interval = "{interval}"' if "record_interval" in line else line
        for line in text.splitlines()
    ]
    case = tmp_path / "case.toml"
    case.write_text("\n".join(lines), encoding="utf-8")
    code, _, error = gfor(
        "run", case, "--scenario", "dip", "--stop", "1.2", "--out", tmp_path / "out"
    )
    assert code == 0
    said = (
        "is no multiple of the communication step"
        if "ms" in interval
        else "its start is the only row"
    )
    assert error.count("question:") == 1
    assert said in error
    assert "record_interval" in error


def test_rows_through_a_low_pass_filter(gfor, tmp_path):
    text = load_case("infinite_bus").text
    lines = [line for line in text.splitlines() if "record_interval" not in line]
    at = lines.index("[solver]") + 1
    plain, filtered = tmp_path / "plain.toml", tmp_path / "filtered.toml"
    plain.write_text(
        "\n".join([*lines[:at], 'record_interval = "20 ms"', *lines[at:]]), encoding="utf-8"
    )
    more = ['record_interval = "20 ms"', 'record_filter = "low-pass"']
    filtered.write_text("\n".join([*lines[:at], *more, *lines[at:]]), encoding="utf-8")
    runs = []
    for case in (plain, filtered):
        assert (
            gfor("run", case, "--scenario", "dip", "--stop", "2", "--out", tmp_path / case.stem)[0]
            == 0
        )
        runs.append(xr.load_dataset(tmp_path / case.stem / "dip" / "trajectory.nc"))
    summaries = [
        json.loads((tmp_path / c.stem / "summary.json").read_text(encoding="utf-8"))
        for c in (plain, filtered)
    ]
    one, other = (run["gfor.p"].values for run in runs)
    assert np.array_equal(runs[0]["time"], runs[1]["time"])
    assert one[0] == pytest.approx(other[0], abs=1e-9)
    assert 1e-6 < np.abs(one - other).max() < np.abs(one - one[0]).max()
    assert summaries[0]["scenarios"][0]["findings"] == summaries[1]["scenarios"][0]["findings"]


def test_an_interrupt_while_a_command_is_imported(gfor, monkeypatch):
    def interrupted(name):
        raise KeyboardInterrupt

    monkeypatch.setattr("orchestrator.face.cli.import_module", interrupted)
    code, _, error = gfor("run", "two_area")
    assert (code, error) == (130, "interrupted\n")


def test_a_page_that_cannot_be_written(gfor, tmp_path):
    """The folder of the page is a file."""
    assert gfor(*RUN[:4], "--stop", "1.2", "--out", tmp_path / "out")[0] == 0
    (tmp_path / "file").write_text("", encoding="utf-8")
    code, _, error = gfor("report", tmp_path / "out", "--out", tmp_path / "file" / "page.html")
    assert code == 1
    assert error.count("error:") == 1
    assert "page.html: it cannot be written" in error
