"""Loads and shunts of a PSS/E RAW file."""

from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace

from orchestrator.cases.networks.bus_loads import BusLoads
from orchestrator.cases.networks.psse.controls import shunt_blocks, shunt_record
from orchestrator.cases.networks.psse.dyr_file import ONLY_SHUNT, shunt_name
from orchestrator.cases.networks.psse.raw_network import FileLoad
from orchestrator.cases.networks.psse.raw_records import NODES, Record
from orchestrator.cases.networks.psse.raw_tables import RawTables, is_in_service
from orchestrator.cases.networks.source_changes import Remark
from orchestrator.cases.networks.sources import SourceTables

_SMALL_LOSS = 10.0  # MW that a fixed shunt may draw unasked
# of a switched shunt: columns of STAT, MODSW and BINIT up to revision 31, up to 34, and after
_SWITCHED: tuple[tuple[int | None, int, int], ...] = ((None, 1, 7), (3, 1, 9), (4, 2, 11))


def read_loads(net: RawTables) -> None:
    for record in net.raw.of("load"):
        if not is_in_service(record, 2, "STATUS"):
            continue
        bus = net.bus(record)
        net.refuse_second(record, "load", net.own_bus(record), record.text(1, "1").strip())
        names = ("PL", "QL", "IP", "IQ", "YP", "YQ")
        pl, ql, ip, iq, yp, yq = (record.number(5 + k, name, 0.0) for k, name in enumerate(names))
        v = net.magnitudes[bus]
        current, admittance = complex(ip, iq) * v, complex(yp, yq)
        if current and not net.keep_load_parts:
            text = "load of constant current: a constant impedance that draws the same at the file's voltage"
            net.changes.note(record.line, text)
        own = 0j
        if net.raw.revision >= 34 and record.whole(16, "DGENM", 0) == 1:  # 34 calls it DGENF
            own = complex(record.number(14, "DGENP", 0.0), record.number(15, "DGENQ", 0.0))
            if own:
                net.changes.note(record.line, "distributed generation: taken away from its load")
        power, parts = complex(pl, ql) + current - own, (0j, 0j)
        if net.keep_load_parts:
            # YQ is positive where it generates, as with shunts
            parts = (admittance.conjugate() * v**2, current)
            power += parts[0]
        else:
            net.add(bus, 4, admittance)
        net.add(bus, 2, power)
        net.at_buses.setdefault(bus, BusLoads()).add(power, parts)
        one = FileLoad(
            f"load_{net.labels[bus]}",
            net.own_bus(record),
            name=record.text(1, "1").strip(),
            area=net.group(record, 3, "AREA"),
            zone=net.group(record, 4, "ZONE"),
            owner=net.group(record, 11, "OWNER"),
            p_mw=pl + current.real + admittance.real * v**2,
            q_mvar=ql + current.imag - admittance.imag * v**2,
            drawn=power,
            v_pu=v,
        )
        net.file_loads.append((one, bus, power.real < 0))


def named_loads(net: RawTables, tables: SourceTables) -> Iterator[FileLoad]:
    """Give the loads by the names of the elements of which they are a part."""
    for load, bus, feeds in net.file_loads:
        apart = feeds and bus in tables.feeding
        yield replace(load, load=f"static_{tables.labels[bus]}") if apart else load


@dataclass(frozen=True, slots=True)
class SwitchedShunt:
    """A switched shunt in service: its bus, the identifier of its model's records, BINIT, and its ends [Mvar at 1 pu].

    ``mode``: MODSW; 0 where it is held."""

    record: Record
    bus: int
    name: str
    mode: int
    initial: float
    least: float
    most: float


def switched_shunts(net: RawTables) -> Iterator[SwitchedShunt]:
    status, mode, initial = _SWITCHED[sum(net.raw.revision >= first for first in (32, 35))]
    has_identifier = net.raw.revision >= NODES
    for record in net.raw.of("switched shunt"):
        if not is_in_service(record, status, "STAT"):
            continue
        identifier = record.text(1, ONLY_SHUNT).strip() if has_identifier else ONLY_SHUNT
        blocks = shunt_blocks(record, initial + 1, with_status=has_identifier)
        yield SwitchedShunt(
            record,
            net.bus(record),
            shunt_name(identifier),
            mode=record.whole(mode, "MODSW", 1),
            initial=record.number(initial, "BINIT", 0.0),
            least=sum(x for x in blocks if x < 0),
            most=sum(x for x in blocks if x > 0),
        )


def read_shunts(net: RawTables, modelled: Collection[tuple[int, str]] = ()) -> None:
    """Add all shunts to their buses, but switched ones that are units with a model.

    ``modelled``: bus and identifier of such models' records."""
    for record in net.raw.of("fixed shunt"):
        if is_in_service(record, 2, "STATUS"):
            bus = net.bus(record)
            drawn = complex(record.number(3, "GL", 0.0), record.number(4, "BL", 0.0))
            if drawn.real > max(_SMALL_LOSS, abs(drawn.imag)):
                text = f"shunt that draws GL = {drawn.real:g} MW: is it BL, in Mvar?"
                net.changes.note(record.line, Remark(text, "a shunt that draws active power"))
            net.add(bus, 4, drawn)
    for shunt in switched_shunts(net):
        place = net.own_bus(shunt.record)
        if (place, shunt.name) in modelled:
            continue
        if shunt.mode:
            net.changes.note(shunt.record.line, "switched shunt: held at BINIT")
        net.add(shunt.bus, 4, complex(0.0, shunt.initial))
        control = shunt_record(shunt.record, net.raw.revision, place)
        if control is None:
            continue
        seen = net.standing(control.bus)
        if seen is None:
            text = (
                f"switched shunt that holds the voltage of bus {control.bus} (SWREM), which the file has not, or has "
                "out of service: it never steps; correct SWREM, or write 0 for its own bus"
            )
            kind = "a switched shunt that holds a bus that is not there"
            net.changes.note(shunt.record.line, Remark(text, kind))
            continue
        net.stepping.append(control.at(shunt.bus, seen))
