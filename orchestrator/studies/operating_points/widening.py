"""Items that ask more of an exciter or a governor than its limit gives: computed with the limit widened, and told.

PSS/E warns of suspect initial conditions, goes on and drifts to the limit. What is computed here is what `gfor new`
writes for such an operating point, GridPACK's and PowerWorld's way: the limit lies a little beyond the start."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from orchestrator.cases.form.control_limits import is_wider
from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.core.errors import StartError
from orchestrator.studies.operating_points.bench import PointBench
from orchestrator.studies.operating_points.item import Item
from orchestrator.studies.operating_points.preparation import ItemPreparation, PreparedItem
from orchestrator.systems.coupling.master import Master


@dataclass(frozen=True)
class Widening:
    """A limit, ``component.variable``, with its value in the case and the one that an item was computed with [pu]."""

    name: str
    given: float
    taken: float

    def __str__(self) -> str:
        return f"{self.name} widened from {self.given:g} to {self.taken:g}"


@dataclass(frozen=True)
class StartedItem:
    """An item whose components run, and the limits that were widened for that; none where it starts as it is."""

    prepared: PreparedItem
    master: Master
    widenings: tuple[Widening, ...] = ()


def started(
    bench: PointBench, preparation: ItemPreparation, item: Item, prepared: PreparedItem
) -> StartedItem:
    """Start an item, with wider limits of exciters and governors where these alone keep it from starting.

    Raises
    ------
    StartError
        If a component cannot start for another reason.
    """
    try:
        return StartedItem(prepared, bench.master(prepared.scenario))
    except StartError as error:
        wider = error.wider
        if not wider:
            raise
    again = preparation.prepared(item, wider)
    return StartedItem(again, bench.master(again.scenario), widenings_of(prepared.scenario, wider))


def widenings_of(prepared: PreparedScenario, wider: Mapping[str, float]) -> tuple[Widening, ...]:
    """Return what wider limits change of a scenario that does not start without them."""
    plans, found = prepared.system.components, []
    for name, taken in wider.items():
        component, _, variable = name.partition(".")
        found.append(Widening(name, plans[component].number(variable), taken))
    return tuple(found)


def widest(found: Iterable[Widening]) -> dict[str, Widening]:
    """Return each limit with the widest value that an item was computed with, by its name."""
    each: dict[str, Widening] = {}
    for one in found:
        known = each.get(one.name)
        if known is None or is_wider(one.name, one.taken, known.taken):
            each[one.name] = one
    return each
