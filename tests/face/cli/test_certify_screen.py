"""The first screen of a code's certificate: a line for each row, nothing twice, no percent of next to nothing."""

from io import StringIO
from pathlib import Path
from types import SimpleNamespace

import pytest
from rich.console import Console

from orchestrator.face.cli.certificate import show
from orchestrator.studies.certification.certificate import Certificate
from orchestrator.studies.certification.codes.row import RowFinding
from orchestrator.studies.certification.codes.row_verdict import RowVerdict
from orchestrator.studies.certification.kinds import WITH_VERDICT
from orchestrator.studies.certification.margins import margin_text


def row(name):
    return SimpleNamespace(name=name, shown_only=False)


def criterion(name, value, limit, margin, *, accepted):
    text = f"{value} pu away"
    return RowFinding(name, "rule", "code", value, limit, margin, accepted, text, "pu")


VERDICTS = [
    RowVerdict(
        row("jump"),
        (
            criterion("current", 1.2, 1.3, 0.07, accepted=True),
            criterion("settles", 1.128, 0.01, -111.8, accepted=False),
        ),
    ),
    RowVerdict(row("dip"), (criterion("voltage", 0.9, 0.5, 0.8, accepted=True),)),
    RowVerdict(row("weak"), unknown="the worker died"),
    RowVerdict(
        row("ringing"),
        (criterion("settles", 1.0, 0.01, None, accepted=None),) * 2,
        of_the_bench="the bench rings",
    ),
]


def shown(f_n):
    slip = {"kind": "misfit", "message": "converter: wrong rated frequency: omega is 0.8333"}
    code = SimpleNamespace(title="ERCOT", f_n=50.0, rows=[v.row for v in VERDICTS], left_out=())
    found = Certificate(
        SimpleNamespace(values={}, departures=()),
        SimpleNamespace(model_name="vendor"),
        code,
        f_n,
        VERDICTS,
        {name: SimpleNamespace(findings=[slip]) for name in ("jump", "dip")},
        Path("row.toml"),
    )
    console = Console(width=150, record=True, file=StringIO())
    show(found, [Path("certificate.html")], Path("out"), console)
    return console.export_text()


@pytest.fixture
def screen():
    return shown(50.0)


def test_a_rated_frequency_of_others_stands_in_the_first_line():
    first = shown(60.0).splitlines()[0]
    assert first.endswith("Not as the code has it: the rated frequency, 60 Hz in place of 50 Hz.")


def test_the_first_line_names_the_rows_that_were_not_judged(screen):
    assert "1 of 2 judged rows are accepted." in screen.splitlines()[0]
    assert screen.splitlines()[0].endswith(" Not judged: weak, ringing.")


def test_the_verdict_stands_first_and_each_row_has_a_line(screen):
    first = screen.split("└")[0].splitlines()
    cells = [
        [cell.strip() for cell in line.strip("│").split("│")]
        for line in first
        if line.startswith("│")
    ]
    assert [c[:2] for c in cells] == [
        ["all", "fails"],
        ["jump", "fails"],
        ["dip", "accepted"],
        ["weak", "not judged"],
        ["ringing", "not judged"],
    ]
    assert cells[0][4] == "2 judged, 1 failed, 2 not judged"
    assert cells[1][2:] == ["1 of 2", "−1.12 pu", "settles: 1.128 pu away"]
    assert cells[2][2:] == ["1 of 1", "+80 %", "nearest: voltage"]
    assert cells[3][2:] == ["–", "–", "the worker died"]
    assert cells[4][2:] == ["none of 2 judged", "–", "the bench rings"]


def test_the_help_says_where_each_code_applies(gfor):
    """So that a planner in America finds his."""
    _, text, _ = gfor("certify", "--help")
    assert all(f" {key} " in " ".join(text.split()) for key in WITH_VERDICT)


def test_a_fault_of_the_device_is_told_once(screen):
    assert screen.count("wrong rated frequency") == 1
    assert screen.count("Not tested: row weak") == 1


@pytest.mark.parametrize(
    ("margin", "known", "text"),
    [
        (None, (), "–"),
        (0.125, (), "+12.5 %"),
        (-0.5, (1.0, 1.5), "−50 %"),
        (-112.72, (0.01, 1.137), "−1.13 in its unit"),
        (-112.72, (0.01, 1.137, "Hz"), "−1.13 Hz"),
        (187.87, (), "+> 10 times"),
    ],
)
def test_margins_are_no_percent_of_next_to_nothing(margin, known, text):
    assert margin_text(margin, *known) == text
