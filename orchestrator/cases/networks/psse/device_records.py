"""Records of the devices of a PSS/E file, in revisions 23 to 36: DC lines, FACTS devices, induction machines, GNE."""

import math
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass

from orchestrator.cases.form.remedies import without_kinds
from orchestrator.cases.networks.psse.bridges import Bridges
from orchestrator.cases.networks.psse.devices import HeldDevice
from orchestrator.cases.networks.psse.facts_devices import BYPASSED, IMPEDANCE, FactsDevice
from orchestrator.cases.networks.psse.induction_machines import ABSENT, Circuit, InductionMachine
from orchestrator.cases.networks.psse.multi_terminal import MultiTerminal, Terminal
from orchestrator.cases.networks.psse.raw_records import (
    NODES,
    RawFile,
    Record,
    elements,
    first_of_gne,
)
from orchestrator.cases.networks.psse.two_terminal import TwoTerminal
from orchestrator.cases.networks.psse.unknown_devices import UnknownDevice
from orchestrator.cases.networks.psse.vsc_lines import Converter, VscLine
from orchestrator.cases.networks.source_changes import Remark

_KILO = 1000.0
_NO_LIMIT = 9999.0  # Mvar by which PSS/E says that a converter has no limit
_STATUS = {
    "two-terminal dc": 1,
    "vsc dc line": 1,
    "multi-terminal dc": 4,
    "facts device": 3,
    "induction machine": 2,
}
"""Column of MDC, MODE or STAT, of which 0 is out of service."""


@dataclass(frozen=True)
class Places:
    """The buses of a file, as its devices need them.

    ``standing``: the bus that stands for one of the file, if it is in service; ``kilovolts``: nominal voltages."""

    standing: Callable[[int], int | None]
    kilovolts: Mapping[int, float]


@dataclass(frozen=True)
class FoundDevices:
    """Devices in service, and why others are not used, by section and place among its elements."""

    devices: tuple[HeldDevice, ...]
    unused: Mapping[tuple[str, int], str]
    # lines of those that are asked about, and what is said
    remarks: tuple[tuple[int, str], ...] = ()


def read_devices(raw: RawFile, left_out: Collection[str], places: Places) -> FoundDevices:
    """Return the devices of a file that are in service, without the kinds that the user leaves out.

    Raises an `InputError` for a record that cannot be understood, and for what our network cannot have."""
    found: list[HeldDevice] = []
    unused: dict[tuple[str, int], str] = {}
    remarks = []
    seen = set[tuple[str, str, tuple[int, ...]]]()
    for section, read in _READERS.items():
        if section in left_out:
            continue
        for k, lines in enumerate(elements(section, raw.of(section))):
            record = lines[0]
            if not any(record.fields):
                unused[section, k] = "an empty record"
                continue
            if not _status(section, record):
                unused[section, k] = "out of service: its status is 0"
                continue
            missing = [bus for bus in _buses(raw, section, lines) if places.standing(bus) is None]
            if missing:
                named = ", ".join(map(str, missing))
                text = Remark(
                    f"not used: bus {named} is not in the file, or out of service",
                    "a device without a bus",
                )
                unused[section, k] = text
                remarks.append((record.line, text))
                continue
            found.append(read(raw, lines, places))
            own = _identity(found[-1])
            if own in seen:
                text = Remark(
                    f"a second {section} of the name {own[1]!r}: both are used, and PSS/E keeps one of a name",
                    f"a second {section} of a name",
                )
                remarks.append((record.line, text))
            seen.add(own)
    return FoundDevices(tuple(found), unused, tuple(remarks))


def _identity(device: HeldDevice) -> tuple[str, str, tuple[int, ...]]:
    """Return what PSS/E knows a device by: its kind and name, and for an induction machine its bus."""
    places = device.places if device.section == "induction machine" else ()
    return device.section, device.name, places


def _status(section: str, record: Record) -> int:
    """Return 0 for a device that is out of service."""
    if section != "gne":
        return record.whole(_STATUS[section], "the status", 1)
    if not record.text(2).isdigit():
        raise record.error(
            f"no record of a GNE, whose third value is NTERM, a number; here it is {record.text(2)!r}. Export the case "
            f"once more, or write {without_kinds(['gne'])}"
        )
    return record.whole(first_of_gne(record) + 3, "STATUS", 1)


