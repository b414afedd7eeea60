"""Machines of a PSS/E RAW file, the voltages that they hold, and infinite buses at references without one."""

import math
from collections.abc import Callable, Sequence
from functools import partial

from orchestrator.cases.form.remedies import with_slack
from orchestrator.cases.networks.psse.raw_network import POWER_FACTOR, Machine
from orchestrator.cases.networks.psse.raw_records import Record
from orchestrator.cases.networks.psse.raw_tables import (
    ORDINARY,
    REFERENCE,
    RawTables,
    is_in_service,
)
from orchestrator.cases.networks.psse.references import (
    INFINITE_REACTANCE,
    references_without_machine,
)
from orchestrator.cases.networks.psse.solution import (
    HeldPower,
    SolvedBuses,
    reactive_needs,
    sort_buses,
    stated_voltages,
)
from orchestrator.core.options import Option

_NO_LIMIT = 9999.0  # MW or Mvar by which PSS/E says that a generator has no limit
_APART = 0.01  # voltage of a file beside what a generator within its limits is to hold [pu]
_CLOSE = 1e-4  # the same if the file's solution fits the generator's QG [pu]
_AT_LIMIT = 0.1  # Mvar by which a rounded QG may miss a limit


def _limits(
    record: Record,
    low: str,
    at: int,
    high: str,
    above: int,
    unit: str,
    doubt: Callable[[str], None] | None = None,
) -> tuple[float, float]:
    """A least and a largest value, infinite where the file has no limit, or two that no value fits.

    ``doubt``: takes the sentence about two limits that no value fits, which PSS/E reads as well."""
    least, most = record.number(at, low, -_NO_LIMIT), record.number(above, high, _NO_LIMIT)
    if least > most:
        if doubt is not None:
            doubt(
                f"the limit {low} is {least:g} {unit}, more than {high} of {most:g} {unit}: "
                "neither limits the machine here; are the two swapped, or columns shifted?"
            )
        return -math.inf, math.inf
    return least if least > -_NO_LIMIT else -math.inf, most if most < _NO_LIMIT else math.inf


def _fed_by_devices(net: RawTables) -> dict[int, float]:
    """Return the reactive power that devices feed at the file's voltages, by bus [Mvar]."""
    voltages = stated_voltages(list(net.rows.values()))
    fed: dict[int, float] = {}
    for device in net.devices.devices:
        for ending in device.endings(voltages):
            fed[ending.bus] = fed.get(ending.bus, 0.0) + ending.fed.imag
    return fed


def _solved_buses(net: RawTables, status: int) -> SolvedBuses:
    """Return the buses at which the file's voltages fit the machines' reactive power; none if it is not solved.

    ``status``: column of STAT in the records of machines."""
    needed = reactive_needs(net.rows, net.branches, net.to_earth, net.raw.base_mva)
    fed = _fed_by_devices(net) if needed else {}
    fed = {bus: q for bus, q in fed.items() if bus in needed}
    found: dict[int, list[HeldPower]] = {}
    for record in net.raw.of("generator"):
        bus = net.same.get(net.own_bus(record), net.own_bus(record))
        if record.whole(status, "STAT", 1) and bus in needed:
            least, most = _limits(record, "QB", 5, "QT", 4, "Mvar")
            above = net.magnitudes[bus] - record.number(6, "VS", 1.0)
            power = HeldPower(record.number(3, "QG", 0.0), least, most, above)
            found.setdefault(bus, []).append(power)
    return sort_buses(needed, fed, found)


def _setpoint(
    net: RawTables, record: Record, bus: int, limits: tuple[float, float], solved: SolvedBuses
) -> float:
    """Return the voltage that a machine is to hold [pu]: VS, or VM if the file's solution fits there."""
    least, most = limits
    fed, VM = record.number(3, "QG", 0.0), net.magnitudes[bus]
    held = record.number(6, "VS", 1.0)
    is_within = least + _AT_LIMIT < fed < most - _AT_LIMIT and bus not in solved.at_limit
    if bus in solved.all and abs(held - VM) > _CLOSE:
        text = "VS is not VM of the file's solution, as QG is at a limit"
        if bus in solved.at_limit:
            text = "VS is not VM of the file's solution, whose voltages need QB or QT there, and not QG"
        if is_within:
            text = f"VS is {held:g} pu, where the solved file has VM = {VM:g} pu, with Q within its limits"
        text += (
            ": it holds VM, from which PSS/E starts as well, where ANDES holds VS; the "
            "unit's v_0 (in [components.sg….parameters], also as "
            + Option.SET
            + " sg….v_0=VS) changes it"
        )
        net.changes.note(record.line, text)
        return VM
    if bus not in solved.all and VM != 1 and abs(held - VM) > _APART and least < fed < most:
        text = f"VS is {held:g} pu, where the solved file has VM = {VM:g} pu, with Q within its limits: VS is held"
        net.changes.note(record.line, text)
    return held


