"""Outages as they happen: what relays do, and who loses synchronism, in a run from the operating point before one."""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace

from orchestrator.cases.case import Case
from orchestrator.cases.flow.sharing import SharingRule
from orchestrator.cases.form.parameter_files import ParameterFile
from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.core.errors import CosimError, NotTakenUpError
from orchestrator.simulation.watch.finding import INTERRUPTION, STALL, TRIP, Finding, Kind
from orchestrator.simulation.watch.own_trips import OWN_TRIPS
from orchestrator.simulation.watch.relay_trips import finding_of, relays_in
from orchestrator.simulation.watch.watch import Watch
from orchestrator.studies.modes.modes import running
from orchestrator.studies.operating_points.item import Item
from orchestrator.studies.operating_points.line_ends import LineEnd
from orchestrator.studies.operating_points.outages import what_remains
from orchestrator.studies.operating_points.point_columns import least_scale
from orchestrator.studies.operating_points.preparation import ItemPreparation
from orchestrator.studies.screening.record import OutageRun, RelayTrip, WentWrong
from orchestrator.systems.coupling.bus_relays import Trip
from orchestrator.systems.coupling.events import (
    BusFault,
    Event,
    LineEndSwitching,
    LineSwitching,
    LoadChange,
    ShuntSwitching,
    UnitSwitching,
)

BEGIN = 1.0  # time at which the outage, or the fault before it, happens [s]

DECIDING: frozenset[Kind] = frozenset(("loss_of_synchronism", "run_away", "not_finite", "failure"))
"""Findings that decide about an outage beside its modes; whether small motions decay, the modes tell."""


class OutageRuns:
    """Runs the outages of one scenario.

    ``seconds``: how long a run goes on after its outage [s]; ``cleared_after``: how long a three-phase short circuit at
    the first bus of what is lost lasts before that [s], None for none. Both are rounded to communication steps."""

    def __init__(
        self,
        case: Case,
        scenario: str,
        layers: Sequence[ParameterFile],
        step_size: float | None,
        sharing: SharingRule | None,
        *,
        seconds: float,
        cleared_after: float | None,
    ) -> None:
        self._seconds, self._cleared_after = seconds, cleared_after
        self._place = (scenario, tuple(layers), step_size, sharing)
        self._case = case
        self._preparation: ItemPreparation | None = None

    def run(self, item: Item, faulted: Collection[str]) -> OutageRun:
        """Run from the point of an item without its outage, which happens in the run.

        ``faulted``: buses of all the faults that the runs may need, which share one network."""
        preparation = self._prepared_for(faulted)
        own = tuple(name for name in item.out if name not in item.lost)
        before = preparation.prepared(replace(item, outage=0, out=own, lost=())).scenario
        step = before.step_size
        lasts = round((self._cleared_after or 0.0) / step) * step
        at = BEGIN + lasts
        events = [*self._fault(item, before, at), *_outage(preparation, item, own, before, at)]
        stop = round((at + self._seconds) / step) * step
        return _outage_run(replace(before, events=tuple(events), stop_time=stop))

    def _prepared_for(self, faulted: Collection[str]) -> ItemPreparation:
        if self._preparation is None:
            case = self._case
            if self._cleared_after is not None:
                case = replace(case, faulted=frozenset(faulted))
            self._preparation = ItemPreparation(case, *self._place)
        return self._preparation

    def _fault(self, item: Item, before: PreparedScenario, end: float) -> list[Event]:
        if self._cleared_after is None:
            return []
        bus = first_bus(item, before)
        fault = BusFault(BEGIN, before.grid, bus, True)
        return [fault, replace(fault, time=end, on=False)]


def first_bus(item: Item, prepared: PreparedScenario) -> str:
    """Return the first bus of what an outage takes, of an open end its own, at which its fault is."""
    end = LineEnd.of(item.lost[0])
    return end.bus if end is not None else prepared.buses_of[item.lost[0]][0]


def _outage(
    preparation: ItemPreparation,
    item: Item,
    own: tuple[str, ...],
    before: PreparedScenario,
    at: float,
) -> Iterator[Event]:
    """Yield what opens: the elements of the outage, and what is dead without them.

    A branch on which a dead part hangs stays closed, as in the power flow: nothing flows there."""
    elements, grid = preparation.elements, before.grid
    left = what_remains(before, elements, item.out)
    was = what_remains(before, elements, own)
    plans = before.system.components
    units = [unit for unit in left.units if unit not in was.units]
    for name in units:
        if name in plans:
            has_breaker = "connected" in plans[name].description.variables
            yield UnitSwitching(at, grid, name, False, has_breaker)
    for name in item.lost:
        end = LineEnd.of(name)
        if name in elements.lines and name not in left.ties:
            yield LineSwitching(at, grid, name, False)
        elif end is not None and end.line not in left.ties:
            yield LineEndSwitching(at, grid, end.line, end.side(elements), False)
    shunts = dict.fromkeys([*(x for x in item.lost if x in elements.shunts), *left.shunts])
    for name in shunts:
        if name not in was.shunts:
            yield ShuntSwitching(at, grid, name, False)
    for name in left.loads:
        if name not in was.loads:
            yield LoadChange(at, grid, name, least_scale(name, plans[grid]))


def _outage_run(prepared: PreparedScenario) -> OutageRun:
    watch, relays = Watch(prepared), relays_in(prepared)
    failure: CosimError | None = None
    with running(prepared) as master:
        try:
            master.run(prepared.stop_time, prepared.events, [*watch.observers, relays])
        except NotTakenUpError:
            raise
        except CosimError as error:
            failure = error
        late = master.late_starts
    trips = relays.trips
    findings = watch.findings(failure, late, trips=trips)
    told = [_by_relay(trip) for trip in trips]
    told += [_inside(one) for one in findings if one.kind == TRIP and one.variable in OWN_TRIPS]
    told += [_inside(one) for one in findings if one.kind == STALL]
    told += [
        _inside(one) for one in findings if one.kind == INTERRUPTION and one.until is None
    ]  # what comes back after a fault is as the control is meant
    wrong = [_gone_wrong(one) for one in findings if one.kind in DECIDING]
    return OutageRun(prepared.stop_time, tuple(told), tuple(wrong))


def _by_relay(trip: Trip) -> RelayTrip:
    message = finding_of(trip).message
    return RelayTrip(trip.relay.of, trip.relay.record, trip.time, trip.seen, message)


def _inside(one: Finding) -> RelayTrip:
    return RelayTrip(one.component, "", one.time, one.figures["power_mw"], one.message)


def _gone_wrong(finding: Finding) -> WentWrong:
    return WentWrong(finding.kind, finding.component, finding.time, finding.message)
