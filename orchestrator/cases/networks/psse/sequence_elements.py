"""Sequence data of PSS/E by the elements of our network: what each record is of, and what fits nothing."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from statistics import median

from fmus.grid.element_data import Line
from fmus.toolchain.port_variables import SYSTEM_BASE_MVA
from orchestrator.cases.networks.branch_keys import BranchKey
from orchestrator.cases.networks.psse.raw_network import Machine, unit_labels
from orchestrator.cases.networks.psse.raw_records import Record
from orchestrator.cases.networks.psse.sequence_records import SequenceFile
from orchestrator.cases.networks.record_use import RecordUse, UseOfRecord
from orchestrator.cases.networks.sequence_data import (
    DELTA,
    EARTHED,
    MachineSequences,
    SequenceData,
    ZeroLine,
    ZeroTransformer,
)
from orchestrator.core.errors import Problem, QuestionTopic, few, number_of

_TWO: dict[int, tuple[str, ...]] = {
    **dict.fromkeys((1, 8, 11, 18, 21), (EARTHED, EARTHED)),
    **dict.fromkeys((2, 12), (EARTHED, DELTA)),
    **dict.fromkeys((3, 13), (DELTA, EARTHED)),
    **dict.fromkeys((4, 14), (DELTA, DELTA)),
}
"""CC of two windings → their connections; those with a path of their own at an earthing transformer are not here."""
_THREE: dict[int, tuple[str, ...]] = {
    **dict.fromkeys((1, 11), (EARTHED, EARTHED, EARTHED)),
    **dict.fromkeys((2, 12), (EARTHED, EARTHED, DELTA)),
    **dict.fromkeys((3, 13), (DELTA, EARTHED, DELTA)),
    **dict.fromkeys((4, 14), (DELTA, DELTA, DELTA)),
}
_CODED = 33  # first revision whose transformers have CZ0 and CZG
_LONGEST_OLD = 13  # columns of a transformer before
_WINDING_BASE = 2  # of codes CZ0 and CZG
_LOSSES = 3  # of code CZ0
_OHMS = 3  # of code CZG
_SHOWN = 4  # records that a question names
_USUAL_LINES = (0.8, 8.0)
"""Ratio of Z0 to Z1 of a line outside of which it is asked about, and the base where the middle one of all is."""
_USUAL_MACHINES = (0.4, 2.5)  # the same of X2 to X''d of machines

_UNUSED = {
    "switched shunt": "blocks of switched shunts are taken as not earthed",
    "induction machine": "induction machines are taken by their load's impedance, not earthed",
    "non-conventional source": "converters feed what their models say",
    "positive machine": "machines have the X''d of their dynamics data",
}
"""Section → why its records are not used."""


@dataclass(frozen=True)
class CaseElements:
    """Elements of a network by what a file of sequence data may name.

    ``keys``: of the lines by their names; ``base_mva``: the system's base; ``bus_of``: name of a bus by its number,
    None where it is out of service; ``numbers``: all buses of the network's file."""

    keys: Mapping[str, BranchKey]
    lines: Mapping[str, Line]
    machines: Sequence[Machine]
    base_mva: float
    bus_of: Callable[[int], str | None]
    numbers: frozenset[int]


@dataclass(frozen=True, slots=True)
class _Ratio:
    """Z0 by Z1 of a line, or X2 by X'' of a machine: its record, its name, and the figures in words."""

    record: Record
    name: str
    value: float
    figures: str