def read_machines(net: RawTables) -> tuple[Machine, ...]:
    mbase, status = (8, 14) if net.raw.revision < 35 else (9, 15)
    machines, solved = [], _solved_buses(net, status)
    for record in net.raw.of("generator"):
        own = net.own_bus(record)
        if not is_in_service(record, status, "STAT") or net.is_out(own):
            net.idle.add((own, record.text(1, "1").strip()))
            continue
        bus = net.bus(record)
        net.refuse_second(record, "machine", own, record.text(1, "1").strip())
        rating = record.number(mbase, "MBASE [MVA]", net.raw.base_mva)
        if not rating > 0:
            raise record.error(f"MBASE is {rating:g} MVA; it must exceed 0")
        doubt = partial(net.changes.note, record.line)
        least, most = _limits(record, "QB", 5, "QT", 4, "Mvar", doubt=doubt)
        remote = record.whole(7, "IREG", 0)
        if remote not in (0, bus):
            held = net.magnitudes[bus]
            net.changes.note(
                record.line,
                "voltage control of another bus: its own is held at the file's voltage",
            )
        elif net.rows[bus][1] == 1:
            held = net.magnitudes[bus]
            net.changes.note(
                record.line, "generator at a bus of type 1: it holds the file's voltage"
            )
        else:
            held = _setpoint(net, record, bus, (least, most), solved)
        if record.number(mbase + 4, "XT", 0.0):
            net.changes.note(
                record.line, "step-up transformer within a generator's record: left out"
            )
        source = complex(record.number(mbase + 1, "ZR", 0.0), record.number(mbase + 2, "ZX", 1.0))
        p_least, p_most = _limits(record, "PB", status + 3, "PT", status + 2, "MW", doubt=doubt)
        feeds = record.number(2, "PG", 0.0)
        if not p_least <= feeds <= p_most and feeds <= rating:  # else the rating is asked about
            text = f"PG is {feeds:g} MW, beyond the machine's limits, PB = {p_least:g} and PT = {p_most:g} MW"
            net.changes.note(
                record.line, f"{text}: it feeds PG, and takes no part of an outage beyond"
            )
        machines.append(
            Machine(
                bus,
                record.text(1, "1"),
                line=record.line,
                p_mw=feeds,
                v_pu=held,
                rating_mva=rating,
                source=source,
                q_min_mvar=least,
                q_max_mvar=most,
                p_min_mw=p_least,
                p_max_mw=p_most,
                q_mvar=record.number(3, "QG", 0.0),
            )
        )
        if machines[-1].likely_mva > rating:
            net.changes.note(
                record.line,
                "PG or QG exceeds MBASE, which is the base of the machine's data and need not be its rating: "
                "a DYR file's data stay on MBASE; without one, typical data are taken on PT, or on PG and QG, "
                f"with a power factor of {POWER_FACTOR:g}. Is the rating such, or is a power wrong?",
            )
    return tuple(machines)


def infinite_buses(net: RawTables, machines: Sequence[Machine], slack: str | None) -> list[Machine]:
    """Return what feeds what is left at references without a machine, which are ordinary buses otherwise."""
    named = {bus: {f"bus_{bus}", f"sg{bus}"} for bus, row in net.rows.items()}
    references = [bus for bus, row in net.rows.items() if row[1] == REFERENCE]
    found = references_without_machine(
        references, {machine.bus for machine in machines}, net.rows, net.branches_in_service
    )
    for bus, why in found.ordinary.items():
        net.rows[bus][1] = ORDINARY
        text = f"reference bus (IDE = 3) without a machine in service: {why}"
        net.changes.note(net.lines_of["bus", bus], text)
    if not machines:
        return []
    stands = [bus for bus in found.infinite if slack is None or slack in named[bus]]
    return [_infinite_bus(net, bus, machines) for bus in stands]


def _infinite_bus(net: RawTables, bus: int, machines: Sequence[Machine]) -> Machine:
    VM, idle = net.magnitudes[bus], {name for place, name in net.idle if place == bus}
    text = (
        f"reference bus (IDE = 3) without a machine in service: an infinite bus holds its VM = {VM:g} pu there and "
        f"feeds what is left, as a source behind {INFINITE_REACTANCE:g} pu (in PSS/E GENCLS with H = 0). If a "
        "machine is meant, add its record to the file; if another is to feed what is left, name it, such as "
        f"{with_slack(f'bus_{machines[0].bus}')}"
    )
    line = net.lines_of["bus", bus]
    net.changes.note(line, text)
    moved = sum(abs(machine.p_mw) for machine in machines)
    moved += sum(abs(complex(row[2], row[3])) for row in net.rows.values())
    return Machine(
        bus,
        "inf" if "1" in idle else "1",
        line,
        p_mw=0.0,
        v_pu=VM,
        rating_mva=max(net.raw.base_mva, math.ceil(moved)),
        source=INFINITE_REACTANCE * 1j,
        q_min_mvar=-math.inf,
        q_max_mvar=math.inf,
        is_infinite=True,
    )
