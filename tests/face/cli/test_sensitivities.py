"""``gfor sensitivities``: its table, files and JSON, and what it refuses."""

import csv
import json

import pytest

import orchestrator as face


def test_the_command_prints_and_writes_what_the_interface_gives(gfor, tmp_path):
    options = (
        "two_area",
        "--scenario",
        "pod_p",
        "--parameter",
        "gfor.pod_p.K",
        "--parameter",
        "gfor.pod_p.T_S*",
    )
    code, out, _ = gfor("sensitivities", *options, "--json", "--out", tmp_path)
    assert code == 0
    (printed,) = json.loads(out)
    assert printed["stable"] is True
    assert printed["derivative"] == "total"
    assert printed["mode"]["name"] == "electromechanical"
    names = ["gfor.pod_p.K", "gfor.pod_p.T_S*"]
    own = face.load("two_area").scenario("pod_p").sensitivities(parameters=names)
    assert printed == own.as_json()
    with (tmp_path / "pod_p" / "sensitivities.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [row["parameter"] for row in rows] == own.table().index.tolist()
    assert float(rows[0]["damping_points_per_percent"]) == own.result.rows[0].damping_per_percent
    assert "Sensitivities of" in repr(own)
    assert "gfor.pod_p.T_S1" in own._repr_html_()
    code, out, _ = gfor("sensitivities", *options, "--held")
    assert code == 0
    assert "the operating point held" in out


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (
            ["--mode", "intermachine"],
            "has no mode of this name; it has: electromechanical, critical",
        ),
        (["--parameter", "gfor.pod_p.KK"], "did you mean gfor.pod_p.K"),
        (["--parameter", "gfor.pod_p.N_S"], "gfor.pod_p.N_S is of type Integer"),
        (["--parameter", "*.enabled"], "is of type Boolean"),
        (["--held", "--fixed"], "give one of them"),
        (["--range", "1.9:2"], "has no oscillation in the range"),
    ],
)
def test_mistakes_are_one_error(gfor, options, words):
    code, out, err = gfor("sensitivities", "two_area", "--scenario", "pod_p", *options)
    assert code == 2
    assert out == ""
    assert words in " ".join(err.split())
