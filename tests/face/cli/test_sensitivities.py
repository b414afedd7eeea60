"""``gfor sensitivities``: its table, files and JSON, and what it refuses."""

import csv
import json
import re

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
    assert "The operating point is held" in " ".join(out.split())


def test_the_first_lines_tell_what_moves_the_mode_most_and_how_rows_are_ordered(gfor):
    """The load that moves damping three times as much stands first, a resistance of 0 pu behind all others."""
    names = ("load_7.scale", "load_9.scale", "R_transformer_1")
    wanted = [part for name in names for part in ("--parameter", f"grid.{name}")]
    _, out, _ = gfor("sensitivities", "kundur", "--scenario", "pod_q", *wanted)
    told, table = out[out.index("inter-area") :].split("┏")[0], out.split("┡")[1]
    first = r"damping moves most with grid\.load_9\.scale \(-0\.1\d+\), grid\.load_7"
    assert re.search(first, " ".join(told.split()))
    assert "ordered by points per %, the largest first" in " ".join(told.split())
    assert re.findall(r"grid\.\w+", table) == [
        "grid.load_9",
        "grid.load_7",
        "grid.R_transformer_1",
    ]


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
