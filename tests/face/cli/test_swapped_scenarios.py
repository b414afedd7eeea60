"""Folders of scenarios that somebody swapped: a report would show each run under the other one's title."""

import json
import shutil

import pytest

from orchestrator.face.cli import main

pytestmark = pytest.mark.slow  # all of them, or the quick ones would make the results as well

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


@pytest.fixture(scope="module")
def whole(undrawn, tmp_path_factory):
    """Results of which a report was made."""
    folder = tmp_path_factory.mktemp("whole")
    assert main([*WORDS, "--out", str(folder)]) == 0
    assert main(["report", str(folder)]) == 0
    return folder


@pytest.fixture
def results(whole, tmp_path):
    """A copy of them, which a test may change."""
    return shutil.copytree(whole, tmp_path / "results")


def test_a_report_refuses_a_manifest_of_another_scenario(gfor, results):
    """The recordings of older versions do not say of which scenario they are."""
    manifest = results / "dip" / "manifest.json"
    content = json.loads(manifest.read_text(encoding="utf-8"))
    manifest.write_text(json.dumps(content | {"scenario": "load_step"}), encoding="utf-8")
    code, _, error = gfor("report", results)
    assert code == 2
    assert "is the recording of scenario 'load_step', and lies in the folder of 'dip'" in " ".join(
        error.split()
    )


@pytest.mark.parametrize("swapped", ["folder", "trajectory.nc", "linear.nc"])
def test_a_report_refuses_them(gfor, results, swapped):
    if swapped == "folder":
        (results / "dip").rename(results / "aside")
        (results / "load_step").rename(results / "dip")
        (results / "aside").rename(results / "load_step")
    else:
        for manifest in results.rglob("manifest.json"):
            manifest.unlink()
        shutil.copy(results / "load_step" / swapped, results / "dip" / swapped)
    code, _, error = gfor("report", results)
    assert code == 2
    assert "is the recording of scenario 'load_step', and lies in the folder of 'dip'" in " ".join(
        error.split()
    )
