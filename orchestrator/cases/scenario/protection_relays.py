"""Relays of a scenario: which records of a DYR file have one here, and what it orders in a run."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial

from fmus.grid.network import Network
from orchestrator.cases.draft import Draft
from orchestrator.cases.flow.power_flow import PowerFlow
from orchestrator.cases.networks.data import bus_name
from orchestrator.cases.networks.psse.dyr_file import DynamicRecord
from orchestrator.cases.networks.psse.load_relay_records import (
    LoadRelay,
    TransferTrip,
    is_of,
    load_relays,
)
from orchestrator.cases.networks.psse.raw_network import FileLoad, unit_labels
from orchestrator.cases.networks.psse.refusals import Refusals
from orchestrator.cases.networks.psse.relay_doubts import doubts_of_settings, idle_load_relays
from orchestrator.cases.networks.psse.relay_records import UnitRelay, unit_relays
from orchestrator.cases.networks.step_ups import shared_branches
from orchestrator.cases.scenario.measured_points import line_of_numbers
from orchestrator.core.errors import InputError, Problem, QuestionTopic, few
from orchestrator.core.options import Option
from orchestrator.systems.coupling.bus_relays import RATED_FREQUENCY, Relay, Shedding
from orchestrator.systems.coupling.events import Event, LineSwitching, UnitSwitching
from orchestrator.systems.coupling.no_trip_regions import NO_TRIP_REGIONS

_UNIT_KINDS = ("sg", "gfor")  # first parts of the names of a unit's generator and converter
_RATED = "f_n"  # parameter with a device's rated frequency [Hz]
_UNITS = {"voltage": "pu", "frequency": "Hz"}
_DISTRIBUTED = (
    "dera1_phasor"  # model of what a distribution network feeds: codes of plants are not its
)
_NAMED = 3  # relays that an error names; the others are counted
_WIND = "WT"  # how the names of records begin that only wind turbines have
_LONGEST_ASKED = 60.0  # delay [s] from which a relay trips after the end of most runs
_OTHER_FREQUENCY = 1.0  # difference [Hz] from which a system has another rated frequency

Place = tuple[str, int]
"""File and line of a record."""


@dataclass(frozen=True)
class TakenRelays:
    """Places of the records that a relay stands for, and why others of relays have none."""

    places: frozenset[Place] = frozenset()
    unused: Mapping[Place, str] = field(default_factory=dict)


def take_relays(
    draft: Draft, records: Sequence[DynamicRecord], file_loads: Sequence[FileLoad]
) -> TakenRelays:
    """Give the draft the relays of its units and loads; a record of none is accounted for.

    ``file_loads``: of the file, those among them in whose place motors stand."""
    data = draft.data
    if data is None:
        return TakenRelays(frozenset(), {})
    labels = unit_labels(data.machines)
    refusals, of_units, stages = Refusals(), list[UnitRelay](), list[LoadRelay]()
    with refusals.keep():
        of_units = unit_relays(records)
    with refusals.keep():
        stages = load_relays(records, data.file_loads)
    refusals.tell()
    taken: list[tuple[str, UnitRelay]] = []
    unused: dict[Place, str] = {}
    for relay in of_units:
        bus, name = relay.machine
        label = labels.get(relay.machine)
        if relay.machine in data.idle_machines:
            why = f"a relay of the machine {name!r} at bus {bus}, which is not in service"
            unused[_place(relay.record)] = why
        elif label is None:
            why = f"a relay of the machine {name!r} at bus {bus}, which the RAW file does not have"
            unused[_place(relay.record)] = why
            _ask_whose(draft, relay.record, why, "correct the bus or identifier of its machine")
        elif bus_name(str(relay.watched)) not in data.buses:
            why = f"a relay of bus {relay.watched}, which is no bus here"
            unused[_place(relay.record)] = why
            _ask_whose(draft, relay.record, why, "correct the bus that it watches")
        else:
            taken.append((label, relay))
    loads = {load.name for load in data.loads}
    of_loads = [
        relay
        for relay in stages
        if relay.load.load in loads and bus_name(str(relay.watched)) in data.buses
    ]
    draft.unit_relays, draft.load_relays = taken, of_loads
    alone = {(load.bus, load.name) for load in data.file_loads}
    idle = idle_load_relays(
        records,
        file_loads,
        stages,
        is_motor=lambda load: (load.bus, load.name) not in alone,
        is_bus=lambda number: bus_name(str(number)) in data.buses,
    )
    for one in idle:
        unused[_place(one.record)] = one.why
        if one.remedy:
            _ask_whose(draft, one.record, one.why, one.remedy)
    draft.found.questions += doubts_of_settings([relay for _, relay in taken], of_loads)
    used = [*(relay.record for _, relay in taken), *(relay.record for relay in of_loads)]
    return TakenRelays(frozenset(map(_place, used)), unused)


def _ask_whose(draft: Draft, record: DynamicRecord, why: str, remedy: str) -> None:
    """Ask about a relay that no run has, as it is of nothing in the network."""
    text = f"{record.name} is not used: {why}, so that it never trips; {remedy}"
    topic = QuestionTopic("a relay that never trips", record.name)
    draft.found.questions.append(Problem(record.place, text, topic=topic))


def _place(record: DynamicRecord) -> Place:
    return record.file, record.line


def relays_of(draft: Draft, flow: PowerFlow | None) -> tuple[Relay, ...]:
    """Return the relays of what is in the scenario, and ask about those that trip at the operating point."""
    grid = draft.grid
    if grid is None or grid not in draft.system.components or draft.found.problems:
        return ()
    f_n = _rated_frequency(draft)
    found: list[Relay] = []
    for label, unit in draft.unit_relays:
        orders = _orders_of_unit(draft, grid, label, unit)
        if orders:
            named = bus_name(str(unit.machine[0])) if unit.is_of_bus else label
            relay = Relay(
                unit.record.name,
                _name_of(draft, named),
                grid,
                bus_name(str(unit.watched)),
                unit.quantity,
                unit.limits,
                orders=orders,
                f_n=f_n,
            )
            found.append(relay)
            _ask(draft, relay, flow, unit.record)
    for stage in draft.load_relays:
        ordered = _orders_of_stage(draft, grid, stage)
        if ordered:
            relay = Relay(
                stage.record.name,
                _protected(ordered) if stage.transfer else stage.load.load,
                grid,
                bus_name(str(stage.watched)),
                stage.quantity,
                stage.limits,
                orders=ordered,
                f_n=f_n,
            )
            found.append(relay)
            _ask(draft, relay, flow, stage.record)
    all_orders = (order for relay in found for order in relay.orders)
    protected = {order.unit for order in all_orders if isinstance(order, UnitSwitching)}
    return (*found, *_by_code(draft, grid, f_n, protected, flow))


def _by_code(
    draft: Draft, grid: str, f_n: float, protected: Collection[str], flow: PowerFlow | None
) -> Iterator[Relay]:
    """Yield the relays of a code for the converters that have none by a record."""
    code, network = draft.given.case.protection, draft.network
    if code is None or network is None:
        return
    place, plans = draft.given.place("protection"), draft.system.components
    known = plans[grid].description.variables
    units = {port.name: port.bus for port in network.ports if port.name in plans}
    high = _high_sides(network, units)
    for name in (name for name in units if _is_plant(draft, name) and name not in protected):
        region = NO_TRIP_REGIONS[code][_is_wind(draft, name)]
        if abs(f_n - region.rated) > _OTHER_FREQUENCY:
            text = f"{region.title} is for {region.rated:g} Hz, and the case has {f_n:g} Hz"
            draft.note(place, f"{text}; leave it out (" + Option.PROTECTION + ")")
            return
        far = high.get(name, "")
        watched = far if f"{far}.v_re" in known else units[name]
        own = partial(
            Relay,
            record=region.title,
            of=name,
            component=grid,
            bus=watched,
            orders=(_unit_off(draft, grid, name),),
            f_n=f_n,
        )
        for quantity, limits in region.limits.items():
            for one in limits:
                relay = own(quantity=quantity, limits=one)
                if one.delay < _LONGEST_ASKED:
                    _ask_at_rest(draft, relay, flow, place, "look at the operating point")
                yield relay


def _is_plant(draft: Draft, name: str) -> bool:
    is_distributed = draft.tables[name].model == _DISTRIBUTED
    return draft.system.components[name].kind == "converter" and not is_distributed


def _high_sides(network: Network, units: Mapping[str, str]) -> dict[str, str]:
    """Return the far bus of the transformer that a unit has alone or shares with others, where the code looks."""
    found: dict[str, str] = {}
    behind = shared_branches(network, units)
    for line in (line for line in network.lines if line.name in behind):
        for unit in behind[line.name]:
            found[unit] = line.to_bus if units[unit] == line.from_bus else line.from_bus
    return found


def take_wind_turbines(draft: Draft, records: Sequence[DynamicRecord]) -> None:
    """Give the draft the units that have a record of a wind turbine.

    One that the case leaves out counts as well, and so does that of a machine in whose place a converter stands: what
    drives the plant is the same."""
    labels = unit_labels(draft.data.machines) if draft.data else {}
    machines = {(record.bus, record.machine) for record in records if record.name.startswith(_WIND)}
    draft.wind_turbines = {label for machine, label in labels.items() if machine in machines}


def _is_wind(draft: Draft, name: str) -> bool:
    """Return whether a plant has, or its machine had, a record of a wind turbine."""
    if name in {f"{kind}{label}" for kind in _UNIT_KINDS for label in draft.wind_turbines}:
        return True
    records = draft.tables[name].records or ""
    return any(record.upper().startswith(_WIND) for record in records.split())


def _rated_frequency(draft: Draft) -> float:
    plans = draft.system.components.values()
    rated = (plan.number(_RATED) for plan in plans if _RATED in plan.description.variables)
    return next(rated, RATED_FREQUENCY)


def _name_of(draft: Draft, label: str) -> str:
    """Return the component of a unit's label; a bus as it is."""
    names = (f"{kind}{label}" for kind in _UNIT_KINDS)
    return next((name for name in names if name in draft.system.components), label)


