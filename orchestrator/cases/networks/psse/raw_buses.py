"""Buses of a PSS/E RAW file, those that a line without impedance joins, and those with nothing at them."""

from collections.abc import Collection, Sequence

from orchestrator.cases.networks.psse.raw_network import Machine
from orchestrator.cases.networks.psse.raw_records import (
    NODES,
    Record,
)
from orchestrator.cases.networks.psse.raw_tables import (
    BUS_COLUMNS,
    OUT_OF_SERVICE,
    REFERENCE,
    RawTables,
)
from orchestrator.cases.networks.psse.zero_impedances import is_joining, merged_buses, threshold
from orchestrator.cases.networks.source_changes import Remark

_VM = 7  # column of the table of buses with the magnitude of the voltage [pu]
_VA = 8  # column of the table of buses with its angle [degrees]
_BAND = slice(11, 13)  # columns of the most and the least voltage there; 0 where the file has none
_DRAWN = slice(2, 6)  # columns of the table of buses: powers of loads and shunts
_MOST_VOLTAGE = 2.0
SWITCH_STATE = 16  # column of STAT of a switching device


def reactance_of_switch(record: Record) -> float:
    """X of a switching device [pu of the system], which is 1e-4 where the file does not say it."""
    return record.number(3, "X", 1e-4)


def read_buses(net: RawTables) -> None:
    for record in net.raw.of("bus"):
        number, kind = record.whole(0, "the bus' number"), record.whole(3, "IDE", 1)
        if number <= 0:
            raise record.error(f"the bus' number is {number}; numbers exceed 0")
        net.refuse_second(record, "bus", number)
        if kind not in (1, 2, 3, 4):
            raise record.error(f"IDE is {kind}; known are 1 to 4")
        if kind == REFERENCE and any(row[1] == REFERENCE for row in net.rows.values()):
            net.changes.note(
                record.line, "second reference bus (IDE = 3): it holds its voltage and feeds PG"
            )
        net.rows[number] = [number, kind, *[0.0] * (BUS_COLUMNS - 2)]
        net.kilovolts[number] = record.number(2, "BASKV", 0.0)
        net.magnitudes[number] = record.number(7, "VM", 1.0)
        net.rows[number][_VM : _VA + 1] = (
            net.magnitudes[number],
            record.number(8, "VA [degrees]", 0.0),
        )
        net.rows[number][_BAND] = (
            record.number(9, "NVHI", 0.0),
            record.number(10, "NVLO", 0.0),
        )
        if kind != 4 and not 0 < net.magnitudes[number] <= _MOST_VOLTAGE:
            raise record.error(
                f"VM is {net.magnitudes[number]:g} pu; it must exceed 0 and be at most {_MOST_VOLTAGE:g} (no kV, "
                "no percent): export the solved case, or give 1"
            )
        net.labels[number] = str(number)
        net.titles[number] = record.text(1).strip()


def merge_buses(net: RawTables, modelled: Collection[tuple[int, str]] = ()) -> None:
    """Make one bus of those that a line without impedance joins.

    ``modelled``: bus and identifier of records of compensators; such a bus stands for the others, as a machine's
    does."""
    least = threshold(net.raw)
    zero = [
        *(
            record
            for record in net.raw.of("branch")
            if is_joining(record, least) and record.whole(net.column_of_ends + 4, "ST", 1)
        ),
        *(
            record
            for record in net.raw.of("system switching device")
            if reactance_of_switch(record) <= least and record.whole(SWITCH_STATE, "STAT", 1)
        ),
    ]
    joins = [
        (record, start, end)
        for record in zero
        for start, end in [(net.own_bus(record), net.own_bus(record, 1))]
        if all(bus in net.rows and net.rows[bus][1] != OUT_OF_SERVICE for bus in (start, end))
    ]
    status = 14 if net.raw.revision < NODES else 15
    held = {
        record.whole(0, "the bus' number")
        for record in net.raw.of("generator")
        if record.whole(status, "STAT", 1)
    } | {bus for bus, _ in modelled}
    kinds = {bus: int(row[1]) for bus, row in net.rows.items()}
    net.same, gone, kept = merged_buses(joins, kinds, held)
    for bus, standing in net.same.items():
        net.rows.pop(bus)
        net.changes.note(
            f"bus {bus} into {standing}",
            f"zero impedance lines (X up to THRSHZ = {least:g} pu): the buses are one, as in PSS/E",
        )
    net.merged = {record.line for record in gone}
    lines = {record.line for record in net.raw.of("branch")}
    for record in (record for record in gone if record.line in lines):
        net.add(net.bus(record), 4, net.line_to_earth(record) * net.raw.base_mva)
        resistance = record.number(3, "R", 0.0)
        if abs(resistance) > least:
            text = f"zero impedance line: its R of {resistance:g} pu has no effect, as in PSS/E"
            net.changes.note(record.line, Remark(text, "a zero impedance line with R"))
    net.lossless = {record.line for record in kept}
    for record in kept:
        text = (
            "zero impedance line between two buses with machines: a branch of the least reactance"
        )
        net.changes.note(record.line, text)


def leave_out_bare_buses(net: RawTables, machines: Sequence[Machine]) -> None:
    """Take buses with nothing at them out of service: PSS/E finds nothing to solve there."""
    needed = {machine.bus for machine in machines}
    needed.update(*net.branches_in_service)
    needed.update(*(device.places for device in net.devices.devices))
    for bus, row in net.rows.items():
        if (
            bus not in needed
            and row[1] != OUT_OF_SERVICE
            and not any(row[_DRAWN])
            and bus in net.titles
        ):
            row[1] = OUT_OF_SERVICE
            net.changes.note(net.lines_of["bus", bus], "nothing is connected to the bus: left out")