def _buses(raw: RawFile, section: str, lines: Sequence[Record]) -> Iterator[int]:
    """Yield the buses at which a device stands."""
    record = lines[0]
    if section in ("two-terminal dc", "vsc dc line"):
        for line in lines[1:]:
            yield abs(line.whole(0, "the bus' number"))
    elif section == "multi-terminal dc":
        for line in lines[1 : 1 + record.whole(1, "NCONV", 0)]:
            yield abs(line.whole(0, "the bus' number"))
    elif section == "facts device":
        yield abs(record.whole(1, "I"))
        if record.whole(2, "J", 0):
            yield abs(record.whole(2, "J"))
    elif section == "gne":
        for k in range(record.whole(2, "NTERM")):
            yield abs(record.whole(3 + k, "the bus' number"))
    else:
        yield abs(record.whole(0, "the bus' number"))


def _bus(record: Record, column: int, places: Places) -> int:
    """Return the bus that stands for one which is known to be there."""
    bus = places.standing(abs(record.whole(column, "the bus' number")))
    if bus is None:
        raise record.error("there is no such bus")
    return bus


def _bridges(line: Record, capacitor: int | None) -> Bridges:
    """Return the bridges of a converter's line; ``capacitor``: column of XCAP."""
    tap = line.number(8, "TAP", 1.0)
    if not tap > 0:
        raise line.error(f"TAP is {tap:g}; it must exceed 0")
    return Bridges(
        count=line.whole(1, "NB", 0),
        x_ohm=line.number(5, "XC [ohm]", 0.0),
        capacitor_ohm=0.0 if capacitor is None else line.number(capacitor, "XCAP [ohm]", 0.0),
        base_kv=line.number(6, "EBAS [kV]", 0.0),
        ratio=line.number(7, "TR", 1.0) / tap,
        least_angle=math.radians(line.number(3, "ANMN [degrees]", 0.0)),
        most_angle=math.radians(line.number(2, "ANMX [degrees]", 90.0)),
    )


def _two_terminal(raw: RawFile, lines: Sequence[Record], places: Places) -> TwoTerminal:
    head, *ends = lines
    if len(ends) != 2:
        raise head.error(
            "a two-terminal DC line has three lines of data; export the case once more"
        )
    mode = head.whole(1, "MDC", 0)
    if mode not in (1, 2):
        raise head.error(
            f"MDC is {mode}; it is 0 for a blocked line, 1 for power, or 2 for current"
        )
    scheduled = head.number(4, "VSCHD [kV]", 0.0)
    if not scheduled > 0:
        raise head.error(f"VSCHD is {scheduled:g} kV; it must exceed 0")
    _require_two_buses(head, ends)
    # the node of the commutating bus stands before the controlling transformer from revision 35 on
    capacitor = 17 if raw.revision >= NODES else 16
    rectifier, inverter = (_bridges(line, capacitor) for line in ends)
    return TwoTerminal(
        "two-terminal dc",
        head.line,
        head.text(0),
        place=raw.place,
        mode=mode,
        r_ohm=head.number(2, "RDC [ohm]", 0.0),
        setting=head.number(3, "SETVL", 0.0),
        scheduled_kv=scheduled,
        least_kv=head.number(5, "VCMOD [kV]", 0.0),
        compounding_ohm=head.number(6, "RCOMP [ohm]", 0.0),
        margin=head.number(7, "DELTI", 0.0),
        buses=(_bus(ends[0], 0, places), _bus(ends[1], 0, places)),
        bridges=(rectifier, inverter),
    )


def _require_two_buses(head: Record, ends: Sequence[Record]) -> None:
    """Raise an `InputError` for a DC line from a bus to itself.

    Buses that a line without impedance makes one are two in the record: such a line is taken."""
    rectifier, inverter = (abs(line.whole(0, "the bus' number")) for line in ends)
    if rectifier == inverter:
        raise head.error(
            f"the DC line {head.text(0)!r} has its rectifier and its inverter at one bus, {rectifier}: it "
            f"joins nothing; correct the bus of one of them, or write {without_kinds(['two-terminal dc'])}"
        )


def _vsc_line(raw: RawFile, lines: Sequence[Record], places: Places) -> VscLine:
    head, *ends = lines
    if len(ends) != 2:
        raise head.error("a VSC DC line has three lines of data; export the case once more")
    first, second = (_converter(line, places) for line in ends)
    resistance = head.number(2, "RDC [ohm]", 0.0)
    return VscLine(
        "vsc dc line",
        head.line,
        head.text(0),
        place=raw.place,
        r_ohm=resistance,
        converters=(first, second),
    )


