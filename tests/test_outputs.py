"""Two folders of outputs are compared to the last digit, key, row and line, but for differences that are named."""

import json
from zipfile import ZipFile

import numpy as np
import pytest
import xarray as xr
from scipy.io import savemat

from orchestrator.face import cli
from tests.benchmarks import outputs
from tests.benchmarks.outputs import COMMANDS, compare


def _folders(tmp_path, before, after):
    folders = []
    for name, files in (("before", before), ("after", after)):
        folder = tmp_path / name
        folder.mkdir()
        for file, text in files.items():
            (folder / file).write_text(text, encoding="utf-8")
        folders.append(folder)
    return folders


def test_the_last_digit_of_a_figure_counts(tmp_path):
    before, after = (
        '{"modes": [{"real": -0.38918872130123}]}',
        '{"modes": [{"real": -0.38918872130124}]}',
    )
    folders = _folders(tmp_path, {"modes.json": before}, {"modes.json": after})
    assert compare(*folders, []) == [
        "modes.json: .modes[0].real: '-0.38918872130123' -> '-0.38918872130124'"
    ]


def test_a_lost_key_a_lost_row_a_changed_line_and_a_lost_file_are_found(tmp_path):
    before = {
        "a.json": json.dumps({"x": 1, "y": 2}),
        "b.csv": "name,f\na,1\nb,2\n",
        "c.txt": "one\ntwo\n",
        "d.png": "",
    }
    after = {"a.json": json.dumps({"x": 1}), "b.csv": "name,f\na,1\n", "c.txt": "one\n2\n"}
    places = [line.rsplit(": ", 1)[0] for line in compare(*_folders(tmp_path, before, after), [])]
    assert places == [
        "a.json: .keys",
        "a.json: .y",
        "b.csv: row 2",
        "c.txt: line 1",
        "d.png: the file",
    ]


def test_a_difference_that_is_named_and_the_speed_of_a_run_are_left_out(tmp_path):
    before = {"a.json": '{"steps_per_second": 1.5, "title": "old"}', "b.txt": "2026-11-28 20:00:01"}
    after = {"a.json": '{"steps_per_second": 2.5, "title": "new"}', "b.txt": "2026-11-29 21:00:02"}
    folders = _folders(tmp_path, before, after)
    assert compare(*folders, ["a.json: .title"]) == []
    assert len(compare(*folders, [])) == 1


def test_binary_files_differ_by_their_content_and_not_by_the_time_of_their_writing(tmp_path):
    folders = [tmp_path / "before", tmp_path / "after"]
    for k, folder in enumerate(folders):
        folder.mkdir()
        values = np.array([1.0, 2.0 + k * 1e-15])
        np.savez(folder / "a.npz", same=np.ones(2), other=values)
        savemat(folder / "b.mat", {"same": np.ones(2), "other": values})
        xr.Dataset({"other": ("x", values, {"unit": "pu"[: 2 - k]})}).to_netcdf(folder / "c.nc")
        with ZipFile(folder / "d.ssp", "w") as archive:
            archive.writestr(f"resources/{k}.bin", "")
            archive.writestr("system.ssd", f"<same/>\n<gain value='{k}'/>\n")
    assert [line.rsplit(": ", 1)[0] for line in compare(*folders, [])] == [
        "a.npz: other",
        "b.mat: other",
        "c.nc: other",
        "c.nc: other.unit",
        "d.ssp: files",
        "d.ssp: system.ssd line 1",
    ]


def test_paths_of_two_trees_and_the_hash_of_their_code_are_no_difference(tmp_path):
    texts = [f"/trees/{name}/case.toml: code {12 * name}: x = 1" for name in "ab"]
    folders = _folders(tmp_path, {"a.txt": texts[0]}, {"a.txt": texts[1]})
    assert len(compare(*folders, [])) == 1
    for folder, name in zip(folders, "ab", strict=True):
        (folder / outputs.TREE).write_text(f"/trees/{name}", encoding="utf-8")
    assert compare(*folders, []) == []


def test_a_command_that_is_refused_by_mistake_is_named(tmp_path, monkeypatch):
    """Two folders in which a command was refused are alike, and show nothing."""
    monkeypatch.setattr(outputs, "COMMANDS", {"wrong": "no-such-command"})
    (line,) = outputs.write(tmp_path, ["wrong"])
    assert line.startswith("wrong: exit code 2: ")
    assert "no-such-command" in line


def test_a_folder_with_kept_points_is_refused(tmp_path):
    (tmp_path / "points").mkdir()
    with pytest.raises(SystemExit, match="give a new folder"):
        outputs.write(tmp_path, [])


def test_code_of_another_tree_than_the_one_asked_for_is_refused(tmp_path):
    with pytest.raises(SystemExit, match="Python takes orchestrator from"):
        outputs.write(tmp_path / "out", [], tmp_path)


def test_every_command_that_computes_is_compared():
    """A study, ours or a colleague's, is a command; those of the list show nothing that is computed or need a peer."""
    shown = {" ".join(words.split()[:count]) for words in COMMANDS.values() for count in (1, 2)}
    assert set(cli.COMMANDS) - shown == {
        "explore",
        "export dll",
        "master federate",
        "mcp",
        "sign",
    }
