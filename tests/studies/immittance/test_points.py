"""Scans and verdicts over the points of a file."""

import csv
import json

import numpy as np
import pytest

import orchestrator as gfor
from orchestrator.core.errors import InputError
from orchestrator.face.cli import main
from orchestrator.studies.operating_points.points_file import settings_in
from tests.studies.immittance.plants import constant_power
from tests.studies.immittance.test_command import F, files

pytestmark = pytest.mark.usefixtures("undrawn")

STRONGER = constant_power(g=0.6, h=0.6, T=0.003, G=0.2)


def written(path, *lines):
    path.write_text("\n".join(lines) + "\n")
    return path


def test_a_file_sets_variables_by_point_and_an_empty_cell_none(tmp_path):
    path = written(tmp_path / "p.csv", "name,P_0,S_n,hours", "night,0.2,,3", "08:00,,1500 MVA,")
    assert settings_in(path) == {"night": {"P_0": 0.2}, "08:00": {"S_n": "1500 MVA"}}
    for lines, said in (
        (("P_0", "1"), "column 'time' or 'name' is missing"),
        (("name,P_0", "a/b,1", "a:b,2"), "stands in an earlier row, or shares its folder"),
        (("name,P_0", "a,1,2"), "more cells than the first line"),
        (("name,device", "a,x.txt", "b,"), "line 3: device is empty"),
    ):
        with pytest.raises(InputError, match=said):
            settings_in(written(tmp_path / "bad.csv", *lines))


def test_a_verdict_by_point_of_scans_and_what_cannot_be_judged(tmp_path, capsys):
    one, _ = files(tmp_path)
    (tmp_path / "other").mkdir()
    other, _ = files(tmp_path / "other", device=0.01 * STRONGER.admittance(F))
    points = written(
        tmp_path / "p.csv", "name,device", f"now,{one}", f"less,{other}", "gone,none.txt"
    )
    common = [
        "fmu",
        "nyquist",
        one,
        "--scr",
        "0.8",
        "--rating",
        "100 MVA",
        "--voltage",
        "100 kV",
        "--points",
        str(points),
        "--out",
        str(tmp_path / "out"),
    ]
    assert main([*common, "--json", "--fail-unstable"]) == 3
    found = {x["point"]: x for x in json.loads(capsys.readouterr().out)}
    assert {name: x["verdict"] for name, x in found.items()} == {
        "now": "unstable",
        "less": "stable",
        "gone": "not known",
    }
    assert "none.txt: No such file" in found["gone"]["remark"]
    alone = gfor.nyquist(other, scr=0.8, rating="100 MVA", voltage="100 kV").as_json()
    assert found["less"]["distance"] == alone["margins"]["distance"]["value"]
    assert found["less"]["lost_below_scr"] == alone["strength"]["scr_limit"]
    assert (
        json.loads((tmp_path / "out" / "less" / "nyquist.json").read_text())["margins"]
        == alone["margins"]
    )
    written(points, "name,P_0", "now,0.5")
    assert main(common) == 2
    assert "no point could be computed" in capsys.readouterr().err
    with (tmp_path / "out" / "points.csv").open() as file:
        assert "a scan has no P_0 to be set" in next(csv.DictReader(file))["remark"]


def test_an_fmu_is_scanned_at_each_point(tmp_path, capsys, in_process):
    fmu = gfor.build("gfor", tmp_path, native=True)
    points = written(tmp_path / "p.csv", "name,P_0,what", "low,0.2,", "high,0.8,", "odd,0.5,1")
    command = [
        "fmu",
        "admittance",
        str(fmu),
        "--points",
        str(points),
        "--from-hz",
        "20",
        "--to-hz",
        "900",
        "--form",
        "jacobian",
        "--scan",
        str(tmp_path / "s.txt"),
        "--voltage",
        "230 kV",
        "--out",
        str(tmp_path / "out"),
        "--json",
    ]
    assert main(command) == 0
    rows = json.loads(capsys.readouterr().out)
    assert [bool(row["remark"]) for row in rows] == [False, False, True]
    assert "no such variable" in rows[2]["remark"]
    with (tmp_path / "out" / "high" / "jacobian.csv").open() as file:
        assert "re P/omega [MW]" in next(csv.DictReader(file))
    assert (tmp_path / "s_low_power_flow.txt").read_text() != (
        tmp_path / "s_high_power_flow.txt"
    ).read_text()
    assert (
        main(
            [
                "fmu",
                "admittance",
                str(tmp_path / "s_low.txt"),
                "--form",
                "alphabeta",
                "--out",
                str(tmp_path),
            ]
        )
        == 0
    )
    assert np.loadtxt(tmp_path / "alphabeta.csv", delimiter=",", skiprows=1)[0, 0] == pytest.approx(
        70
    )