def _orders_of_unit(draft: Draft, grid: str, label: str, relay: UnitRelay) -> tuple[Event, ...]:
    if relay.is_of_bus:
        return tuple(_bus_off(draft, grid, bus_name(str(relay.machine[0]))))
    names = [f"{kind}{label}" for kind in _UNIT_KINDS]
    return tuple(_unit_off(draft, grid, name) for name in names if name in draft.system.components)


def _unit_off(draft: Draft, grid: str, name: str) -> UnitSwitching:
    plan = draft.system.components.get(name)
    has_breaker = plan is not None and "connected" in plan.description.variables
    return UnitSwitching(0.0, grid, name, False, has_breaker)


def _bus_off(draft: Draft, grid: str, bus: str) -> Iterator[Event]:
    """Yield the events that leave a bus without units and lines; its loads draw nothing at no voltage."""
    network = draft.network
    if network is None:
        return
    for port in network.ports:
        if port.bus == bus:
            yield _unit_off(draft, grid, port.name)
    for line in network.lines:
        if bus in (line.from_bus, line.to_bus):
            yield LineSwitching(0.0, grid, line.name, False)


def _orders_of_stage(draft: Draft, grid: str, stage: LoadRelay) -> tuple[Event | Shedding, ...]:
    """Return what a stage orders: that its load is shed, or what it takes off besides."""
    if stage.transfer is not None:
        return _transferred(draft, grid, stage, stage.transfer)
    shed = _shedding(draft, grid, stage)
    return () if shed is None else (shed,)


