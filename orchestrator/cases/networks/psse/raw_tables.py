"""Tables of a network while the records of a PSS/E RAW file are read: buses, branches, and what stands for what."""

import math
from typing import Any

from fmus.grid.element_data import SMALLEST_REACTANCE
from fmus.toolchain.port_variables import SYSTEM_BASE_MVA
from orchestrator.cases.networks.branch_keys import BranchKey
from orchestrator.cases.networks.bus_loads import BusLoads
from orchestrator.cases.networks.element_names import BranchName
from orchestrator.cases.networks.psse.controls import ShuntRecord, TapRecord
from orchestrator.cases.networks.psse.device_records import FoundDevices
from orchestrator.cases.networks.psse.impedance_corrections import correction_tables
from orchestrator.cases.networks.psse.missing_buses import with_known_buses
from orchestrator.cases.networks.psse.raw_network import FileLoad
from orchestrator.cases.networks.psse.raw_records import (
    SWITCHING_DEVICES,
    RawFile,
    Record,
)
from orchestrator.cases.networks.source_changes import Changes, Remark
from orchestrator.core.errors import InputError

BUS_COLUMNS = 13  # of `SourceTables.bus`, with the band of voltages
BRANCH_COLUMNS = 11  # of `SourceTables.branch`
GENERATOR_COLUMNS = 10  # of `SourceTables.gen`
ORDINARY = 1  # code IDE of a bus that holds nothing
REFERENCE = 3  # code IDE of the bus that feeds what is left
OUT_OF_SERVICE = 4  # code IDE of a bus out of service
_STATE = 10  # column of the table of branches: 0 if out of service


