"""A screening on a terminal: what answers, nothing twice, and no column that is empty."""

import pytest
from rich.console import Console

import orchestrator as gfor
from orchestrator.studies.screening.view import modes_table, overview, remarks
from orchestrator.studies.screening.words import verdict_sentence
from tests.support.printed import on_terminal


@pytest.fixture(scope="module")
def summary(tmp_path_factory):
    """WSCC's network, intact and without one line and two units: in each the frequency drifts away."""
    outages = ["line_4_6", "sg1", "sg2"]
    case, folder = gfor.load("wscc9"), tmp_path_factory.mktemp("screen")
    return case.screen(outages=outages, folder=folder, workers=1).summary


def shown(table):
    console = Console(width=200, record=True, file=None)
    with console.capture() as caught:
        console.print(table)
    ((_, rows),) = on_terminal(caught.get()).items()
    return rows


def test_of_one_operating_point_no_column_names_it(summary):
    for table in (overview(summary), modes_table(summary)):
        rows = shown(table)
        assert rows
        assert all("case" not in row.values() for row in rows)
        assert all(any(row[heading] for row in rows) for heading in rows[0])
    assert "case, " not in verdict_sentence(summary)
    assert set(modes_table(summary).frame()["point"]) == {"case"}  # files keep it


def test_growth_that_is_not_the_shown_modes_has_its_own_cell(summary):
    for row in shown(overview(summary)):
        assert float(row["Damping [%]"].split()[0]) > 0
        assert "UNSTABLE" in row["Damping [%]"]
        assert row["What grows besides"].startswith("+")


def test_a_mode_is_seen_at_some_of_all_points_and_outages(summary):
    table = modes_table(summary)
    counts = [int(count) for count in table.frame()["items"]]
    assert [row["Seen at"] for row in shown(table)] == [f"{n} of 4" for n in counts]


def test_a_rating_that_is_exceeded_is_said_once(summary):
    warned = {text for item in summary.result.items for text in item.record.of_rating}
    assert len(warned) == 2  # without sg1 it is sg2, and without sg2 it is sg3
    assert "at 2 of 4 a unit is beyond its rating" in verdict_sentence(summary)
    said = remarks(summary)
    assert not [text for text in said if any(warning in text for warning in warned)]
    assert all(
        warning in item.record.warnings
        for item in summary.result.items
        for warning in item.record.of_rating
    )