def _protected(orders: Sequence[Event | Shedding]) -> str:
    """Return the units or lines that orders take off."""
    units = [order.unit for order in orders if isinstance(order, UnitSwitching)]
    return ", ".join(units + [x.line for x in orders if isinstance(x, LineSwitching)])


def _transferred(
    draft: Draft, grid: str, stage: LoadRelay, transfer: TransferTrip
) -> tuple[Event, ...]:
    found: list[Event] = []
    labels = unit_labels(draft.data.machines) if draft.data else {}
    for machine, label in labels.items():
        if is_of(transfer, machine):
            names = (f"{kind}{label}" for kind in _UNIT_KINDS)
            found += [_unit_off(draft, grid, x) for x in names if x in draft.system.components]
    if transfer.branch is not None:
        line = line_of_numbers(draft, *transfer.branch)
        if line is not None:
            found.append(LineSwitching(0.0, grid, line.name, False))
    if not found:
        _ask_transfer(draft, stage.record, transfer)
    return tuple(found)


def _ask_transfer(draft: Draft, record: DynamicRecord, transfer: TransferTrip) -> None:
    """Ask about what a relay would take off besides, once for each record."""
    what = "a branch"
    if transfer.machine is not None:
        bus, name = transfer.machine
        what = f"the machine {name!r} at bus {bus}"
    elif transfer.branch is not None:
        one, other, circuit = transfer.branch
        what = f"the branch {one}-{other}, circuit {circuit!r}"
    text = f"{record.name} sheds its load and takes nothing off besides: {what} is not here; correct it"
    asked = Problem(
        record.place, text, topic=QuestionTopic("a relay of nothing in the network", record.name)
    )
    if asked not in draft.found.questions:
        draft.found.questions.append(asked)


