"""Results are put in their place whole, and files that do not belong together are refused by name."""

import json
import os
import resource
import shutil
import warnings

import pytest

from orchestrator.core.errors import InputError, ResultsError
from orchestrator.core.safe_files import write_text
from orchestrator.output.report.html.folder import sweeps_of
from orchestrator.output.results.manifest import (
    MANIFEST,
    ResultsWarning,
    check_one_run,
    checked,
    read_manifest,
)
from orchestrator.output.results.staging import ScenarioFolder, mend, staged, unfinished

TOP, INNER = ("summary.json", "modes.csv"), ("trajectory.nc", "linear.nc")


def write(folder, run, scenarios=("one", "two"), value="0.3", ends=True):
    """A run that leaves the same files as another, with other content of the same length; it may end early."""
    for name in scenarios:
        place = ScenarioFolder(folder, name, run)
        write_text(place.path / "trajectory.nc", f"{name} {value}")
        place.publish()
    if ends:
        with staged(folder, run, scenarios) as staging:
            for name in TOP:
                write_text(staging / name, f"{name} {value}")


def check(folder):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_one_run(folder, TOP, INNER)


def test_a_run_is_accepted_and_so_is_another_in_its_place(tmp_path):
    write(tmp_path, "r1")
    check(tmp_path)
    write(tmp_path, "r2", value="0.6")
    check(tmp_path)
    assert (tmp_path / "one" / "trajectory.nc").read_text(encoding="utf-8") == "one 0.6"
    assert sorted(p.name for p in tmp_path.iterdir()) == [
        MANIFEST,
        "modes.csv",
        "one",
        "summary.json",
        "two",
    ]
    assert {f.run for f in read_manifest(tmp_path).files.values()} == {"r2"}


def test_a_second_run_that_was_killed_is_not_mixed_with_the_first(tmp_path):
    write(tmp_path, "r1")
    write(tmp_path, "r2", scenarios=["one"], value="0.6", ends=False)
    with pytest.raises(
        InputError,
        match=r"one: it is of run r2, and the summary in .* of run r1: another run into this",
    ):
        check(tmp_path)
    write(tmp_path, "r3")
    check(tmp_path)


def test_scenarios_that_the_last_run_did_not_have_do_not_matter(tmp_path):
    write(tmp_path, "r1")
    write(tmp_path, "r2", scenarios=["two"])
    check(tmp_path)
    assert read_manifest(tmp_path).scenarios == {"two": "r2"}


FAULTS = {
    "cut": (lambda content: content[:-1], "bytes, and run r1 wrote"),
    "empty": (lambda content: b"", "it has 0 bytes, and run r1 wrote"),
    "zeroed": (lambda content: bytes(len(content)), r"SHA-256 differs"),
    "flipped": (lambda content: bytes([content[0] ^ 1]) + content[1:], r"SHA-256 differs"),
    "grown": (lambda content: content + b" ", "bytes, and run r1 wrote"),
}


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("name", ["summary.json", "modes.csv", "two/trajectory.nc"])
def test_a_file_that_is_not_as_it_was_written_is_named(tmp_path, name, fault):
    write(tmp_path, "r1")
    change, said = FAULTS[fault]
    path = tmp_path / name
    path.write_bytes(change(path.read_bytes()))
    with pytest.raises(InputError, match=said) as caught:
        check(tmp_path)
    assert str(caught.value).startswith(str(path))


def test_a_file_that_is_gone_is_named(tmp_path):
    write(tmp_path, "r1")
    (tmp_path / "one" / "trajectory.nc").unlink()
    with pytest.raises(
        InputError, match=r"one/trajectory\.nc: this file of run r1 cannot be read: No such file"
    ):
        check(tmp_path)


def test_a_folder_that_is_gone_is_named(tmp_path):
    write(tmp_path, "r1")
    shutil.rmtree(tmp_path / "two")
    with pytest.raises(InputError, match="two: it is of run no run that is known"):
        check(tmp_path)


@pytest.mark.parametrize("text", ["", "{", "[]", '{"files": {"a": 1}}', '{"run": "x"}'])
def test_a_damaged_manifest_is_one_error(tmp_path, text):
    write(tmp_path, "r1")
    (tmp_path / MANIFEST).write_text(text, encoding="utf-8")
    with pytest.raises(
        InputError, match=r"manifest\.json: it cannot be read as the list of a run's files"
    ):
        check(tmp_path)


def test_modes_of_another_command_in_the_same_folder_are_not_taken_for_the_runs(tmp_path):
    write(tmp_path, "r1")
    with staged(tmp_path, "r2") as staging:
        write_text(staging / "modes.csv", "other")
    with pytest.raises(InputError, match=r"modes\.csv is of run r2, and summary\.json of run r1"):
        check(tmp_path)