class RawTables:
    """Buses, branches and machines of a network as the records of a RAW file fill them, one section after another.

    ``rows`` has a row for each bus and ``branches`` one for each branch, with the columns of `SourceTables`."""

    def __init__(self, raw: RawFile, changes: Changes, keep_load_parts: bool) -> None:
        self.file, self.changes, self.keep_load_parts = raw, changes, keep_load_parts
        known = with_known_buses(raw)
        self.raw, self.dropped = known.raw, known.dropped
        self.rows: dict[int, list[float]] = {}
        self.kilovolts: dict[int, float] = {}
        self.magnitudes: dict[int, float] = {}
        self.branches: list[list[float]] = []
        self.to_earth: list[tuple[complex, complex]] = []
        self.names: list[BranchName] = []
        self.keys: list[BranchKey | None] = []
        self.labels: dict[int, str] = {}
        self.titles: dict[int, str] = {}
        # line of the record, X, and kV of each branch
        self.ohms: list[tuple[int, float, float]] = []
        self.idle: set[tuple[int, str]] = set()
        self.lines_of: dict[tuple[Any, ...], int] = {}
        # line of the first record and its first bus by the buses and the identifier of lines
        self.circuits: dict[tuple[frozenset[int], str], tuple[int, int]] = {}
        self.at_buses: dict[int, BusLoads] = {}
        self.devices = FoundDevices((), {})
        # lines of devices and switched shunts that are units, with a model of dynamics data
        self.modelled: set[int] = set()
        # with the bus at which it stands, and whether it feeds
        self.file_loads: list[tuple[FileLoad, int, bool]] = []
        self.same: dict[int, int] = {}  # bus that PSS/E takes as one with another → the other
        # lines of the records that make them one, and of those that would if both had no machine
        self.merged: set[int] = set()
        self.lossless: set[int] = set()
        # what holds a voltage step by step: ratios by the branch's place, and shunts
        self.taps: dict[int, TapRecord] = {}
        self.stepping: list[ShuntRecord] = []
        self.corrections = correction_tables(raw)
        # least reactance that our network can have [pu of the system]
        self.least_reactance = 1.1 * SMALLEST_REACTANCE * raw.base_mva / SYSTEM_BASE_MVA

    def bus(self, record: Record, index: int = 0) -> int:
        bus = abs(record.whole(index, "the bus' number"))
        bus = self.same.get(bus, bus)
        if bus not in self.rows:
            raise record.error(f"there is no bus {bus}")
        return bus

    def group(self, record: Record, index: int, name: str) -> int:
        """Return the area, zone or owner that a record names; a word in its place is asked about."""
        try:
            return record.whole(index, name, 1)
        except InputError:
            text = Remark(
                f"{name} is {record.text(index)!r}, which is no number: 1 is taken, and it has no effect on the flow",
                f"{name} is no number",
            )
            self.changes.note(record.line, text)
            return 1

    def own_bus(self, record: Record, index: int = 0) -> int:
        """The bus that a record names, also if it is one with another."""
        return abs(record.whole(index, "the bus' number"))

    @property
    def column_of_ends(self) -> int:
        """Column of GI in the records of branches."""
        return 9 if self.raw.revision < SWITCHING_DEVICES else 19

    def refuse_second(self, record: Record, what: str, *key: Any) -> None:
        """Refuse a second element of the same name, which PSS/E would put in the first one's place."""
        first = self.lines_of.setdefault((what, *key), record.line)
        if first != record.line:
            shown = " ".join(
                str(sorted(part)) if isinstance(part, frozenset) else str(part) for part in key
            )
            raise record.error(
                f"the {what} {shown} stands in line {first} as well; remove one of them, or rename it"
            )

    def add(self, bus: int, column: int, value: complex) -> None:
        """Add to the active and the reactive part [MW, Mvar], which stand side by side."""
        self.rows[bus][column] += value.real
        self.rows[bus][column + 1] += value.imag

    def line_to_earth(self, record: Record) -> complex:
        """Return all admittances to earth of a line: its charging, and its shunts at both ends [pu of the system]."""
        gi, bi, gj, bj = (
            record.number(self.column_of_ends + k, n, 0.0)
            for k, n in enumerate(("GI", "BI", "GJ", "BJ"))
        )
        return complex(gi + gj, record.number(5, "B", 0.0) + bi + bj)

    def standing(self, bus: int) -> int | None:
        """Return the bus that stands for one of the file; None if it is not there, or out of service."""
        standing = self.same.get(bus, bus)
        return standing if standing in self.rows and not self.is_out(standing) else None

    def is_out(self, bus: int) -> bool:
        return bus in self.rows and self.rows[bus][1] == OUT_OF_SERVICE

    def add_branch(
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
        key: BranchKey | None = None,
    ) -> None:
        if abs(z.imag) < self.least_reactance:
            text = f"reactance of almost 0: taken as {self.least_reactance:.2g} pu, the least that the network can have"
            self.changes.note(f"{start}-{end}", text)
            z = complex(z.real, self.least_reactance)
        if start == end:
            self.add_within_bus(start, z, to_earth, tap or 1.0, shift)
            return
        self.branches.append(
            [start, end, z.real, z.imag, 0.0, rating, 0.0, 0.0, tap, shift, float(state != 0)]
        )
        self.to_earth.append(to_earth)
        self.names.append(name)
        self.keys.append(key)

    def add_within_bus(
        self, bus: int, z: complex, to_earth: tuple[complex, complex], tap: float, shift: float
    ) -> None:
        """Add a branch whose ends are one bus, because zero impedance lines join them: it is an admittance to earth."""
        text = "both ends are one bus by zero impedance lines: an admittance to earth, by its charging and ratio"
        self.changes.note(f"{bus}-{bus}", text)
        through = 2 * math.cos(math.radians(shift)) / tap
        drawn = (1 / z + to_earth[0]) / tap**2 + 1 / z + to_earth[1] - through / z
        self.add(bus, 4, drawn * self.raw.base_mva)

    @property
    def branches_in_service(self) -> list[tuple[int, int]]:
        """Return the buses of each branch that is closed at both ends."""
        ends = [(int(row[0]), int(row[1])) for row in self.branches if row[_STATE]]
        return [pair for pair in ends if not any(map(self.is_out, pair))]


def is_in_service(record: Record, status: int | None, name: str) -> bool:
    """Return whether an element counts; one out of service may point to a bus that is not there, as in PSS/E."""
    return status is None or bool(record.whole(status, name, 1))