def _may_be_zero(draft: Draft, grid: str, load: str) -> bool:
    scale = draft.system.components[grid].description.variables.get(f"{load}.scale")
    return scale is not None and not scale.minimum


def _shedding(draft: Draft, grid: str, stage: LoadRelay) -> Shedding | None:
    """Return what a stage takes off; nothing of a load that the grid cannot be without."""
    network = draft.network
    if network is None:
        return None
    load = next((x for x in network.loads if x.name == stage.load.load), None)
    if load is None or not load.p_mw > 0:
        return None
    if not _may_be_zero(draft, grid, load.name):
        text = (
            f"{stage.record.name} does not shed {load.name}: nothing else determines the voltage of its bus; give a "
            "line there some charging B"
        )
        topic = QuestionTopic("a relay that cannot shed its load", load.name)
        draft.found.questions.append(Problem(stage.record.place, text, topic=topic))
        return None
    if stage.sheds_shunts and any(x.bus == load.bus for x in network.shunts):
        _ask_shunts(draft, stage.record, load.bus)
    part = stage.load.drawn.real / load.p_mw
    return Shedding(grid, load.name, min(1.0, part * stage.share))


def _ask_shunts(draft: Draft, record: DynamicRecord, bus: str) -> None:
    text = (
        f"{record.name} sheds a share of the shunts at {bus} with the load, and here they stay; write 0 for its flag "
        "if that is meant, or open them by an event"
    )
    topic = QuestionTopic("a relay that sheds shunts", record.name)
    asked = Problem(record.place, text, topic=topic)
    if asked not in draft.found.questions:
        draft.found.questions.append(asked)


def _ask(draft: Draft, relay: Relay, flow: PowerFlow | None, record: DynamicRecord) -> None:
    """Ask about a relay that is beyond a limit at the operating point, and so trips in every run."""
    remedy = f"correct its limit, or leave it out: dyr_leave_out = ['{record.name}'] in [units]"
    _ask_at_rest(draft, relay, flow, record.place, remedy)


def _ask_at_rest(
    draft: Draft, relay: Relay, flow: PowerFlow | None, place: str, remedy: str
) -> None:
    voltage = None if flow is None else flow.voltages.get(relay.bus)
    if relay.quantity == "frequency":
        rests = relay.f_n
    elif voltage is not None:
        rests = abs(voltage)
    else:
        return
    limits = relay.limits
    if limits.low <= rests <= limits.high:
        return
    unit = _UNITS[relay.quantity]
    side = f"below {limits.low:g}" if rests < limits.low else f"above {limits.high:g}"
    text = (
        f"{relay.record} of {relay.of}: the {relay.quantity} of {relay.bus} rests at {rests:.4g} {unit}, {side} "
        f"{unit}, so that it trips {limits.delay + limits.opening:g} s after the start of any run; {remedy}"
    )
    topic = QuestionTopic("a relay beyond its limit at rest", relay.of)
    draft.found.questions.append(Problem(place, text, topic=topic))


def require_no_relays(relays: Sequence[Relay], what: str) -> None:
    """Refuse relays where nothing can carry them.

    Parameters
    ----------
    relays
        The relays of a scenario.
    what
        What cannot carry them, as the begin of a sentence: "an SSP cannot hold".

    Raises
    ------
    InputError
        If there are any; it names them, and how to leave them out.
    """
    if not relays:
        return
    codes = {region.title for regions in NO_TRIP_REGIONS.values() for region in regions}
    records = list(dict.fromkeys(x.record for x in relays if x.record not in codes))
    named = list(dict.fromkeys(f"{relay.record} of {relay.of}" for relay in relays))
    remedies = [f"dyr_leave_out = {records} in [units]"] if records else []
    if len(records) < len({relay.record for relay in relays}):
        remedies.append("no protection at the top of the case (" + Option.PROTECTION + ")")
    raise InputError(
        f"{what} relays ({few(named, _NAMED)}), which order events in a run: leave them out by "
        f"{' and '.join(remedies)}"
    )
