"""What `gfor explore` opens: runs, recordings and certificates."""

import json
import math

import numpy as np
import pytest

import orchestrator as gfor
from orchestrator.core.errors import InputError
from orchestrator.face.cli import main
from orchestrator.face.explore.opened import opened
from orchestrator.face.explore.worker import Desk
from orchestrator.output.results.csv_recording import read_table
from tests.studies.certification.test_issued import a_damping, an_eigenvalue, forged, issued

pytestmark = pytest.mark.usefixtures("undrawn")

__all__ = ["issued"]


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """Of a case file of one's own, with a value beside it."""
    folder = tmp_path_factory.mktemp("run")
    (folder / "own.toml").write_text(gfor.load("infinite_bus").file.text, encoding="utf-8")
    scenario = gfor.load(folder / "own.toml").scenario("dip", {"gfor.P_0": 0.5})
    scenario.run(stop=1.2).save(folder / "results")
    return folder


def recorded(found, signals, values=None, scenario="dip"):
    desk = Desk(found[0], False, found[2]["recorded"])
    values = found[2].get("values", {}) if values is None else values
    return desk.answer(
        {"ask": "recorded", "scenario": scenario, "values": values, "signals": signals}, print
    )


@pytest.mark.parametrize("place", ["results", "results/dip", "results/dip/trajectory.nc"])
def test_a_run_opens_with_its_case_values_and_signals(run, place):
    found = opened(str(run / place))
    assert (found[0], found[2]["values"]) == (str(run / "own.toml"), {"gfor.P_0": 0.5})
    answer = recorded(found, ["gfor.p"])
    times, values = answer["curves"]["gfor.p"]
    kept = gfor.open(run / "results")["dip/trajectory.nc"]["gfor.p"]
    assert (min(values), max(values), times[-1]) == (
        float(kept.min()),
        float(kept.max()),
        float(kept["time"][-1]),
    )
    assert answer["differs"] == answer["undrawn"] == []
    misspelt = recorded(found, ["gfor.p", "gfor.pp", "gfor.x*"])
    assert (list(misspelt["curves"]), misspelt["undrawn"]) == (["gfor.p"], ["gfor.pp", "gfor.x*"])
    assert recorded(found, ["gfor.p"], {"gfor.P_0": 0.4})["differs"] == ["gfor.P_0 was 0.5, is 0.4"]
    other = Desk("infinite_bus", False, found[2]["recorded"])
    question = {
        "ask": "recorded",
        "scenario": "dip",
        "values": {"gfor.P_0": 0.5},
        "signals": [],
        "step": 5e-5,
    }
    differs = other.answer(question | {"events": []}, print)["differs"]
    assert [text.split(":")[0] for text in differs] == ["events", "step [s]"]
    assert differs[0].endswith(", is none")
    assert differs[1].endswith(", is 5e-05")
    with pytest.raises(InputError, match="nothing was recorded of scenario 'load_step'"):
        recorded(found, [], scenario="load_step")


def test_a_run_of_another_case_is_refused(run, tmp_path, capsys):
    changed = tmp_path / "own.toml"
    changed.write_text(
        (run / "own.toml").read_text(encoding="utf-8").replace("P_0 = 0.6", "P_0 = 0.7"), "utf-8"
    )
    summary = json.loads((run / "results" / "summary.json").read_text(encoding="utf-8"))
    place = tmp_path / "results"
    place.mkdir()
    (place / "dip").symlink_to(run / "results" / "dip")
    (place / "case.toml").symlink_to(run / "results" / "case.toml")
    for content, text in (
        (summary, "not as it was when"),
        ({"case": "own"}, "does not tell which case was run"),
    ):
        (place / "summary.json").write_text(json.dumps(content), encoding="utf-8")
        assert main(["explore", str(place), "--no-browser"]) == 2
        assert text in capsys.readouterr().err


def test_a_recording_goes_beside_a_case(tmp_path, capsys):
    file = tmp_path / "plant.csv"
    rows = [f"{k / 100},{math.sin(k / 10)},{k}" for k in range(200)]
    file.write_text("\n".join(["time,P1,Q1", *rows]), encoding="utf-8")
    assert main(["explore", str(file)]) == 2
    assert f"gfor explore CASE --beside {file}" in capsys.readouterr().err
    assert (
        main(["explore", "infinite_bus", "--beside", str(tmp_path / "no.csv"), "--no-browser"]) == 2
    )
    capsys.readouterr()
    desk = Desk("infinite_bus", False, {"": str(file)})
    answer = desk.answer({"ask": "recorded", "scenario": "dip", "signals": ["P1"]}, print)
    assert answer["names"] == ["P1", "Q1"]
    assert max(answer["curves"]["P1"][1]) == float(read_table(file)["P1"].max())
    assert set(desk.answer({"ask": "recorded", "scenario": "dip"}, print)["curves"]) == {"P1", "Q1"}


@pytest.mark.parametrize("name", ["fingrid", "nts631_pod_p"])
def test_rows_of_a_certificate_open_with_their_limits(issued, name):
    folder = issued(name)
    found = opened(str(folder))
    study = found[2]["study"]
    content = json.loads((folder / "certificate.json").read_text(encoding="utf-8"))
    assert study["title"] == content["sentence"]
    if name == "fingrid":
        said = {row["row"]: row["accepted"] for row in content["rows"]}
        assert {
            row["name"]: cells[0]["stable"]
            for row, cells in zip(study["rows"], study["cells"], strict=True)
        } == said
        assert any(
            curve["dashed"]
            for row in study["cells"]
            for one in row[0]["pictures"]
            for curve in one["curves"]
        )
    first = study["cells"][0][0]["pictures"][0]["curves"][0]["data"]
    assert np.all(np.diff(first[0]) > 0)
    matrix = {
        "cells": [
            {"code": "x", "device": device, "certificate": f"{name}/certificate.json"}
            for device in ("a", "<b>")
        ]
    }
    (folder.parent / "matrix.json").write_text(json.dumps(matrix), encoding="utf-8")
    both = opened(str(folder.parent))[2]["study"]
    assert [column["name"] for column in both["columns"]] == ["a", "<b>"]
    assert (
        [row[0] for row in both["cells"]]
        == [row[1] for row in both["cells"]]
        == [row[0] for row in study["cells"]]
    )


@pytest.mark.parametrize("change", [a_damping, an_eigenvalue])
def test_a_certificate_that_does_not_hold_is_refused(issued, change):
    folder = issued("nts631_pod_p")
    content = json.loads((folder / "certificate.json").read_text(encoding="utf-8"))
    change(content)
    forged(folder, content)
    with pytest.raises(InputError, match="does not hold"):
        opened(str(folder))


def test_a_run_of_another_step_opens_with_it(tmp_path):
    gfor.load("infinite_bus").scenario("dip", step=5e-5).run(stop=0.01).save(tmp_path)
    assert opened(str(tmp_path))[2]["step"] == 5e-5