def _converter(line: Record, places: Places) -> Converter:
    kind, mode = line.whole(1, "TYPE", 0), line.whole(2, "MODE", 1)
    if kind not in (0, 1, 2) or mode not in (1, 2):
        raise line.error(f"TYPE is {kind} and MODE {mode}; they are 0 to 2, and 1 or 2")
    setting = line.number(3, "DCSET", 0.0)
    if kind == 1 and not setting > 0:
        raise line.error(f"DCSET is {setting:g} kV with TYPE = 1; it must exceed 0")
    bus = _bus(line, 0, places)
    held = line.number(4, "ACSET", 1.0)
    if mode == 1 and not 0 < held < 2:
        raise line.error(f"ACSET is {held:g} pu with MODE = 1; a voltage of 0 to 2 pu is wanted")
    most, least = line.number(11, "MAXQ", _NO_LIMIT), line.number(12, "MINQ", -_NO_LIMIT)
    if most < least:
        raise line.error(f"MAXQ is {most:g} Mvar, less than MINQ of {least:g}; swap them")
    remote = abs(line.whole(13, "the controlled bus", 0))
    return Converter(
        bus=bus,
        type=kind,
        mode=mode,
        dc_setting=setting,
        ac_setting=held,
        loss_mw=line.number(5, "ALOSS [kW]", 0.0) / _KILO,
        loss_kv=line.number(6, "BLOSS [kW/A]", 0.0),
        least_loss_mw=line.number(7, "MINLOSS [kW]", 0.0) / _KILO,
        rating_mva=line.number(8, "SMAX [MVA]", 0.0),
        rating_ka=line.number(9, "IMAX [A]", 0.0) / _KILO,
        most_mvar=most if most < _NO_LIMIT else math.inf,
        least_mvar=least if least > -_NO_LIMIT else -math.inf,
        is_remote=bool(remote) and places.standing(remote) != bus,
        base_kv=places.kilovolts.get(bus, 0.0),
    )


def _multi_terminal(raw: RawFile, lines: Sequence[Record], places: Places) -> MultiTerminal:
    head = lines[0]
    converters, buses, links = (
        head.whole(k, n, 0) for k, n in ((1, "NCONV"), (2, "NDCBS"), (3, "NDCLN"))
    )
    if len(lines) != 1 + converters + buses + links or not (converters and buses and links):
        raise head.error(
            f"NCONV, NDCBS and NDCLN are {converters}, {buses} and {links}, which do not fit the lines that follow, "
            f"or leave no DC network; export the case once more, or write {without_kinds(['multi-terminal dc'])}"
        )
    at_converters = lines[1 : 1 + converters]
    at_buses, at_links = (
        lines[1 + converters : 1 + converters + buses],
        lines[1 + converters + buses :],
    )
    dc_bus = {abs(line.whole(1, "IB", 0)): line.whole(0, "IDC") for line in at_buses}
    terminals = []
    for line in at_converters:
        number = abs(line.whole(0, "IB"))
        if number not in dc_bus:
            raise line.error(
                f"no DC bus of {head.text(0)!r} names the converter's bus {number} as its IB"
            )
        terminals.append(
            Terminal(
                _bus(line, 0, places),
                dc_bus[number],
                _bridges(line, None),
                line.number(12, "SETVL", 0.0),
            )
        )
    for line in at_buses:
        if line.whole(5, "IDC2", 0):
            raise line.error(
                "a converter between two DC buses (IDC2) is not read; write "
                f"{without_kinds(['multi-terminal dc'])}, and put what the converters draw into loads"
            )
    voltage = abs(head.whole(5, "VCONV", 0))
    numbers = [abs(line.whole(0, "IB")) for line in at_converters]
    if voltage not in numbers:
        raise head.error(
            f"VCONV is {voltage}, which is no bus of its converters: none holds the DC voltage"
        )
    earths = [(line.whole(0, "IDC"), line.number(6, "RGRND [ohm]", 0.0)) for line in at_buses]
    return MultiTerminal(
        "multi-terminal dc",
        head.line,
        head.text(0),
        place=raw.place,
        mode=head.whole(4, "MDC", 0),
        terminals=tuple(terminals),
        holding=numbers.index(voltage),
        links=tuple(map(_link, at_links)),
        earths=tuple((bus, ohm) for bus, ohm in earths if ohm > 0),
    )


def _link(line: Record) -> tuple[int, int, float]:
    # the metered end stands before the resistance in later revisions
    column = 4 if len(line.fields) > 5 else 3
    ohm = line.number(column, "RDC [ohm]")
    if not ohm > 0:
        raise line.error(f"RDC is {ohm:g} ohm; it must exceed 0")
    return line.whole(0, "IDC"), line.whole(1, "JDC"), ohm


