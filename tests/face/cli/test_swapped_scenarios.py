"""Folders of scenarios that somebody swapped: a report would show each run under the other one's title."""

import json
import shutil

import pytest

WORDS = (
    "run",
    "infinite_bus",
    "--scenario",
    "dip",
    "--scenario",
    "load_step",
    "--stop",
    "1.2",
    "--no-csv",
    "--linear",
)


def test_a_report_refuses_a_manifest_of_another_scenario(gfor, tmp_path):
    """The recordings of older versions do not say of which scenario they are."""
    assert gfor(*WORDS, "--out", tmp_path)[0] == 0
    manifest = tmp_path / "dip" / "manifest.json"
    content = json.loads(manifest.read_text(encoding="utf-8"))
    manifest.write_text(json.dumps(content | {"scenario": "load_step"}), encoding="utf-8")
    code, _, error = gfor("report", tmp_path)
    assert code == 2
    assert "is the recording of scenario 'load_step', and lies in the folder of 'dip'" in " ".join(
        error.split()
    )


@pytest.mark.parametrize("swapped", ["folder", "trajectory.nc", "linear.nc"])
def test_a_report_refuses_them(gfor, tmp_path, swapped):
    assert gfor(*WORDS, "--out", tmp_path)[0] == 0
    assert gfor("report", tmp_path)[0] == 0
    if swapped == "folder":
        (tmp_path / "dip").rename(tmp_path / "aside")
        (tmp_path / "load_step").rename(tmp_path / "dip")
        (tmp_path / "aside").rename(tmp_path / "load_step")
    else:
        for manifest in tmp_path.rglob("manifest.json"):
            manifest.unlink()
        shutil.copy(tmp_path / "load_step" / swapped, tmp_path / "dip" / swapped)
    code, _, error = gfor("report", tmp_path)
    assert code == 2
    assert "is the recording of scenario 'load_step', and lies in the folder of 'dip'" in " ".join(
        error.split()
    )
