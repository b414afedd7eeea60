"""From which item and which place the tables, the page and the records of a screening take each figure."""

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest

from orchestrator.output.report.html.elements import Figures
from orchestrator.studies.operating_points.item import Status
from orchestrator.studies.screening import command, point, view
from orchestrator.studies.screening.point import _Worker
from orchestrator.studies.screening.summary import ModeAt


def item(**record):
    return SimpleNamespace(
        record=SimpleNamespace(**record),
        point=SimpleNamespace(name="p07"),
        outage=SimpleNamespace(name="sg2", elements=("sg2",)),
    )


@pytest.mark.parametrize(
    ("cause", "told"),
    [
        ("no way leads to b1 from: 'b3'; close l23", "no way leads to b1 from: 'b3'"),
        ("no solution found. The iterations end with 79.4 MW at 'b3'", "no solution found"),
        ("79.4 MW unbalanced at b3: 747, 95.3, 79.4", "79.4 MW unbalanced at b3"),
    ],
)
def test_an_outage_without_any_verdict_is_told_by_its_first_point(cause, told):
    plan = SimpleNamespace(
        wanted=SimpleNamespace(damping=0.2),
        points=("p07",) * 7,
        outages=(),
        prepared=SimpleNamespace(regions=SimpleNamespace(has_areas=False)),
    )
    cause = f"power flow: {cause}"
    why = f"line 9, power_flow: scenario 'base': {cause}"
    lost = item(status=Status.POWER_FLOW, text=why, cause=cause)
    table = view.overview(SimpleNamespace(result=SimpleNamespace(plan=plan, items=(lost,))))
    assert [column.cell(table.rows[0]) for column in table.columns] == [
        "sg2",
        "p07",
        "",
        "–",
        "1 of 1",
        f"no power flow: {told}",
    ]


@pytest.mark.parametrize(
    ("complete", "cells", "said"), [(True, 9, True), (True, 2, False), (False, 9, False)]
)
def test_a_cell_without_a_figure_has_its_reason_in_the_title(complete, cells, said):
    """Line 16–17 is out for maintenance, so its outage is none there; of a part alone others may compute it."""
    result = SimpleNamespace(complete=complete, items=("one", "two"))
    text = view._out_already(SimpleNamespace(result=result), cells)
    assert ("has out of service already what the outage takes" in text) is said


@pytest.mark.parametrize(
    ("residues", "first"),
    [
        ({"a": (5.0, 0.1), "b": (1.0, 2.0)}, "a"),
        ({"a": (0.1, 5.0), "b": (2.0, 1.0)}, "a"),
        ({"a": (1j, 0), "b": (0, 2)}, "b"),
    ],
)
def test_converters_are_ranked_by_the_larger_of_both_residues(residues, first):
    at = ModeAt(item(residues={name: np.array([[p], [q]]) for name, (p, q) in residues.items()}), 0)
    assert at.ranking()[0] == (first, *map(complex, residues[first]))


def test_components_are_named_by_their_shares():
    at = ModeAt(item(shares={"a": np.array([0.2]), "b": np.array([0.7]), "c": np.array([0.1])}), 0)
    assert at.participation(2) == [("b", 0.7), ("a", 0.2)]


def test_a_stretch_is_joined_by_the_modes_of_its_anchor_and_of_its_last_intact_item(monkeypatch):
    monkeypatch.setattr(point, "_as_kept", lambda found: found.modes)
    results = [
        SimpleNamespace(found=SimpleNamespace(modes=name), record=name)
        for name in ("anchor", "one", "out")
    ]
    items = [SimpleNamespace(intact=intact) for intact in (True, True, False)]
    own = SimpleNamespace(
        _task=SimpleNamespace(anchor=items[0], items=items[1:]),
        _bench=SimpleNamespace(perturbed=3, reused=5),
        _runs=None,
    )
    made = _Worker._record(own, results)
    assert (made.first, made.last, made.last_place) == ("anchor", "one", 1)
    assert (made.items, made.perturbed, made.reused) == (("anchor", "one", "out"), 3, 5)


