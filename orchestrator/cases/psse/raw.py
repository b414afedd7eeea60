"""A PSS/E RAW file of revision 33 to 36 as tables of a network source."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from orchestrator.cases.network_sources import SourceTables
from orchestrator.cases.psse.raw_file import read_file
from orchestrator.cases.psse.records import RawFile, Record, leave_out
from orchestrator.cases.psse.transformers import Transformer, star, transformers
from orchestrator.cases.source_changes import Changes
from orchestrator.errors import Problem

_BUS_COLUMNS, _BRANCH_COLUMNS, _GEN_COLUMNS = 9, 11, 10
_VM, _VA = 7, 8  # columns of the table of buses
_REFERENCE = 3
_NO_LIMIT = 9999.0  # MW or Mvar by which PSS/E says that a generator has no limit
_APART = 0.01  # voltage of a solved file beside what a generator within its limits is to hold [pu]
_MOST_VOLTAGE = 2.0
_SBASE = 100.0  # usual base [MVA]
_FAR = 20.0
"""Times the middle one of all reactances of lines from which one is questioned, where its ohms would be usual."""

_SMALL_LOSS = 10.0  # MW that a fixed shunt may draw unasked
# step of shifts in radians, and how near a number is to be one of them
_RADIANS, _NEAR = math.pi / 6, 0.01
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


@dataclass(frozen=True)
class RawNetwork:
    """A file's tables, its machines in service, and what was taken over in another form.

    ``idle`` has bus and identifier of the machines that are out of service."""

    tables: SourceTables
    machines: tuple[Machine, ...]
    changes: tuple[Problem, ...]
    idle: frozenset[tuple[int, str]] = frozenset()


def read_raw(
    path: Path, leaving_out: Sequence[str] = (), *, keep_load_parts: bool = False
) -> RawNetwork:
    raw = read_file(path)
    return _Reading(raw, Changes(raw.place), keep_load_parts).network(leaving_out)


class _Reading:
    def __init__(self, raw: RawFile, changes: Changes, keep_load_parts: bool) -> None:
        self._raw, self._changes, self._keep_load_parts = raw, changes, keep_load_parts
        self._rows: dict[int, list[float]] = {}
        self._kilovolts: dict[int, float] = {}
        self._magnitudes: dict[int, float] = {}
        self._branches: list[list[float]] = []
        self._to_earth: list[tuple[complex, complex]] = []
        self._labels: dict[int, str] = {}
        # line of the record, X, and kV of each branch
        self._ohms: list[tuple[int, float, float]] = []
        self._idle: set[tuple[int, str]] = set()
        self._lines_of: dict[tuple[Any, ...], int] = {}
        self._load_parts: dict[int, tuple[complex, complex]] = {}

    def network(self, leaving_out: Sequence[str]) -> RawNetwork:
        for line, section in self._raw.guessed.items():
            text = f"does not say which data begin, as other lines do: taken as {section} data, which are next in order"
            self._changes.note(line, text)
        leave_out(self._raw, leaving_out, self._changes)
        self._buses()
        self._loads()
        self._shunts()
        self._lines()
        for transformer in transformers(self._raw, self._kilovolts):
            self._transformer(transformer)
        machines = self._machines()
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
        tables = SourceTables(
            self._raw.place,
            self._raw.base_mva,
            np.array(list(self._rows.values())),
            np.array(self._branches).reshape(-1, _BRANCH_COLUMNS),
            gen,
            np.array(self._to_earth, dtype=complex).reshape(-1, 2),
            self._labels,
            self._raw.frequency,
            self._load_parts,
        )
        return RawNetwork(tables, machines, tuple(self._changes.listed()), frozenset(self._idle))

    def _bus(self, record: Record, index: int = 0) -> int:
        bus = abs(record.whole(index, "the bus' number"))
        if bus not in self._rows:
            raise record.error(f"there is no bus {bus}")
        return bus

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
            self._rows[number][_VM:] = (
                self._magnitudes[number],
                record.number(8, "VA [degrees]", 0.0),
            )
            if kind != 4 and not 0 < self._magnitudes[number] <= _MOST_VOLTAGE:
                raise record.error(
                    f"VM is {self._magnitudes[number]:g} pu; it must exceed 0 and be at most {_MOST_VOLTAGE:g} (no kV, "
                    "no percent): export the solved case, or give 1"
                )
            self._labels[number] = str(number)

    def _loads(self) -> None:
        for record in self._raw.of("load"):
            bus = self._bus(record)
            self._once(record, "load", bus, record.text(1, "1").strip())
            if record.whole(2, "STATUS", 1) == 0:
                continue
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
            self._add(bus, 2, complex(pl, ql) + current - own)
            if self._keep_load_parts and (current or admittance):
                # YQ is positive where it generates, as with shunts
                impedance = admittance.conjugate() * v**2
                self._add(bus, 2, impedance)
                z, i = self._load_parts.get(bus, (0j, 0j))
                self._load_parts[bus] = (z + impedance, i + current)
            else:
                self._add(bus, 4, admittance)

    def _shunts(self) -> None:
        for record in self._raw.of("fixed shunt"):
            bus = self._bus(record)
            if record.whole(2, "STATUS", 1):
                drawn = complex(record.number(3, "GL", 0.0), record.number(4, "BL", 0.0))
                if drawn.real > max(_SMALL_LOSS, abs(drawn.imag)):
                    self._changes.note(
                        record.line, f"shunt that draws GL = {drawn.real:g} MW: is it BL, in Mvar?"
                    )
                self._add(bus, 4, drawn)
        status, mode, initial = (3, 1, 9) if self._raw.revision < 35 else (4, 2, 11)
        for record in self._raw.of("switched shunt"):
            bus = self._bus(record)
            if record.whole(status, "STAT", 1) == 0:
                continue
            if record.whole(mode, "MODSW", 1):
                self._changes.note(record.line, "switched shunt: held at BINIT")
            self._add(bus, 4, complex(0.0, record.number(initial, "BINIT", 0.0)))

    def _lines(self) -> None:
        ends = 9 if self._raw.revision == 33 else 19
        for record in self._raw.of("branch"):
            start, end = self._bus(record), self._bus(record, 1)
            self._once(record, "branch", frozenset((start, end)), record.text(2, "1").strip())
            z = complex(record.number(3, "R", 0.0), record.number(4, "X"))
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
            self._branch(
                start, end, z, state, (charging + complex(gi, bi), charging + complex(gj, bj))
            )
        for record in self._raw.of("system switching device"):
            start, end = self._bus(record), self._bus(record, 1)
            if closed := record.whole(16, "STAT", 1):
                self._changes.note(record.line, "switching device: a branch of its reactance")
            self._branch(start, end, complex(0.0, record.number(3, "X", 1e-4)), closed)
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
    ) -> None:
        self._branches.append(
            [start, end, z.real, z.imag, 0.0, 0.0, 0.0, 0.0, tap, shift, float(state != 0)]
        )
        self._to_earth.append(to_earth)

    def _transformer(self, t: Transformer) -> None:
        windings = t.windings
        if t.controlled:
            self._changes.note(
                t.record.line, "tap changer or phase-shift control: held at its position"
            )
        for turned in (w.shift / _RADIANS for w in windings if 0 < abs(w.shift) < 2 * math.pi):
            if abs(turned - round(turned)) < _NEAR * abs(turned):
                text = f"ANG is {turned * _RADIANS:g} degrees: is it in radians? {round(turned) * 30} degrees are usual"
                self._changes.note(t.record.line, text)
        if t.corrected:
            self._changes.note(t.record.line, "impedance correction table: not applied")
        if t.off == (0, 1, 2):
            return
        if 0 not in t.off:
            self._add(windings[0].bus, 4, t.magnetisation * self._raw.base_mva)
        if len(windings) == 2:
            first, second = windings
            self._branch(
                first.bus,
                second.bus,
                t.impedances[0] * second.ratio**2,
                1,
                tap=first.ratio / second.ratio,
                shift=first.shift - second.shift,
            )
            return
        inner = max(self._rows) + 1
        self._rows[inner] = [inner, 1, *[0.0] * (_BUS_COLUMNS - 2)]
        self._labels[inner] = "_".join(
            map(str, (*(w.bus for w in windings), t.circuit.strip() or "1", "star"))
        )
        for k, (winding, z) in enumerate(zip(windings, star(t.impedances), strict=True)):
            self._branch(
                winding.bus, inner, z, k not in t.off, tap=winding.ratio, shift=winding.shift
            )

    def _machines(self) -> tuple[Machine, ...]:
        mbase, status = (8, 14) if self._raw.revision < 35 else (9, 15)
        machines = []
        for record in self._raw.of("generator"):
            bus = self._bus(record)
            self._once(record, "machine", bus, record.text(1, "1").strip())
            if record.whole(status, "STAT", 1) == 0 or self._rows[bus][1] == 4:
                self._idle.add((bus, record.text(1, "1").strip()))
                continue
            rating = record.number(mbase, "MBASE [MVA]", self._raw.base_mva)
            if not rating > 0:
                raise record.error(f"MBASE is {rating:g} MVA; it must exceed 0")
            least, most = _limits(record, "QB", 5, "QT", 4, "Mvar")
            remote = record.whole(7, "IREG", 0)
            held = record.number(6, "VS", 1.0)
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
            elif (
                (VM := self._magnitudes[bus]) != 1  # 1: not solved
                and abs(held - VM) > _APART
                and least < record.number(3, "QG", 0.0) < most
            ):
                text = f"VS is {held:g} pu, where the solved file has VM = {VM:g} pu, with Q within its limits"
                self._changes.note(record.line, f"{text}: VS is held")
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
                )
            )
        return tuple(machines)


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