def test_a_sweep_in_the_same_folder_leaves_the_run_as_it_is(tmp_path):
    write(tmp_path, "r1")
    with staged(tmp_path, "r2") as staging:
        write_text(staging / "sweep.nc", "other")
    check(tmp_path)
    assert checked(tmp_path, ["sweep.nc"]).files["sweep.nc"].run == "r2"


def test_a_report_refuses_a_sweep_that_was_changed_after_it_was_written(tmp_path):
    with staged(tmp_path, "r1") as staging:
        write_text(staging / "sweep.nc", "as it was")
    write_text(tmp_path / "sweep.nc", "as it is ")
    with pytest.raises(InputError, match=r"sweep\.nc: its content is not what run r1 wrote"):
        sweeps_of(tmp_path)


def test_results_of_older_versions_are_read_with_a_warning(tmp_path):
    write_text(tmp_path / "summary.json", "{}")
    with pytest.warns(ResultsWarning, match=r"there is no manifest\.json of these results"):
        check_one_run(tmp_path, TOP, INNER)


def test_what_fails_in_the_middle_leaves_what_was_there(tmp_path):
    write(tmp_path, "r1")

    def fail():
        with staged(tmp_path, "r2") as staging:
            write_text(staging / "summary.json", "new")
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail()
    check(tmp_path)
    assert not list(tmp_path.glob(".part*"))


def test_no_room_for_the_second_file(tmp_path):
    write(tmp_path, "r1")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)

    def fill():
        with staged(tmp_path, "r2") as staging:
            write_text(staging / "summary.json", "new")
            resource.setrlimit(resource.RLIMIT_FSIZE, (100, before[1]))
            write_text(staging / "modes.csv", "new" * 1000)

    try:
        with pytest.raises(ResultsError, match="File too large"):
            fill()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    check(tmp_path)


def test_a_file_keeps_its_content_until_the_new_one_is_whole(tmp_path):
    path = tmp_path / "a.txt"
    write_text(path, "old")
    (tmp_path / "other").mkdir()
    path.chmod(0o444)
    with pytest.raises(ResultsError, match="it cannot be written"):
        write_text(tmp_path / "other" / "x" / ("n" * 300), "new")
    write_text(path, "new")
    assert path.read_text(encoding="utf-8") == "new"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.txt", "other"]


def test_what_a_killed_process_had_put_aside_comes_back(tmp_path):
    write(tmp_path, "r1")
    os.rename(tmp_path / "one", tmp_path / "one.old-r2")
    mend(tmp_path)
    check(tmp_path)
    shutil.copytree(tmp_path / "one", tmp_path / "one.old-r3")
    mend(tmp_path)
    assert not (tmp_path / "one.old-r3").exists()


def test_folders_of_runs_that_did_not_end_are_listed(tmp_path):
    ScenarioFolder(tmp_path, "one", "r1")
    (tmp_path / ".part-r1").mkdir()
    assert [p.name for p in unfinished(tmp_path)] == ["one.part-r1"]


def test_a_resumed_run_removes_what_its_kill_left_half_written(tmp_path):
    killed = ScenarioFolder(tmp_path, "one", "r1")
    for name in ("trajectory.nc", "recording/000000000000.nc"):
        write_text(killed.path / name, "whole")
        write_text((killed.path / name).with_name(f".part-7-{name[-5:]}"), "half")
    place = ScenarioFolder(tmp_path, "one", "r1").publish()
    files = {path.relative_to(place).as_posix() for path in place.rglob("*") if path.is_file()}
    assert files == {"trajectory.nc", "recording/000000000000.nc", MANIFEST}


def test_each_file_is_listed_with_its_run(tmp_path):
    write(tmp_path, "r1")
    content = json.loads((tmp_path / "one" / MANIFEST).read_text(encoding="utf-8"))
    assert content["files"]["trajectory.nc"]["run"] == "r1"
    assert content["files"]["trajectory.nc"]["bytes"] == len("one 0.3")
    assert len(content["files"]["trajectory.nc"]["sha256"]) == 64
    assert content["made_by"]["gfor-cosim"]


def test_a_folder_within_is_listed_by_its_files(tmp_path):
    """Neither the folder itself nor a manifest that another command left in it is a file of this run."""
    with staged(tmp_path, "r1") as staging:
        (staging / "inner").mkdir()
        (staging / "inner" / "a.txt").write_text("x", encoding="utf-8")
        (staging / "inner" / MANIFEST).write_text("{}", encoding="utf-8")
    assert [*read_manifest(tmp_path).files] == ["inner/a.txt"]