@pytest.mark.parametrize(
    ("outages", "points", "shown"), [(1, 1, False), (1, 2, True), (2, 1, True)]
)
def test_of_one_item_the_headline_and_the_modes_say_all(outages, points, shown, monkeypatch):
    """The system without an outage counts as one of the outages."""
    for name in ("verdict", "overview", "limits_table", "runs_table", "no_modes", "modes_table"):
        absent = name in ("limits_table", "runs_table", "no_modes")
        monkeypatch.setattr(command, name, lambda summary, told=None if absent else name: told)
    plan = SimpleNamespace(outages=["intact"] * outages, points=["p"] * points)
    found = SimpleNamespace(result=SimpleNamespace(plan=plan), summary=None)
    assert [part for part in command._parts(found) if part] == (
        ["verdict", *["overview"] * shown, "modes_table"]
    )


@pytest.mark.parametrize("everywhere", [True, False])
def test_growth_is_counted_at_the_ends_of_a_stretch_and_between_them_if_asked(
    everywhere, monkeypatch
):
    """The first end is the first item that has modes."""
    counted = {}

    def computed(item, neighbour, *, count):
        counted[item] = count
        return SimpleNamespace(found=None if item == "dark" else object(), record=item)

    monkeypatch.setattr(point, "_reference", lambda items, results, k: None)
    own = object.__new__(_Worker)
    own._task = SimpleNamespace(anchor="dark", items=["first", "one", "two", "last"])
    monkeypatch.setattr(own, "_item", computed)
    monkeypatch.setattr(own, "_count_the_last", lambda items, results: None)
    assert [result.record for result in own._pass(everywhere=everywhere)] == [
        own._task.anchor,
        *own._task.items,
    ]
    assert [item for item, count in counted.items() if not count] == (
        [] if everywhere else ["one", "two"]
    )


def test_an_anchor_that_is_the_first_item_as_well_is_computed_once(monkeypatch):
    @dataclass
    class Record:
        eigenvalues: tuple
        reference: int | None = None
        links: tuple = ()

    asked, modes = [], object()

    def computed(item, neighbour, *, count):
        asked.append(item)
        return SimpleNamespace(found=modes, record=Record((-1 + 5j, -2 + 9j)))

    monkeypatch.setattr(point, "_reference", lambda items, results, k: None)
    own = object.__new__(_Worker)
    own._task = SimpleNamespace(anchor="one", items=["one", "two"])
    monkeypatch.setattr(own, "_item", computed)
    monkeypatch.setattr(own, "_count_the_last", lambda items, results: None)
    _, again, _ = own._pass(everywhere=False)
    assert asked == ["one", "two"]
    assert (again.record, again.found) == (Record((-1 + 5j, -2 + 9j), 0, (0, 1)), modes)


def test_the_page_shows_the_figure_not_its_name():
    mode = ModeAt(item(eigenvalues=[-0.2 + 5j]), 0)
    drawn = view._plane(SimpleNamespace(modes=[SimpleNamespace(at=[mode])]), Figures())
    assert drawn.startswith('<figure id="figure-1">')


def test_residues_are_those_of_components_that_show_their_frequency(monkeypatch):
    """Each at its own states, whatever stands before them."""
    monkeypatch.setattr(point, "residue", lambda modes, column, row: np.array([column @ row]))

    def component(states, observed):
        inputs = ["v_re", "v_im", *point.DRIVEN]
        driven = np.outer(
            np.ones(states), [0.0] * 2 + [float(k + 1) for k in range(len(point.DRIVEN))]
        )
        return SimpleNamespace(
            states=["x"] * states,
            observed=observed,
            inputs=inputs,
            B_c=driven,
            C_o=np.full((1, states), 3.0),
        )

    whole = {"sg1": component(1, ("sg1.v",)), "gfor": component(2, point.OBSERVED)}
    found = point._residues(SimpleNamespace(eigenvalues=[1j], names=["x"] * 3), whole)
    assert list(found) == ["gfor"]
    assert found["gfor"].real.ravel().tolist() == [6.0 * (k + 1) for k in range(len(point.DRIVEN))]
