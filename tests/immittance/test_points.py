"""Scans and verdicts over the points of a file."""

import csv
import json
from pathlib import Path

import pytest

import orchestrator as gfor
from orchestrator.cli import main
from orchestrator.errors import InputError
from orchestrator.immittance import study
from orchestrator.operating_points.points_file import settings_in
from tests.immittance.plants import constant_power
from tests.immittance.test_command import PLANT, F, files

STRONGER = constant_power(g=0.6, h=0.6, T=0.003, G=0.2)


def written(path, *lines):
    path.write_text("\n".join(lines) + "\n")
    return path


def test_a_file_sets_variables_by_point_and_an_empty_cell_none(tmp_path):
    path = written(tmp_path / "p.csv", "name,P_0,S_n", "night,0.2,", "08:00,,1500 MVA")
    assert settings_in(path) == {"night": {"P_0": 0.2}, "08:00": {"S_n": "1500 MVA"}}
    for lines, said in (
        (("P_0", "1"), "column name is missing"),
        (("name,P_0", "a/b,1", "a:b,2"), "a name of its own"),
        (("name,P_0", "a,1,2"), "no more cells than columns"),
    ):
        with pytest.raises(InputError, match=said):
            settings_in(written(tmp_path / "bad.csv", *lines))


def test_a_verdict_by_point_in_a_table_and_files(tmp_path, capsys, monkeypatch):
    """The device is a stand-in: stronger at the point where P_0 is 0.2."""
    scans = {}
    for P_0, plant in ((0.2, STRONGER), (0.9, PLANT)):
        (place := tmp_path / f"{P_0}").mkdir()
        scans[P_0] = files(place, device=0.01 * plant.admittance(F))[0]
    alone = gfor.nyquist(scans[0.2], scr=0.8, rating="100 MVA", voltage="100 kV").as_json()
    side = study._side
    swap = lambda request, path, *more: side(request, Path(scans[request.values["P_0"]]), *more)  # noqa: E731
    monkeypatch.setattr(study, "_side", swap)
    points = written(tmp_path / "p.csv", "name,P_0", "night,0.2", "08:00,0.9")
    command = ["fmu", "nyquist", "plant.fmu", "--scr", "0.8", "--rating", "100 MVA", "--voltage", "100 kV", "--points",
               str(points), "--out", str(tmp_path / "out")]  # fmt: skip
    monkeypatch.setattr(study, "_rating", lambda request, cut: 100.0)
    assert main([*command, "--json", "--fail-unstable"]) == 3
    night, morning = json.loads(capsys.readouterr().out)
    assert (night["verdict"], morning["verdict"]) == ("stable", "unstable")
    assert night["distance"] == alone["margins"]["distance"]["value"]
    assert night["scr_limit"] == alone["strength"]["scr_limit"]
    kept = json.loads((tmp_path / "out" / "08_00" / "nyquist.json").read_text())
    assert morning["phase_deg"] == (kept["margins"]["phase_deg"] or {}).get("value")
    with (tmp_path / "out" / "points.csv").open() as file:
        assert [row["verdict"] for row in csv.DictReader(file)] == ["stable", "unstable"]


def test_a_point_that_cannot_be_judged_says_why_and_the_others_go_on(tmp_path, capsys):
    points = written(tmp_path / "p.csv", "name,P_0", "a,0.5", "b,")
    command = ["fmu", "nyquist", files(tmp_path)[0], "--scr", "1.5", "--rating", "100 MVA", "--voltage", "100 kV"]
    assert main([*command, "--points", str(points), "--out", str(tmp_path / "out"), "--json"]) == 0
    one, other = json.loads(capsys.readouterr().out)
    assert (one["verdict"], other["verdict"]) == ("not known", "stable")
    assert "plant.txt: a scan has no P_0 to be set" in one["remark"]