_FROM_SOLUTION = range(4, 9)
"""Modes of a FACTS device's series part that only a solution tells: a constant voltage, and linked devices (IPFC)."""

_MODES = 9  # of PSS/E, from 0


def _facts(raw: RawFile, lines: Sequence[Record], places: Places) -> FactsDevice | UnknownDevice:
    (record,) = lines
    mode, far = record.whole(3, "MODE", 1), record.whole(2, "J", 0)
    if mode not in range(_MODES):
        raise record.error(
            f"MODE is {mode}: no mode of PSS/E, which has 0 to 8. Write {without_kinds(['facts device'])}, and put "
            "what it feeds or draws into loads"
        )
    if far and mode in _FROM_SOLUTION:
        buses = (_bus(record, 1, places), _bus(record, 2, places))
        return UnknownDevice(
            "facts device", record.line, record.text(0), place=raw.place, buses=buses, kind="facts"
        )
    held = record.number(6, "VSET", 1.0)
    if not 0 < held < 2:
        raise record.error(f"VSET is {held:g} pu; a voltage of 0 to 2 pu is wanted")
    sending = _bus(record, 1, places)
    remote = abs(record.whole(19, "the controlled bus", 0))
    return FactsDevice(
        "facts device",
        record.line,
        record.text(0),
        sending=sending,
        terminal=_bus(record, 2, places) if far else 0,
        mode=mode,
        power=complex(record.number(4, "PDES", 0.0), record.number(5, "QDES", 0.0)),
        v_pu=held,
        most_mva=record.number(7, "SHMX [MVA]", _NO_LIMIT),
        is_remote=bool(remote) and places.standing(remote) != sending,
    )


def series_impedances(raw: RawFile, left_out: Collection[str]) -> Iterator[tuple[Record, complex]]:
    """Yield the FACTS devices whose series part is an impedance [pu], or bypassed: 0."""
    if "facts device" in left_out:
        return
    for record in raw.of("facts device"):
        mode = record.whole(3, "MODE", 1) if any(record.fields) else 0
        if record.text(2) and record.whole(2, "J", 0) and mode in (BYPASSED, IMPEDANCE):
            z = complex(record.number(16, "SET1", 0.0), record.number(17, "SET2", 0.0))
            yield record, z if mode == IMPEDANCE else 0j


def _induction(raw: RawFile, lines: Sequence[Record], places: Places) -> InductionMachine:
    (record,) = lines
    bus = _bus(record, 0, places)
    base = record.number(10, "MBASE", raw.base_mva) or raw.base_mva
    rated, own = record.number(11, "RATEKV", 0.0), places.kilovolts.get(bus, 0.0)
    return InductionMachine(
        "induction machine",
        record.line,
        record.text(1, "1"),
        place=raw.place,
        bus=bus,
        is_mechanical=record.whole(12, "PCODE", 1) == 1,
        power_mw=record.number(13, "PSET [MW]", 0.0),
        base_mva=base,
        voltage_ratio=own / rated if own > 0 and rated > 0 else 1.0,
        circuit=_circuit(record),
        is_saturated=any(record.number(column, "SE", 0.0) for column in (28, 30)),
    )


def _circuit(record: Record) -> Circuit | None:
    """Return the circuit of a machine; None if its record names a standard design instead."""
    ra, xa, xm, r1, x1, r2, x2, x3 = (
        record.number(19 + k, name, default)
        for k, (name, default) in enumerate(
            (
                ("RA", 0.0),
                ("XA", 0.0),
                ("XM", 2.5),
                ("R1", ABSENT),
                ("X1", ABSENT),
                ("R2", ABSENT),
                ("X2", ABSENT),
                ("X3", 0.0),
            )
        )
    )
    cages = [complex(r, x) for r, x in ((r1, x1), (r2, x2)) if max(r, x) < ABSENT and r > 0]
    if not cages:
        return None
    xa *= record.number(33, "XAMULT", 1.0)
    return Circuit(complex(ra, xa), xm, tuple(cages), x3)


def _gne(raw: RawFile, lines: Sequence[Record], places: Places) -> UnknownDevice:
    head = lines[0]
    buses = tuple(_bus(head, 3 + k, places) for k in range(head.whole(2, "NTERM")))
    return UnknownDevice("gne", head.line, head.text(0), place=raw.place, buses=buses)


_READERS: Mapping[str, Callable[[RawFile, Sequence[Record], Places], HeldDevice]] = {
    "two-terminal dc": _two_terminal,
    "vsc dc line": _vsc_line,
    "multi-terminal dc": _multi_terminal,
    "facts device": _facts,
    "induction machine": _induction,
    "gne": _gne,
}
