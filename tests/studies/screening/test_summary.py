"""What a screening may be called, and how far around its range modes are followed."""

from types import SimpleNamespace

import numpy as np
import pytest

from orchestrator.cases.flow.limits import Excess
from orchestrator.studies.operating_points.item import Status
from orchestrator.studies.operating_points.preparation import ItemPreparation
from orchestrator.studies.screening.modes import CriticalRegion
from orchestrator.studies.screening.study import ScreeningResult
from orchestrator.studies.screening.summary import Summary


def summary(*verdicts, complete=True):
    """Of items that are stable, unstable or without a verdict (None)."""
    records = [
        SimpleNamespace(
            status=Status.COMPUTED,
            stable=v,
            zeros=0,
            critical=(),
            counted=True,
            run=None,
            widenings=(),
        )
        for v in verdicts
    ]
    items = [SimpleNamespace(record=record, trajectories=()) for record in records]
    return Summary(SimpleNamespace(items=items, complete=complete))


@pytest.mark.parametrize(
    ("verdicts", "complete", "stable"),
    [
        ((True, True), True, True),
        ((True, True), False, None),
        ((True, None), True, None),
        ((True, None), False, None),
        ((True, False), True, False),
        ((True, False), False, False),
        ((None, False), True, False),
    ],
)
def test_only_a_complete_screening_without_gaps_is_stable(verdicts, complete, stable):
    assert summary(*verdicts, complete=complete).stable is stable


@pytest.mark.parametrize(("there", "complete"), [(0, False), (2, False), (3, True)])
def test_a_screening_is_complete_with_all_its_items(there, complete):
    result = ScreeningResult(SimpleNamespace(number_of_items=3))
    result.items = [object()] * there
    assert result.complete is complete


def test_of_a_part_the_same_holds_for_what_is_there():
    assert summary(True, complete=False).stable_here is True
    assert summary(True, None, complete=False).stable_here is None


def test_units_beyond_their_reactive_power_stand_in_the_first_line():
    """What the operating point brings about: not what the base has already, nor where the case means the voltages."""
    found = summary(True, True)
    for item, text in zip(
        found.result.items, ("", "'b' feeds -70 Mvar, its least being -10 Mvar"), strict=True
    ):
        item.record.beyond, item.record.reactive = {}, text
    said = "at 1 of 2 limits of reactive power are exceeded: 'b' feeds -70 Mvar, its least being -10 Mvar"
    assert found.beyond == said

    def at(**fed):
        excess = tuple(Excess(bus, q, -0.1, 1.0, 1.0) for bus, q in fed.items())
        return SimpleNamespace(power_flow=SimpleNamespace(beyond_limits=excess))

    preparation = object.__new__(ItemPreparation)
    preparation.base = at(a=-0.2)
    for limits, text in ((None, "'b' feeds -70 Mvar, its least being -10 Mvar"), (False, "")):
        table = SimpleNamespace(power_flow=SimpleNamespace(reactive_limits=limits))
        preparation._case = SimpleNamespace(table=table)
        assert preparation.reactive(at(a=-0.3, b=-0.7, c=-0.2)) == text
        assert preparation.reactive(at(a=-0.3)) == ""


def test_units_beyond_their_limits_are_counted_where_the_item_was_judged():
    """Of a point without modes nothing is known: it is in neither number."""
    found = summary(True, True, None)
    for item, load in zip(found.result.items, (1.04, 0.0, 1.3), strict=True):
        item.point, item.outage = SimpleNamespace(name="noon"), SimpleNamespace(name="line")
        item.record.beyond, item.record.reactive = {"a": load} if load else {}, ""
    found.result.items[2].record.status = Status.STEADY_STATE
    found.result.plan = SimpleNamespace(points=("noon", "night"))
    assert (
        found.beyond
        == "at 1 of 2 judged a unit is beyond its rating, most a with 104 % (noon, line)"
    )


def test_modes_are_followed_beyond_the_range_at_both_ends_and_above_the_damping():
    wanted = CriticalRegion(0.1, 2.0, 0.2)
    assert wanted.wider.lowest_hz < wanted.lowest_hz
    assert wanted.wider.highest_hz > wanted.highest_hz
    assert wanted.wider.damping / wanted.damping == wanted.wider.highest_hz / wanted.highest_hz > 1
    for hertz, damping in ((0.095, 0.1), (2.1, 0.1), (1.0, 0.21)):
        value = 2 * np.pi * hertz * complex(-damping / np.sqrt(1 - damping**2), 1)
        assert not wanted.holds(value)
        assert wanted.wider.holds(value)
