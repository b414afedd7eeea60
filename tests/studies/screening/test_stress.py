"""The first line says what was not judged, and what it has in common; the worst outage is first; a mode is one row."""

from dataclasses import replace

import numpy as np
import pytest
from rich.console import Console

from orchestrator.studies.operating_points.item import Status
from orchestrator.studies.screening.record import ItemRecord
from orchestrator.studies.screening.request import ScreeningRequest
from orchestrator.studies.screening.study import ScreenedItem, ScreeningResult, plan_screening
from orchestrator.studies.screening.summary import Summary
from orchestrator.studies.screening.view import overview
from orchestrator.studies.screening.words import by_outage, not_judged, verdict_sentence
from tests.studies.screening.five_machines import five_machines

POINTS = "name,load\nnight,0.7\nmorning,0.9\nnoon,1.1\nevening,1.2\n"


@pytest.fixture(scope="module")
def plan(tmp_path_factory):
    folder = tmp_path_factory.mktemp("five")
    (folder / "points.csv").write_text(POINTS)
    return plan_screening(
        five_machines(folder), ScreeningRequest(folder / "points.csv", "sg1,sg2,line_11_12", "base")
    )


def mode(real, who=(0.8, 0.2), number=0, hertz=1.0):
    """A computed record with one critical mode of two machines, and its trajectory."""
    shares = {
        name: np.array([share], dtype=np.float32)
        for name, share in zip(("sg3", "sg4"), who, strict=True)
    }
    value = np.array([complex(real, 2 * np.pi * hertz)])
    record = ItemRecord(
        Status.COMPUTED,
        stable=real < 0,
        counted=True,
        eigenvalues=value,
        critical=(0,),
        shares=shares,
    )
    return record, (number,)


LOST = ItemRecord(Status.STEADY_STATE, "sg3 would need 122 %"), ()


def summary(plan, records, otherwise=None):
    """The summary with other records at some (point, outage)."""
    usual = otherwise or mode(-0.5)
    items = [
        ScreenedItem(point, outage, *records.get((point.name, outage.name), usual))
        for point in plan.points
        for outage in plan.outages
    ]
    return Summary(ScreeningResult(plan, items))


@pytest.mark.parametrize(
    ("where", "said"),
    [
        (
            [("noon", "sg1"), ("evening", "sg2")],
            "2 not judged (2 no steady state)",  # other units are out there too, and judged
        ),
        (
            [("noon", "sg1"), ("evening", "sg1")],
            "2 not judged (2 no steady state), all with sg1 out at high load (from ",
        ),
        (
            [("night", "line_11_12")],
            "1 not judged (1 no steady state)",  # one item has nothing in common
        ),
        ([("night", "sg1"), ("evening", "line_11_12")], "2 not judged (2 no steady state)"),
        (
            [("night", "intact"), ("evening", "intact")],
            "2 not judged (2 no steady state)",  # it is judged at other points
        ),
        ([], ""),
    ],
)
def test_what_was_not_judged_says_what_it_has_in_common(plan, where, said):
    found = summary(plan, dict.fromkeys(where, LOST))
    text = not_judged(found)
    assert text == said if said.endswith(")") else text.startswith(said)
    assert text == said or "(" in said[-20:] or "load" not in text
    assert text in verdict_sentence(found)


def test_of_two_points_the_one_that_was_not_judged_is_named(plan):
    found = summary(
        replace(plan, points=plan.points[:2]), {("morning", "sg1"): LOST, ("morning", "sg2"): LOST}
    )
    assert not_judged(found) == "2 not judged (2 no steady state), all with a unit out at morning"


def test_what_was_not_judged_is_told_of_an_unstable_network_too(plan):
    found = summary(plan, {("night", "sg1"): LOST, ("noon", "sg2"): mode(0.1)})
    assert verdict_sentence(found).startswith(
        "UNSTABLE: at 1 of 16 points and outages; worst: noon, sg2: "
    )
    assert "1 not judged" in verdict_sentence(found)


def test_the_outages_come_worst_first(plan):
    """What grows, then what is not known, then by damping."""
    found = summary(
        plan,
        {
            ("noon", "sg2"): mode(0.1),
            ("evening", "sg1"): LOST,
            ("evening", "line_11_12"): mode(-0.2),
        },
    )
    rows = by_outage(found)
    assert [row.name for row in rows] == ["sg2", "sg1", "line_11_12", "intact"]
    assert [len(row.unjudged) for row in rows] == [0, 1, 0, 0]
    assert rows[2].worst.point.name == "evening"
    console = Console(width=200, record=True)
    console.print(overview(found))
    lines = [line for line in console.export_text().splitlines() if "│" in line]
    assert [line.split("│")[1].strip() for line in lines] == ["sg2", "sg1", "line_11_12", "intact"]
    assert " UNSTABLE" in lines[0]
    assert "Marked" not in lines[0]
    assert "[bold" not in lines[0]
    assert "no steady state" in lines[1]


def test_a_mode_whose_names_change_has_one_row(plan):
    """It was not followed over an outage; who leads is another one by little."""
    again = mode(-0.4, (0.45, 0.55), number=1)
    found = summary(
        plan, {("noon", "sg1"): again, ("evening", "sg1"): again}, mode(-0.5, (0.55, 0.45))
    )
    (row,) = found.modes
    assert len(row.at) == 16


@pytest.mark.parametrize(
    "other", [mode(-0.4, (0.02, 0.98), number=1), mode(-0.4, number=1, hertz=1.5)]
)
def test_modes_of_others_or_of_another_frequency_stay_apart(plan, other):
    assert len(summary(plan, {("noon", "sg1"): other}).modes) == 2


def test_two_modes_of_one_item_stay_two(plan):
    record, _ = mode(-0.5)
    both = replace(
        record,
        eigenvalues=np.repeat(record.eigenvalues, 2),
        critical=(0, 1),
        shares={name: np.repeat(values, 2) for name, values in record.shares.items()},
    )
    assert len(summary(plan, {}, (both, (0, 1))).modes) == 2
