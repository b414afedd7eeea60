"""A PSS/E RAW file of revision 29 to 36 as tables of a network source."""

import math
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

from fmus.grid.element_data import SMALLEST_REACTANCE
from fmus.toolchain.port_variables import SYSTEM_BASE_MVA
from orchestrator.cases.form.remedies import with_slack
from orchestrator.cases.networks.bus_loads import BusLoads
from orchestrator.cases.networks.element_names import BranchName
from orchestrator.cases.networks.psse.controls import ShuntRecord, TapRecord, shunt_record
from orchestrator.cases.networks.psse.device_records import (
    FoundDevices,
    Places,
    read_devices,
    series_impedances,
)
from orchestrator.cases.networks.psse.devices import HeldDevice
from orchestrator.cases.networks.psse.impedance_corrections import correction_tables
from orchestrator.cases.networks.psse.missing_buses import with_known_buses
from orchestrator.cases.networks.psse.raw_accounts import record_uses
from orchestrator.cases.networks.psse.raw_file import read_file
from orchestrator.cases.networks.psse.records import (
    NODES,
    SWITCHING_DEVICES,
    RawFile,
    Record,
    leave_out,
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
from orchestrator.cases.networks.psse.transformers import Transformer, star, transformers
from orchestrator.cases.networks.psse.zero_impedances import is_joining, merged_buses, threshold
from orchestrator.cases.networks.record_use import RecordUse
from orchestrator.cases.networks.source_changes import Changes
from orchestrator.cases.networks.sources import SourceTables
from orchestrator.core.errors import InputError, Problem

_BUS_COLUMNS, _BRANCH_COLUMNS, _GEN_COLUMNS = 13, 11, 10
_VM, _VA = 7, 8  # columns of the table of buses
_BAND = slice(11, 13)  # columns of the most and the least voltage there; 0 where the file has none
_ORDINARY, _REFERENCE, _OUT = 1, 3, 4  # codes IDE of a bus
_DRAWN = slice(2, 6)  # columns of the table of buses: powers of loads and shunts
_STATE = 10  # column of the table of branches: 0 if out of service
_POWER_FACTOR = 0.9  # with which a power tells a rating that is not known
_NO_LIMIT = 9999.0  # MW or Mvar by which PSS/E says that a generator has no limit
_APART = 0.01  # voltage of a file beside what a generator within its limits is to hold [pu]
_CLOSE = 1e-4  # the same if the file's solution fits the generator's QG [pu]
_AT_LIMIT = 0.1  # Mvar by which a rounded QG may miss a limit
_MOST_VOLTAGE = 2.0
_SBASE = 100.0  # usual base [MVA]
_FAR = 20.0
"""Times the middle one of all reactances of lines from which one is questioned, where its ohms would be usual."""

_SMALL_LOSS = 10.0  # MW that a fixed shunt may draw unasked
# step of shifts in radians, and how near a number is to be one of them
_RADIANS, _NEAR = math.pi / 6, 0.01
# of a switched shunt: columns of STAT, MODSW and BINIT up to revision 31, up to 34, and after
_SWITCHED: tuple[tuple[int | None, int, int], ...] = ((None, 1, 7), (3, 1, 9), (4, 2, 11))
_SWITCH_STATE = 16  # column of STAT of a switching device
_NO_LETTER = re.compile(r"\W")
_SAME_VOLTAGE = 0.1  # part by which the nominal voltages at a line's ends may differ


@dataclass(frozen=True, slots=True)
class Machine:
    bus: int
    name: str
    line: int
    # p_mw, v_pu: active power [MW], and voltage that it holds at its bus [pu]
    p_mw: float
    v_pu: float
    rating_mva: float  # MBASE [MVA]
    source: complex  # ZSORCE [pu of the rating]
    # q_min_mvar, q_max_mvar, p_min_mw, p_max_mw: limits of reactive and of active power; infinite where the file has
    # none
    q_min_mvar: float
    q_max_mvar: float
    p_min_mw: float = -math.inf
    p_max_mw: float = math.inf
    q_mvar: float = 0.0
    # whether the file has no such machine, and an infinite bus has to feed what is left at its reference
    is_infinite: bool = False

    @property
    def likely_mva(self) -> float:
        """MBASE, or what the machine must be able to feed, by PT or by PG and QG, if that is more [MVA].

        MBASE is the base of the machine's data; PSS/E warns of a power above it."""
        fed = abs(complex(self.p_mw, self.q_mvar))
        if fed <= self.rating_mva:
            return self.rating_mva
        most = self.p_max_mw if math.isfinite(self.p_max_mw) else 0.0
        return max(fed, most) / _POWER_FACTOR


def unit_labels(machines: Iterable[Machine]) -> dict[tuple[int, str], str]:
    """Return labels of the machines' units by bus and identifier: the bus, with the identifier where it has several."""
    keys = [(machine.bus, machine.name.strip()) for machine in machines]
    at_bus = Counter(bus for bus, _ in keys)
    return {
        (bus, name): str(bus) if at_bus[bus] == 1 else f"{bus}_{_NO_LETTER.sub('_', name)}"
        for bus, name in keys
    }


def bus_of_unit(name: str, machines: Iterable[Machine]) -> str:
    """Return the bus of a unit or a bus that a case names, ``sg9_1`` or ``bus_9``; the name itself if it is no unit."""
    machines = tuple(machines)
    units = {f"sg{label}": bus for (bus, _), label in unit_labels(machines).items()}
    units |= {f"sg{machine.bus}": machine.bus for machine in machines}
    return f"bus_{units[name]}" if name in units else name


@dataclass(frozen=True)
class FileLoad:
    """One load in service [MW, Mvar], by what a record of dynamics data may name it.

    ``load``: name of the case's load, which all loads of a bus are together that draw, or that feed."""

    load: str
    bus: int
    name: str
    area: int
    zone: int
    owner: int
    p_mw: float
    q_mvar: float


@dataclass(frozen=True)
class RawNetwork:
    """A file's tables, its machines in service, and what was taken over in another form.

    ``idle`` has bus and identifier of the machines that are out of service; ``devices`` what feeds or draws by
    controls of its own, such as DC lines."""

    tables: SourceTables
    machines: tuple[Machine, ...]
    changes: tuple[Problem, ...]
    idle: frozenset[tuple[int, str]] = frozenset()
    records: tuple[RecordUse, ...] = ()
    devices: tuple[HeldDevice, ...] = ()
    loads: tuple[FileLoad, ...] = ()
    # what holds a voltage step by step: ratios by the row of their branch, and switched shunts
    taps: Mapping[int, TapRecord] = field(default_factory=dict)
    shunts: tuple[ShuntRecord, ...] = ()


def read_raw(
    path: Path,
    leaving_out: Sequence[str] = (),
    *,
    keep_load_parts: bool = False,
    slack: str | None = None,
) -> RawNetwork:
    """Read a file.

    ``slack``: the unit or bus that a case names as the reference: nothing then stands at the file's own one where no
    machine is in service."""
    raw = read_file(path)
    return _Reading(raw, Changes(raw.place), keep_load_parts).network(leaving_out, slack)


class _Reading:
    def __init__(self, raw: RawFile, changes: Changes, keep_load_parts: bool) -> None:
        self._file, self._changes, self._keep_load_parts = raw, changes, keep_load_parts
        known = with_known_buses(raw)
        self._raw, self._dropped = known.raw, known.dropped
        self._rows: dict[int, list[float]] = {}
        self._kilovolts: dict[int, float] = {}
        self._magnitudes: dict[int, float] = {}
        self._branches: list[list[float]] = []
        self._to_earth: list[tuple[complex, complex]] = []
        self._names: list[BranchName] = []
        self._labels: dict[int, str] = {}
        self._titles: dict[int, str] = {}
        # line of the record, X, and kV of each branch
        self._ohms: list[tuple[int, float, float]] = []
        self._idle: set[tuple[int, str]] = set()
        self._lines_of: dict[tuple[Any, ...], int] = {}
        # line of the first record and its first bus by the buses and the identifier of lines
        self._circuits: dict[tuple[frozenset[int], str], tuple[int, int]] = {}
        self._at_buses: dict[int, BusLoads] = {}
        self._devices = FoundDevices((), {})
        # with the bus at which it stands, and whether it feeds
        self._file_loads: list[tuple[FileLoad, int, bool]] = []
        self._same: dict[int, int] = {}  # bus that PSS/E takes as one with another → the other
        # lines of the records that make them one, and of those that would if both had no machine
        self._merged: set[int] = set()
        self._lossless: set[int] = set()
        # what holds a voltage step by step: ratios by the branch's place, and shunts
        self._taps: dict[int, TapRecord] = {}
        self._stepping: list[ShuntRecord] = []
        self._corrections = correction_tables(raw)
        # least reactance that our network can have [pu of the system]
        self._least = 1.1 * SMALLEST_REACTANCE * raw.base_mva / SYSTEM_BASE_MVA

    def network(self, leaving_out: Sequence[str], slack: str | None = None) -> RawNetwork:
        for line, section in self._raw.guessed.items():
            text = f"does not say which data begin, as other lines do: taken as {section} data, which are next in order"
            self._changes.note(line, text)
        for line, text in self._raw.remarks:
            self._changes.note(line, text)
        leave_out(self._raw, leaving_out, self._changes)
        for line, text in self._dropped.items():
            self._changes.note(line, text)
        self._buses()
        self._merge()
        self._loads()
        self._shunts()
        self._lines()
        self._transformers()
        self._read_devices(leaving_out)
        machines = self._machines()
        machines = (*machines, *self._infinite_buses(machines, slack))
        self._leave_out_bare_buses(machines)
        gen = np.zeros((len(machines), _GEN_COLUMNS))
        for row, m in zip(gen, machines, strict=True):
            row[[0, 1, 3, 4, 5, 7, 8]] = (
                m.bus,
                m.p_mw,
                m.q_max_mvar,
                m.q_min_mvar,
                m.v_pu,
                1,
                m.rating_mva,
            )
        at_buses = {bus: x.apart() for bus, x in self._at_buses.items()}
        tables = SourceTables(
            self._raw.place,
            self._raw.base_mva,
            np.array(list(self._rows.values())).reshape(-1, _BUS_COLUMNS),
            np.array(self._branches).reshape(-1, _BRANCH_COLUMNS),
            gen,
            np.array(self._to_earth, dtype=complex).reshape(-1, 2),
            self._labels,
            self._raw.frequency,
            {bus: x.drawing.parts for bus, x in at_buses.items() if any(x.drawing.parts)},
            self._titles,
            {bus: x.feeding for bus, x in at_buses.items() if x.feeding.power},
            tuple(self._names),
        )
        records = record_uses(
            self._file, self._merged, leaving_out, self._devices.unused, self._dropped
        )
        return RawNetwork(
            tables,
            machines,
            tuple(self._changes.listed()),
            frozenset(self._idle),
            records=records,
            devices=self._devices.devices,
            loads=tuple(self._named_loads(tables)),
            taps=self._taps,
            shunts=tuple(self._stepping),
        )

    def _bus(self, record: Record, index: int = 0) -> int:
        bus = abs(record.whole(index, "the bus' number"))
        bus = self._same.get(bus, bus)
        if bus not in self._rows:
            raise record.error(f"there is no bus {bus}")
        return bus

    def _group(self, record: Record, index: int, name: str) -> int:
        """Return the area, zone or owner that a record names; a word in its place is asked about."""
        try:
            return record.whole(index, name, 1)
        except InputError:
            text = f"{name} is {record.text(index)!r}, which is no number: 1 is taken, and it has no effect on the flow"
            self._changes.note(record.line, text)
            return 1

    def _own(self, record: Record, index: int = 0) -> int:
        """The bus that a record names, also if it is one with another."""
        return abs(record.whole(index, "the bus' number"))

    @property
    def _ends(self) -> int:
        """Column of GI in the records of branches."""
        return 9 if self._raw.revision < SWITCHING_DEVICES else 19

    def _once(self, record: Record, what: str, *key: Any) -> None:
        """Refuse a second element of the same name, which PSS/E would put in the first one's place."""
        first = self._lines_of.setdefault((what, *key), record.line)
        if first != record.line:
            shown = " ".join(
                str(sorted(part)) if isinstance(part, frozenset) else str(part) for part in key
            )
            raise record.error(
                f"the {what} {shown} stands in line {first} as well; remove one of them, or rename it"
            )

    def _circuit(self, record: Record, pair: frozenset[int]) -> str:
        """Return a line's identifier, or another one where a line before has the same, from the same end."""
        own, start = record.text(2, "1").strip(), self._own(record)
        first, its = self._circuits.setdefault((pair, own), (record.line, start))
        if first == record.line or its != start:
            self._once(record, "branch", pair, own)
            return own
        given = {
            other.text(2, "1").strip()
            for other in self._raw.of("branch")
            if {self._own(other), self._own(other, 1)} == pair
        }
        free = next(
            name
            for name in map(str, count(2))
            if name not in given and (pair, name) not in self._circuits
        )
        self._circuits[pair, free] = (record.line, start)
        text = (
            f"the branch {sorted(pair)} {own} stands in line {first} as well: a parallel circuit, {free}, is taken. "
            "PSS/E keeps one of both; if one is meant, remove the other"
        )
        self._changes.note(record.line, text)
        return free

    def _add(self, bus: int, column: int, value: complex) -> None:
        """Add to the active and the reactive part [MW, Mvar], which stand side by side."""
        self._rows[bus][column] += value.real
        self._rows[bus][column + 1] += value.imag

    def _buses(self) -> None:
        for record in self._raw.of("bus"):
            number, kind = record.whole(0, "the bus' number"), record.whole(3, "IDE", 1)
            if number <= 0:
                raise record.error(f"the bus' number is {number}; numbers exceed 0")
            self._once(record, "bus", number)
            if kind not in (1, 2, 3, 4):
                raise record.error(f"IDE is {kind}; known are 1 to 4")
            if kind == _REFERENCE and any(row[1] == _REFERENCE for row in self._rows.values()):
                self._changes.note(
                    record.line, "second reference bus (IDE = 3): it holds its voltage and feeds PG"
                )
            self._rows[number] = [number, kind, *[0.0] * (_BUS_COLUMNS - 2)]
            self._kilovolts[number] = record.number(2, "BASKV", 0.0)
            self._magnitudes[number] = record.number(7, "VM", 1.0)
            self._rows[number][_VM : _VA + 1] = (
                self._magnitudes[number],
                record.number(8, "VA [degrees]", 0.0),
            )
            self._rows[number][_BAND] = (
                record.number(9, "NVHI", 0.0),
                record.number(10, "NVLO", 0.0),
            )
            if kind != 4 and not 0 < self._magnitudes[number] <= _MOST_VOLTAGE:
                raise record.error(
                    f"VM is {self._magnitudes[number]:g} pu; it must exceed 0 and be at most {_MOST_VOLTAGE:g} (no kV, "
                    "no percent): export the solved case, or give 1"
                )
            self._labels[number] = str(number)
            self._titles[number] = record.text(1).strip()

    def _merge(self) -> None:
        """Make one bus of those that a line without impedance joins."""
        least = threshold(self._raw)
        zero = [
            *(
                record
                for record in self._raw.of("branch")
                if is_joining(record, least) and record.whole(self._ends + 4, "ST", 1)
            ),
            *(
                record
                for record in self._raw.of("system switching device")
                if _reactance_of_switch(record) <= least and record.whole(_SWITCH_STATE, "STAT", 1)
            ),
        ]
        joins = [
            (record, start, end)
            for record in zero
            for start, end in [(self._own(record), self._own(record, 1))]
            if all(bus in self._rows and self._rows[bus][1] != _OUT for bus in (start, end))
        ]
        status = 14 if self._raw.revision < NODES else 15
        held = {
            record.whole(0, "the bus' number")
            for record in self._raw.of("generator")
            if record.whole(status, "STAT", 1)
        }
        kinds = {bus: int(row[1]) for bus, row in self._rows.items()}
        self._same, gone, kept = merged_buses(joins, kinds, held)
        for bus, standing in self._same.items():
            self._rows.pop(bus)
            self._changes.note(
                f"bus {bus} into {standing}",
                f"zero impedance lines (X up to THRSHZ = {least:g} pu): the buses are one, as in PSS/E",
            )
        self._merged = {record.line for record in gone}
        lines = {record.line for record in self._raw.of("branch")}
        for record in (record for record in gone if record.line in lines):
            self._add(self._bus(record), 4, self._line_to_earth(record) * self._raw.base_mva)
            resistance = record.number(3, "R", 0.0)
            if abs(resistance) > least:
                text = f"zero impedance line: its R of {resistance:g} pu has no effect, as in PSS/E"
                self._changes.note(record.line, text)
        self._lossless = {record.line for record in kept}
        for record in kept:
            text = "zero impedance line between two buses with machines: a branch of the least reactance"
            self._changes.note(record.line, text)

    def _line_to_earth(self, record: Record) -> complex:
        """Return all admittances to earth of a line: its charging, and its shunts at both ends [pu of the system]."""
        gi, bi, gj, bj = (
            record.number(self._ends + k, n, 0.0) for k, n in enumerate(("GI", "BI", "GJ", "BJ"))
        )
        return complex(gi + gj, record.number(5, "B", 0.0) + bi + bj)

    def _in_service(self, record: Record, status: int | None, name: str) -> bool:
        """Return whether an element counts; one out of service may point to a bus that is not there, as in PSS/E."""
        return status is None or bool(record.whole(status, name, 1))

    def _loads(self) -> None:
        for record in self._raw.of("load"):
            if not self._in_service(record, 2, "STATUS"):
                continue
            bus = self._bus(record)
            self._once(record, "load", self._own(record), record.text(1, "1").strip())
            names = ("PL", "QL", "IP", "IQ", "YP", "YQ")
            pl, ql, ip, iq, yp, yq = (
                record.number(5 + k, name, 0.0) for k, name in enumerate(names)
            )
            v = self._magnitudes[bus]
            current, admittance = complex(ip, iq) * v, complex(yp, yq)
            if current and not self._keep_load_parts:
                text = "load of constant current: a constant impedance that draws the same at the file's voltage"
                self._changes.note(record.line, text)
            own = 0j
            if self._raw.revision >= 34 and record.whole(16, "DGENM", 0) == 1:  # 34 calls it DGENF
                own = complex(record.number(14, "DGENP", 0.0), record.number(15, "DGENQ", 0.0))
                if own:
                    self._changes.note(
                        record.line, "distributed generation: taken away from its load"
                    )
            power, parts = complex(pl, ql) + current - own, (0j, 0j)
            if self._keep_load_parts:
                # YQ is positive where it generates, as with shunts
                parts = (admittance.conjugate() * v**2, current)
                power += parts[0]
            else:
                self._add(bus, 4, admittance)
            self._add(bus, 2, power)
            self._at_buses.setdefault(bus, BusLoads()).add(power, parts)
            one = FileLoad(
                f"load_{self._labels[bus]}",
                self._own(record),
                record.text(1, "1").strip(),
                self._group(record, 3, "AREA"),
                self._group(record, 4, "ZONE"),
                self._group(record, 11, "OWNER"),
                pl + current.real + admittance.real * v**2,
                ql + current.imag - admittance.imag * v**2,
            )
            self._file_loads.append((one, bus, power.real < 0))

    def _named_loads(self, tables: SourceTables) -> Iterator[FileLoad]:
        """Give the loads by the names of the elements of which they are a part."""
        for load, bus, feeds in self._file_loads:
            apart = feeds and bus in tables.feeding
            yield replace(load, load=f"static_{tables.labels[bus]}") if apart else load

    def _shunts(self) -> None:
        for record in self._raw.of("fixed shunt"):
            if self._in_service(record, 2, "STATUS"):
                bus = self._bus(record)
                drawn = complex(record.number(3, "GL", 0.0), record.number(4, "BL", 0.0))
                if drawn.real > max(_SMALL_LOSS, abs(drawn.imag)):
                    self._changes.note(
                        record.line, f"shunt that draws GL = {drawn.real:g} MW: is it BL, in Mvar?"
                    )
                self._add(bus, 4, drawn)
        status, mode, initial = _SWITCHED[sum(self._raw.revision >= first for first in (32, 35))]
        for record in self._raw.of("switched shunt"):
            if not self._in_service(record, status, "STAT"):
                continue
            bus = self._bus(record)
            if record.whole(mode, "MODSW", 1):
                self._changes.note(record.line, "switched shunt: held at BINIT")
            self._add(bus, 4, complex(0.0, record.number(initial, "BINIT", 0.0)))
            control = shunt_record(record, self._raw.revision, self._own(record))
            seen = self._standing(control.bus) if control else None
            if control and seen is not None:
                self._stepping.append(control.at(bus, seen))

    def _lines(self) -> None:
        ends = self._ends
        for record in self._raw.of("branch"):
            if record.line in self._merged or not self._in_service(record, ends + 4, "ST"):
                continue
            start, end = self._bus(record), self._bus(record, 1)
            pair = frozenset((self._own(record), self._own(record, 1)))
            if len(pair) == 1:
                text = "a line from a bus to itself: not used, as the file's own solution has it"
                self._changes.note(record.line, text)
                continue
            circuit = self._circuit(record, pair)
            z = complex(record.number(3, "R", 0.0), record.number(4, "X"))
            z = 1j * self._least if record.line in self._lossless else z
            charging = 0.5j * record.number(5, "B", 0.0)
            gi, bi, gj, bj = (
                record.number(ends + k, n, 0.0) for k, n in enumerate(("GI", "BI", "GJ", "BJ"))
            )
            state = record.whole(ends + 4, "ST", 1)
            one, other = self._kilovolts[start], self._kilovolts[end]
            if state and one and other and abs(one - other) > _SAME_VOLTAGE * max(one, other):
                text = f"line between buses of BASKV = {one:g} and {other:g} kV: is one wrong, or a transformer meant?"
                self._changes.note(record.line, text)
            self._ohms.append((record.line, z.imag, one))
            to_earth = (charging + complex(gi, bi), charging + complex(gj, bj))
            # a name stands before the ratings from revision 34 on
            column = 6 if self._raw.revision < SWITCHING_DEVICES else 7
            rating = record.number(column, "RATEA [MVA]", 0.0)
            name = BranchName(record.text(6, "").strip() if column == 7 else "", circuit)
            self._branch(start, end, z, state, to_earth, rating=rating, name=name)
        for record in self._raw.of("system switching device"):
            if record.line in self._merged or not self._in_service(record, _SWITCH_STATE, "STAT"):
                continue
            start, end = self._bus(record), self._bus(record, 1)
            self._changes.note(record.line, "switching device: a branch of its reactance")
            self._branch(start, end, complex(0.0, _reactance_of_switch(record)), 1)
        if self._raw.base_mva != _SBASE:
            text = f"SBASE is {self._raw.base_mva:g} MVA, on which all impedances count; nearly all files have"
            self._changes.note(1, f"{text} {_SBASE:g} MVA: is it meant?")
        usual = sorted(abs(x) for _, x, _ in self._ohms)
        for line, x, kilovolts in self._ohms:
            middle, ohms = (
                usual[len(usual) // 2],
                x * self._raw.base_mva / kilovolts**2 if kilovolts else 0.0,
            )
            if x > _FAR * middle and middle / _FAR < ohms < _FAR * middle:
                text = f"X is {x:g} pu, {x / middle:.3g} times the middle one of all lines; is it in ohms? On "
                self._changes.note(line, f"{text}{kilovolts:g} kV these are {ohms:.3g} pu")

    def _branch(
        self,
        start: int,
        end: int,
        z: complex,
        state: int,
        to_earth: tuple[complex, complex] = (0j, 0j),
        tap: float = 0.0,
        shift: float = 0.0,
        rating: float = 0.0,
        name: BranchName = BranchName(),  # noqa: B008 - frozen
    ) -> None:
        if abs(z.imag) < self._least:
            text = f"reactance of almost 0: taken as {self._least:.2g} pu, the least that the network can have"
            self._changes.note(f"{start}-{end}", text)
            z = complex(z.real, self._least)
        if start == end:
            self._within_bus(start, z, to_earth, tap or 1.0, shift)
            return
        self._branches.append(
            [start, end, z.real, z.imag, 0.0, rating, 0.0, 0.0, tap, shift, float(state != 0)]
        )
        self._to_earth.append(to_earth)
        self._names.append(name)

    def _within_bus(
        self, bus: int, z: complex, to_earth: tuple[complex, complex], tap: float, shift: float
    ) -> None:
        """Add a branch whose ends are one bus, because zero impedance lines join them: it is an admittance to earth."""
        text = "both ends are one bus by zero impedance lines: an admittance to earth, by its charging and ratio"
        self._changes.note(f"{bus}-{bus}", text)
        through = 2 * math.cos(math.radians(shift)) / tap
        drawn = (1 / z + to_earth[0]) / tap**2 + 1 / z + to_earth[1] - through / z
        self._add(bus, 4, drawn * self._raw.base_mva)

    def _transformers(self) -> None:
        for t in transformers(self._raw, self._kilovolts):
            moved = tuple(replace(w, bus=self._same.get(w.bus, w.bus)) for w in t.windings)
            self._transformer(replace(t, windings=moved))

    def _transformer(self, t: Transformer) -> None:
        windings, name = t.windings, BranchName(t.name, t.circuit.strip())
        if t.controlled:
            self._changes.note(
                t.record.line, "tap changer or phase-shift control: held at its position"
            )
        if not all(w.has_ratio for w in windings):
            text = "WINDV is 0, which MATPOWER writes where a ratio is not given: the nominal ratio is taken"
            self._changes.note(t.record.line, text)
        for turned in (w.shift / _RADIANS for w in windings if 0 < abs(w.shift) < 2 * math.pi):
            if abs(turned - round(turned)) < _NEAR * abs(turned):
                text = f"ANG is {turned * _RADIANS:g} degrees: is it in radians? {round(turned) * 30} degrees are usual"
                self._changes.note(t.record.line, text)
        if t.small_loss:
            text = "R below 1 is a load loss in W by CZ = 3, as good as none: is it in pu, so that CZ = 2 is right?"
            self._changes.note(t.record.line, text)
        if t.large_resistance:
            text = "R is more than 1000 times X: is it a load loss in W, so that CZ = 3 is right?"
            self._changes.note(t.record.line, text)
        if t.off == (0, 1, 2):
            return
        factors = self._corrections_of(t)
        if 0 not in t.off:
            self._add(windings[0].bus, 4, t.magnetisation * self._raw.base_mva)
        if len(windings) == 2:
            first, second = windings
            self._branch(
                first.bus,
                second.bus,
                t.impedances[0] * second.ratio**2 * factors[0],
                1,
                tap=first.ratio / second.ratio,
                shift=first.shift - second.shift,
                rating=first.rating_mva,
                name=name,
            )
            seen = self._standing(t.tap.bus) if t.tap else None
            if t.tap and seen is not None and first.bus != second.bus:
                self._taps[len(self._branches) - 1] = replace(t.tap, bus=seen)
            return
        inner = max(self._rows) + 1
        self._rows[inner] = [inner, 1, *[0.0] * (_BUS_COLUMNS - 2)]
        self._labels[inner] = "_".join(
            map(str, (*(w.bus for w in windings), t.circuit.strip() or "1", "star"))
        )
        self._titles[inner] = f"{t.name} star" if t.name else ""
        for k, (winding, z) in enumerate(zip(windings, star(t.impedances), strict=True)):
            self._branch(
                winding.bus,
                inner,
                z * factors[k],
                k not in t.off,
                tap=winding.ratio,
                shift=winding.shift,
                rating=winding.rating_mva,
                name=name,
            )

    def _corrections_of(self, t: Transformer) -> tuple[complex, ...]:
        """Return the factor of each winding's impedance by its correction table; 1 where it has none."""
        if t.corrects_pairs and any(winding.table for winding in t.windings):
            text = "impedance correction tables of the impedances between windings (ZCOD = 1): not applied"
            self._changes.note(t.record.line, text)
            return (1.0 + 0j,) * len(t.windings)
        for number in dict.fromkeys(w.table for w in t.windings if w.table):
            if number not in self._corrections:
                text = f"TAB is {number}, and the file has no such impedance correction table: not corrected"
                self._changes.note(t.record.line, text)
        return tuple(
            self._corrections[w.table].factor(w.ratio, w.shift)
            if w.table in self._corrections
            else 1.0 + 0j
            for w in t.windings
        )

    def _read_devices(self, leaving_out: Sequence[str]) -> None:
        """Read DC lines, FACTS devices and the like; series parts of FACTS devices may be branches."""
        places = Places(self._standing, self._kilovolts)
        self._devices = read_devices(self._raw, leaving_out, places)
        for line, text in self._devices.remarks:
            self._changes.note(line, text)
        for record, z in series_impedances(self._raw, leaving_out):
            start, end = (self._standing(self._own(record, k)) for k in (1, 2))
            if start is not None and end is not None and start != end:
                self._branch(start, end, z, 1)

    def _standing(self, bus: int) -> int | None:
        """Return the bus that stands for one of the file; None if it is not there, or out of service."""
        standing = self._same.get(bus, bus)
        return standing if standing in self._rows and not self._is_out(standing) else None

    def _fed_by_devices(self) -> dict[int, float]:
        """Return the reactive power that devices feed at the file's voltages, by bus [Mvar]."""
        voltages = stated_voltages(list(self._rows.values()))
        fed: dict[int, float] = {}
        for device in self._devices.devices:
            for ending in device.endings(voltages):
                fed[ending.bus] = fed.get(ending.bus, 0.0) + ending.fed.imag
        return fed

    def _solved_buses(self, status: int) -> SolvedBuses:
        """Return the buses at which the file's voltages fit the machines' reactive power; none if it is not solved.

        ``status``: column of STAT in the records of machines."""
        needed = reactive_needs(self._rows, self._branches, self._to_earth, self._raw.base_mva)
        fed = self._fed_by_devices() if needed else {}
        fed = {bus: q for bus, q in fed.items() if bus in needed}
        found: dict[int, list[HeldPower]] = {}
        for record in self._raw.of("generator"):
            bus = self._same.get(self._own(record), self._own(record))
            if record.whole(status, "STAT", 1) and bus in needed:
                least, most = _limits(record, "QB", 5, "QT", 4, "Mvar")
                above = self._magnitudes[bus] - record.number(6, "VS", 1.0)
                power = HeldPower(record.number(3, "QG", 0.0), least, most, above)
                found.setdefault(bus, []).append(power)
        return sort_buses(needed, fed, found)

    def _setpoint(
        self, record: Record, bus: int, limits: tuple[float, float], solved: SolvedBuses
    ) -> float:
        """Return the voltage that a machine is to hold [pu]: VS, or VM if the file's solution fits there."""
        least, most = limits
        fed, VM = record.number(3, "QG", 0.0), self._magnitudes[bus]
        held = record.number(6, "VS", 1.0)
        is_within = least + _AT_LIMIT < fed < most - _AT_LIMIT and bus not in solved.at_limit
        if bus in solved.all and abs(held - VM) > _CLOSE:
            text = "VS is not VM of the file's solution, as QG is at a limit"
            if bus in solved.at_limit:
                text = "VS is not VM of the file's solution, whose voltages need QB or QT there, and not QG"
            if is_within:
                text = f"VS is {held:g} pu, where the solved file has VM = {VM:g} pu, with Q within its limits"
            text += (
                ": it holds VM, from which PSS/E starts as well, where ANDES holds VS; the unit's v_0 (in "
                "[components.sg….parameters], also as --set sg….v_0=VS) changes it"
            )
            self._changes.note(record.line, text)
            return VM
        if bus not in solved.all and VM != 1 and abs(held - VM) > _APART and least < fed < most:
            text = f"VS is {held:g} pu, where the solved file has VM = {VM:g} pu, with Q within its limits: VS is held"
            self._changes.note(record.line, text)
        return held

    def _is_out(self, bus: int) -> bool:
        return bus in self._rows and self._rows[bus][1] == _OUT

    def _machines(self) -> tuple[Machine, ...]:
        mbase, status = (8, 14) if self._raw.revision < 35 else (9, 15)
        machines, solved = [], self._solved_buses(status)
        for record in self._raw.of("generator"):
            own = self._own(record)
            if not self._in_service(record, status, "STAT") or self._is_out(own):
                self._idle.add((own, record.text(1, "1").strip()))
                continue
            bus = self._bus(record)
            self._once(record, "machine", own, record.text(1, "1").strip())
            rating = record.number(mbase, "MBASE [MVA]", self._raw.base_mva)
            if not rating > 0:
                raise record.error(f"MBASE is {rating:g} MVA; it must exceed 0")
            least, most = _limits(record, "QB", 5, "QT", 4, "Mvar")
            remote = record.whole(7, "IREG", 0)
            if remote not in (0, bus):
                held = self._magnitudes[bus]
                self._changes.note(
                    record.line,
                    "voltage control of another bus: its own is held at the file's voltage",
                )
            elif self._rows[bus][1] == 1:
                held = self._magnitudes[bus]
                self._changes.note(
                    record.line, "generator at a bus of type 1: it holds the file's voltage"
                )
            else:
                held = self._setpoint(record, bus, (least, most), solved)
            if record.number(mbase + 4, "XT", 0.0):
                self._changes.note(
                    record.line, "step-up transformer within a generator's record: left out"
                )
            source = complex(
                record.number(mbase + 1, "ZR", 0.0), record.number(mbase + 2, "ZX", 1.0)
            )
            p_least, p_most = _limits(record, "PB", status + 3, "PT", status + 2, "MW")
            feeds = record.number(2, "PG", 0.0)
            if not p_least <= feeds <= p_most and feeds <= rating:  # else the rating is asked about
                text = f"PG is {feeds:g} MW, beyond the machine's limits, PB = {p_least:g} and PT = {p_most:g} MW"
                self._changes.note(
                    record.line, f"{text}: it feeds PG, and takes no part of an outage beyond"
                )
            machines.append(
                Machine(
                    bus,
                    record.text(1, "1"),
                    record.line,
                    feeds,
                    held,
                    rating,
                    source,
                    least,
                    most,
                    p_least,
                    p_most,
                    record.number(3, "QG", 0.0),
                )
            )
            if machines[-1].likely_mva > rating:
                self._changes.note(
                    record.line,
                    "PG or QG exceeds MBASE, which is the base of the machine's data and need not be its rating: "
                    "a DYR file's data stay on MBASE; without one, typical data are taken on PT, or on PG and QG, "
                    f"with a power factor of {_POWER_FACTOR:g}. Is the rating such, or is a power wrong?",
                )
        return tuple(machines)

    def _infinite_buses(self, machines: Sequence[Machine], slack: str | None) -> list[Machine]:
        """Return what feeds what is left at references without a machine, which are ordinary buses otherwise."""
        named = {bus: {f"bus_{bus}", f"sg{bus}"} for bus, row in self._rows.items()}
        references = [bus for bus, row in self._rows.items() if row[1] == _REFERENCE]
        found = references_without_machine(
            references, {machine.bus for machine in machines}, self._rows, self._branches_in_service
        )
        for bus, why in found.ordinary.items():
            self._rows[bus][1] = _ORDINARY
            text = f"reference bus (IDE = 3) without a machine in service: {why}"
            self._changes.note(self._lines_of["bus", bus], text)
        if not machines:
            return []
        stands = [bus for bus in found.infinite if slack is None or slack in named[bus]]
        return [self._infinite_bus(bus, machines) for bus in stands]

    @property
    def _branches_in_service(self) -> list[tuple[int, int]]:
        """Return the buses of each branch that is closed at both ends."""
        ends = [(int(row[0]), int(row[1])) for row in self._branches if row[_STATE]]
        return [pair for pair in ends if not any(map(self._is_out, pair))]

    def _leave_out_bare_buses(self, machines: Sequence[Machine]) -> None:
        """Take buses with nothing at them out of service: PSS/E finds nothing to solve there."""
        needed = {machine.bus for machine in machines}
        needed.update(*self._branches_in_service)
        needed.update(*(device.places for device in self._devices.devices))
        for bus, row in self._rows.items():
            if (
                bus not in needed
                and row[1] != _OUT
                and not any(row[_DRAWN])
                and bus in self._titles
            ):
                row[1] = _OUT
                self._changes.note(
                    self._lines_of["bus", bus], "nothing is connected to the bus: left out"
                )

    def _infinite_bus(self, bus: int, machines: Sequence[Machine]) -> Machine:
        VM, idle = self._magnitudes[bus], {name for place, name in self._idle if place == bus}
        text = (
            f"reference bus (IDE = 3) without a machine in service: an infinite bus holds its VM = {VM:g} pu there and "
            f"feeds what is left, as a source behind {INFINITE_REACTANCE:g} pu (in PSS/E GENCLS with H = 0). If a "
            "machine is meant, add its record to the file; if another is to feed what is left, name it, such as "
            f"{with_slack(f'bus_{machines[0].bus}')}"
        )
        line = self._lines_of["bus", bus]
        self._changes.note(line, text)
        moved = sum(abs(machine.p_mw) for machine in machines)
        moved += sum(abs(complex(row[2], row[3])) for row in self._rows.values())
        return Machine(
            bus,
            "inf" if "1" in idle else "1",
            line,
            p_mw=0.0,
            v_pu=VM,
            rating_mva=max(self._raw.base_mva, math.ceil(moved)),
            source=INFINITE_REACTANCE * 1j,
            q_min_mvar=-math.inf,
            q_max_mvar=math.inf,
            is_infinite=True,
        )


def _reactance_of_switch(record: Record) -> float:
    """X of a switching device [pu of the system], which is 1e-4 where the file does not say it."""
    return record.number(3, "X", 1e-4)


def _limits(
    record: Record, low: str, at: int, high: str, above: int, unit: str
) -> tuple[float, float]:
    """A least and a largest value, infinite where the file has no limit."""
    least, most = record.number(at, low, -_NO_LIMIT), record.number(above, high, _NO_LIMIT)
    if least > most:
        raise record.error(
            f"the limit {low} is {least:g} {unit}, more than {high} of {most:g} {unit}; swap them"
        )
    return least if least > -_NO_LIMIT else -math.inf, most if most < _NO_LIMIT else math.inf