@dataclass
class SequenceReading:
    """Elements with the data of a file, the file's records, and what is to be asked."""

    file: SequenceFile
    elements: CaseElements
    lines: dict[str, ZeroLine] = field(default_factory=dict)
    branches: dict[str, ZeroTransformer] = field(default_factory=dict)
    machines: dict[str, MachineSequences] = field(default_factory=dict)
    negative: dict[str, complex] = field(default_factory=dict)
    zero: dict[str, complex] = field(default_factory=dict)
    mutuals: dict[tuple[str, str], complex] = field(default_factory=dict)
    records: list[RecordUse] = field(default_factory=list)
    questions: list[Problem] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._on_100 = SYSTEM_BASE_MVA / self.elements.base_mva
        self._named: dict[tuple[frozenset[int], str], list[str]] = {}
        for name, key in self.elements.keys.items():
            self._named.setdefault((frozenset(key.buses), key.circuit or "1"), []).append(name)
        self._units = {
            key: f"sg{label}" for key, label in unit_labels(self.elements.machines).items()
        }
        self._sources = {
            self._units[m.bus, m.name.strip()]: m.source.imag for m in self.elements.machines
        }
        self._foreign: list[str] = []
        self._ratios_of_lines: list[_Ratio] = []
        self._ratios_of_machines: list[_Ratio] = []
        self._read_all()
        self._ask_of_foreign()
        self._ask_of_ratios()

    @property
    def data(self) -> SequenceData:
        keys = self.elements.keys
        return SequenceData(
            self.file.place,
            lines=self.lines,
            branches=self.branches,
            machines=self.machines,
            negative=self.negative,
            zero=self.zero,
            mutuals=self.mutuals,
            transformers=frozenset(name for name, key in keys.items() if key.is_transformer),
        )

    def _read_all(self) -> None:
        readers: dict[str, Callable[[Record], str]] = {
            "branch": self._branch,
            "transformer": self._transformer,
            "machine": self._machine,
            "negative machine": self._negative_machine,
            "zero machine": self._zero_machine,
            "load": self._load,
            "negative load": self._negative_load,
            "zero load": self._zero_load,
            "fixed shunt": self._fixed_shunt,
            "mutual": self._mutual,
        }
        for section, records in self.file.sections.items():
            for record in records:
                reader = readers.get(section)
                if reader is None:
                    self._account(record, section, _UNUSED.get(section, "it is of no use here"))
                else:
                    self._account(record, section, reader(record))

    def _account(self, record: Record, section: str, why: str) -> None:
        use = UseOfRecord.NOT_USED if why else UseOfRecord.USED
        kind = f"{section} (sequence data)"
        self.records.append(RecordUse(record.place, record.line, kind, use, why))

    def _negative_machine(self, record: Record) -> str:
        return self._old_machine(record, zero=False)

    def _zero_machine(self, record: Record) -> str:
        return self._old_machine(record, zero=True)

    def _negative_load(self, record: Record) -> str:
        return self._old_load(record, self.negative)

    def _zero_load(self, record: Record) -> str:
        return self._old_load(record, self.zero)

    def _missing(self, record: Record, buses: Sequence[int], what: str) -> str:
        """Return why a record has no element, and count it where the network's file lacks a bus."""
        unknown = [bus for bus in buses if bus not in self.elements.numbers]
        if unknown:
            self._foreign.append(f"line {record.line} bus {unknown[0]}")
            return f"the network's file has no bus {unknown[0]}"
        return f"{what} is not in service in the network's file"

    def _names_at(self, record: Record, buses: Sequence[int], column: int) -> list[str]:
        circuit = record.text(column, "1").strip() or "1"
        return self._named.get((frozenset(buses), circuit), [])

    def _branch(self, record: Record) -> str:
        buses = _buses(record, 0, 2)
        names = [x for x in self._names_at(record, buses, 2) if not self._key(x).is_transformer]
        if not names:
            return self._missing(record, buses, "this branch")
        z = complex(record.number(3, "RLINZ", 0.0), record.number(4, "XLINZ", 0.0))
        if not z:
            return "its impedance is 0, which means none"
        ends = [
            complex(record.number(k, "G", 0.0), record.number(k + 1, "B", 0.0)) / self._on_100
            for k in (6, 8)
        ]
        charging = record.number(5, "BCHZ", 0.0) / self._on_100
        for name in names:
            one, other = ends if self._key(name).buses == tuple(buses) else ends[::-1]
            self.lines[name] = ZeroLine(z * self._on_100, charging, one, other)
        self._compare_line(record, names[0], z)
        return ""

    def _compare_line(self, record: Record, name: str, z: complex) -> None:
        """Keep a line's Z0 by Z1, and ask about signs that differ from those of Z1.

        ``z``: Z0 [pu of the file]."""
        known = self.elements.lines.get(name)
        if known is None:
            return
        first = complex(known.R, known.X) / self._on_100
        turned = [
            f"{field} = {zero:g} pu, where {symbol} is {own:.4g}"
            for field, zero, symbol, own in (
                ("XLINZ", z.imag, "X1", first.imag),
                ("RLINZ", z.real, "R1", first.real),
            )
            if zero * own < 0 or (zero < 0 and not own)
        ]
        if turned:
            text = f"{name} has {', and '.join(turned)}: used as it stands; is its sign wrong?"
            self._ask(record, text, "the sign of a line's Z0")
            return
        figures = f"RLINZ + jXLINZ = {z.real:g}{z.imag:+g}j pu, R1 + jX1 = {first.real:.4g}{first.imag:+.4g}j pu"
        self._ratios_of_lines.append(_Ratio(record, name, abs(z) / abs(first), figures))

    def _key(self, name: str) -> BranchKey:
        return self.elements.keys[name]

    def _transformer(self, record: Record) -> str:
        buses = [bus for bus in _buses(record, 0, 3) if bus]
        names = [x for x in self._names_at(record, buses, 3) if self._key(x).is_transformer]
        if not names:
            return self._missing(record, buses, "this transformer")
        found = _TransformerRecord(record, self.file.revision, len(buses), self.elements.base_mva)
        known = (_TWO if len(buses) == 2 else _THREE).get(found.code)
        if known is None:
            text = f"CC is {found.code}: taken as without a path of the zero sequence; is a path meant?"
            self._ask(record, text, "a connection code")
            known = (DELTA,) * len(buses)
        if set(found.unusual):
            self._ask(
                record, f"{', '.join(found.unusual)}: not used", "a transformer's zero sequence"
            )
        order = self._key(names[0]).buses
        if tuple(buses) != order:
            text = (
                f"the transformer's buses stand in another order than in the network's file: CC = {found.code} is "
                "taken by the order here; is it meant so?"
            )
            self._ask(record, text, "a transformer's order of buses")
        for name in names:
            key = self._key(name)
            places = [buses.index(bus) for bus in key.buses]
            if key.winding:
                place = places[key.winding - 1]
                z, earthing = (
                    self._scaled(found.impedance(key, place)),
                    self._scaled(found.earthing(key, place, key.winding - 1)),
                )
                self.branches[name] = ZeroTransformer((known[place],), z, (earthing,))
                continue
            self.branches[name] = ZeroTransformer(
                tuple(known[place] for place in places),
                self._scaled(found.impedance(key, 0) * key.square),
                tuple(self._scaled(found.earthing(key, p, k)) for k, p in enumerate(places)),
            )
            self._compare_transformer(record, name)
        return ""

    def _compare_transformer(self, record: Record, name: str) -> None:
        """Ask about signs of a transformer of two windings that differ from those of Z1, or of its earthing.

        A leg of a star may be below 0, so those of three windings are not asked about."""
        known, found = self.elements.lines.get(name), self.branches[name]
        if known is None:
            return
        turned = [
            f"{symbol}0 = {zero:.4g} pu, where {symbol}1 is {own:.4g}"
            for symbol, zero, own in (("X", found.z.imag, known.X), ("R", found.z.real, known.R))
            if zero * own < 0
        ]
        turned += [
            f"{symbol}G = {part:.4g} pu"
            for z in found.earthing
            for symbol, part in (("R", z.real), ("X", z.imag))
            if part < 0
        ]
        if turned:
            text = f"{name} has {', and '.join(turned)} (on 100 MVA): used as it stands; is its sign wrong?"
            self._ask(record, text, "the sign of a transformer's Z0")

    def _scaled(self, z: complex) -> complex:
        return z * self._on_100

    def _machine(self, record: Record) -> str:
        name = self._unit(record)
        if name is None:
            return self._missing(record, _buses(record, 0, 1), "this machine")
        negative = complex(record.number(6, "ZRNEG", 0.0), record.number(7, "ZXNEGDV", 0.0))
        zero = complex(record.number(8, "ZR0", 0.0), record.number(9, "ZX0DV", 0.0))
        earthing = complex(record.number(11, "ZRG", 0.0), record.number(12, "ZXG", 0.0))
        if earthing and record.whole(10, "CZG", 1) != 1:
            self._ask(
                record, "CZG is not 1: ZRG and ZXG are taken in pu of MBASE", "CZG of a machine"
            )
        self.machines[name] = MachineSequences(negative, zero + 3 * earthing if zero else None)
        columns = {"X2": (7, "ZXNEGDV"), "X0": (9, "ZX0DV"), "R2": (6, "ZRNEG"), "R0": (8, "ZR0")}
        self._compare_machine(
            record, name, columns | {"RG": (11, "ZRG"), "XG": (12, "ZXG")} if zero else columns
        )
        return "" if negative or zero else "its impedances are 0, which means none"

    def _old_machine(self, record: Record, *, zero: bool) -> str:
        """Read one sequence of a machine, which is a section of its own up to revision 32."""
        name = self._unit(record)
        if name is None:
            return self._missing(record, _buses(record, 0, 1), "this machine")
        z = complex(record.number(2, "ZR", 0.0), record.number(3, "ZX", 0.0))
        before = self.machines.get(name, MachineSequences(0j, None))
        self.machines[name] = MachineSequences(
            before.negative if zero else z, (z or None) if zero else before.zero
        )
        kind = "0" if zero else "2"
        self._compare_machine(record, name, {f"X{kind}": (3, "ZX"), f"R{kind}": (2, "ZR")})
        return "" if z else "its impedance is 0, which means none"

    def _compare_machine(
        self, record: Record, name: str, columns: Mapping[str, tuple[int, str]]
    ) -> None:
        """Keep a machine's X2 by X'', and ask about negative values.

        ``columns``: of impedances and the fields' names, by their symbols."""
        values = {symbol: record.number(*column, 0.0) for symbol, column in columns.items()}
        negative = [
            f"{symbol} = {value:g} pu ({columns[symbol][1]})"
            for symbol, value in values.items()
            if value < 0
        ]
        if negative:
            text = f"{name} has {', '.join(negative)}, where a machine's exceed 0: used so; is its sign wrong?"
            self._ask(record, text, "a negative impedance of a machine")
        source, x = self._sources.get(name, 0.0), values.get("X2", 0.0)
        if source > 0 and x > 0:
            figures = f"X2 = {x:g} pu, ZX of RAW = {source:g} pu"
            self._ratios_of_machines.append(_Ratio(record, name, x / source, figures))

    def _unit(self, record: Record) -> str | None:
        bus = record.whole(0, "the bus' number")
        return self._units.get((bus, record.text(1, "1").strip()))

    def _load(self, record: Record) -> str:
        bus = self.elements.bus_of(record.whole(0, "the bus' number"))
        if bus is None:
            return self._missing(record, _buses(record, 0, 1), "its bus")
        drawn = complex(record.number(2, "PNEG", 0.0), -record.number(3, "QNEG", 0.0))
        if drawn:
            self.negative[bus] = self.negative.get(bus, 0j) + drawn / SYSTEM_BASE_MVA
        earthed = complex(record.number(5, "PZERO", 0.0), -record.number(6, "QZERO", 0.0))
        if earthed and record.whole(4, "GRDFLG", 0):
            self.zero[bus] = self.zero.get(bus, 0j) + earthed / SYSTEM_BASE_MVA
        return ""

    def _old_load(self, record: Record, into: dict[str, complex]) -> str:
        bus = self.elements.bus_of(record.whole(0, "the bus' number"))
        if bus is None:
            return self._missing(record, _buses(record, 0, 1), "its bus")
        y = complex(record.number(1, "G", 0.0), record.number(2, "B", 0.0)) / self._on_100
        if y:
            into[bus] = into.get(bus, 0j) + y
        return ""

    def _fixed_shunt(self, record: Record) -> str:
        bus = self.elements.bus_of(record.whole(0, "the bus' number"))
        if bus is None:
            return self._missing(record, _buses(record, 0, 1), "its bus")
        y = complex(record.number(2, "GSZERO", 0.0), record.number(3, "BSZERO", 0.0))
        self.zero[bus] = self.zero.get(bus, 0j) + y / SYSTEM_BASE_MVA
        return ""

    def _mutual(self, record: Record) -> str:
        ends = _buses(record, 0, 2), _buses(record, 3, 2)
        names = [
            self._names_at(record, pair, column) for pair, column in zip(ends, (2, 5), strict=True)
        ]
        if not all(names):
            return self._missing(record, [*ends[0], *ends[1]], "one of its branches")
        z = complex(record.number(6, "RM", 0.0), record.number(7, "XM", 0.0)) * self._on_100
        one, other = names[0][0], names[1][0]
        turned = [self._key(x).buses != tuple(e) for x, e in zip((one, other), ends, strict=True)]
        self.mutuals[one, other] = -z if turned[0] != turned[1] else z
        return ""

    def _ask(self, record: Record, text: str, kind: str) -> None:
        place = f"{record.place}, line {record.line}"
        self.questions.append(
            Problem(place, text, topic=QuestionTopic(kind, f"line {record.line}"))
        )

    def _ask_of_foreign(self) -> None:
        if not self._foreign:
            return
        named = few(self._foreign, _SHOWN)
        text = (
            f"{number_of(len(self._foreign), 'record')} of sequence data {'are' if len(self._foreign) > 1 else 'is'} "
            f"of buses that the network's file lacks ({named}): not used; is the file of another case?"
        )
        topic = QuestionTopic("sequence data of buses that do not exist")
        self.questions.append(Problem(self.file.place, text, topic=topic))

    def _ask_of_ratios(self) -> None:
        """Ask about a base where the middle of all ratios is no ratio that equipment has, else about single ratios."""
        base = f"the base of the network's file, {self.elements.base_mva:g} MVA"
        asked = (
            ("Z0 by Z1", "lines", self._ratios_of_lines, _USUAL_LINES, base),
            (
                *("X2 by X''", "machines (ZX of RAW)", self._ratios_of_machines, _USUAL_MACHINES),
                "the machines' bases, MBASE",
            ),
        )
        for ratio, of, found, (low, high), own in asked:
            middle = median(x.value for x in found) if found else low
            usual = f"where {low:g} to {high:g} are usual"
            if not low <= middle <= high:
                what = f"{ratio} of {of}"
                text = f"{what} is {middle:.3g} in the middle of all, {usual}: are the sequence data on {own}?"
                topic = QuestionTopic("the base of sequence data", what)
                self.questions.append(Problem(self.file.place, text, topic=topic))
                continue
            for one in found:
                if not low <= one.value <= high:
                    text = f"{ratio} of {one.name} is {one.value:.3g}, {usual} ({one.figures}): is it meant?"
                    self._ask(one.record, text, f"an unusual {ratio}")


class _TransformerRecord:
    """Columns of a transformer, which differ by the revision and the number of windings."""

    def __init__(self, record: Record, revision: int, windings: int, base_mva: float) -> None:
        self._record, self._windings, self._base_mva = record, windings, base_mva
        self._is_coded = revision >= _CODED or len(record.fields) > _LONGEST_OLD
        self._of_z = record.whole(4, "CZ0", 1) if self._is_coded else 1
        self._of_earth = record.whole(5, "CZG", 1) if self._is_coded else 1
        self.code = record.whole(6 if self._is_coded else 4, "CC", 1)
        self.unusual: list[str] = []
        if self._of_z >= _LOSSES:
            self.unusual.append("R0 is a load loss by CZ0 = 3")
        if self._is_coded and self._pair(15 if windings == 2 else 19, "NUTRL"):
            self.unusual.append("RNUTRL and XNUTRL are not 0")

    def _pair(self, column: int, name: str) -> complex:
        number = self._record.number
        return complex(number(column, f"R{name}", 0.0), number(column + 1, f"X{name}", 0.0))

    def impedance(self, key: BranchKey, winding: int) -> complex:
        """Return the impedance of a winding, or through two of them [pu of the system]."""
        if not self._is_coded:
            return self._pair(7 + 2 * winding, f"{winding + 1}")
        z = self._pair(9 + 4 * winding, f"0{winding + 1}")
        z = 1j * z.imag if self._of_z >= _LOSSES else z
        return z if self._of_z < _WINDING_BASE else z * key.on_system

    def earthing(self, key: BranchKey, winding: int, side: int) -> complex:
        """Return the impedance from a winding's neutral to earth [pu of the system]."""
        if not self._is_coded:
            return self._pair(5, "G") if self._is_where_earthed(winding) else 0j
        z = self._pair(7 + 4 * winding, f"G{winding + 1}")
        if self._of_earth == _OHMS:
            kilovolts = key.kilovolts[side] if side < len(key.kilovolts) else 0.0
            return z * self._base_mva / kilovolts**2 if kilovolts else 0j
        return z * key.on_system if self._of_earth == _WINDING_BASE else z

    def _is_where_earthed(self, winding: int) -> bool:
        """Return whether ZG of an old record, which has one, is of a winding: the first that is earthed."""
        known = (_TWO if self._windings == 2 else _THREE).get(self.code, ())
        return EARTHED in known and known.index(EARTHED) == winding


def _buses(record: Record, column: int, count: int) -> list[int]:
    return [abs(record.whole(column + k, "the bus' number", 0)) for k in range(count)]
