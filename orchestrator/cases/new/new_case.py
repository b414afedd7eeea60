"""A case file from a network's files: scenarios, plots and comments that a person can read and change."""

import itertools
import math
import os
import re
import textwrap
import tomllib
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType

from fmus.grid.network import Load
from fmus.toolchain.port_variables import I_IM, I_RE, SYSTEM_BASE_MVA, V_IM, V_RE
from orchestrator.cases.case import Case, case_of_text
from orchestrator.cases.flow.beside_file import BesideFile
from orchestrator.cases.form.csv_rows import number, rows_of
from orchestrator.cases.form.names import close_names
from orchestrator.cases.networks.data import bus_name, network_data
from orchestrator.cases.networks.psse.raw_file import read_file
from orchestrator.cases.networks.record_use import RecordUse, details, in_one_line
from orchestrator.cases.new.refusal import of_what_was_given
from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.cases.scenario.short_circuit import source_impedance
from orchestrator.core.errors import CaseError, InputError, Problem, few
from orchestrator.core.question_kinds import by_kind
from orchestrator.core.uncollected import uncollected
from orchestrator.core.units import to_unit
from orchestrator.devices.binding.binding import bound_fmu
from orchestrator.devices.fmi.description import FmuDescription

_TABLES = {
    "lines_file": ("from", "to"),
    "units": ("bus", "rating_mva"),
    "loads_file": ("bus", "p_mw"),
    "buses": ("bus",),
}
"""What a table of a plain network is → the columns that tell it."""

_FILES = {
    ".raw": "raw",
    ".rawx": "raw",
    ".m": "matpower",
    ".mat": "matpower",
    ".json": "pandapower",
    ".zip": "cgmes",
}
_TEMPLATE = Path(__file__).with_suffix(".txt").read_text(encoding="utf-8")
_EMT_STEP = 1e-4
_MOST_CURVES = 12
_MOST_MOVES = 5  # of taps and shunts that are named; the others are counted
_EMF = """emf w·e''; [conventions] like = "psse" takes PSS/E's e'', which moves dampings by tenths of a point"""
_LINE = re.compile(r"line (\d+)")  # of the text, as places of questions begin
_CONVERTER = "gfor"
_INJECTION = "injection"


@dataclass(frozen=True)
class WantedConverter:
    """``bus 9, 300 MVA, 200 MW, less sg3``; ``less`` is the machine that feeds so much less, or, with ``instead of``,
    that it replaces."""

    bus: str
    rating_mva: float
    p_mw: float
    less: str | None = None
    replaces: bool = False


@dataclass(frozen=True)
class WantedCase:
    """The case that `gfor new` is asked for: a vendor's ``device`` stands in place of our converter, ``models`` (emt,
    phasor) is chosen where None, ``command`` is as it was typed."""

    files: tuple[Path, ...]
    out: Path
    converters: tuple[WantedConverter, ...] = ()
    device: Path | None = None
    binding: Path | None = None
    is_dll: bool = False
    models: str | None = None
    frequency: str | None = None
    slack: str | None = None
    leave_out: tuple[str, ...] = ()
    dyr_leave_out: tuple[str, ...] = ()
    reactive_limits: bool = False
    dyr_approximate: bool = False
    replace: tuple[str, ...] = ()
    load_parts: bool = True
    move_controls: bool = False
    command: str = "gfor new"

    @property
    def kind(self) -> str:
        """A vendor's file has no phasor form."""
        return self.models or ("phasor" if self.device is None else "emt")

    @property
    def options(self) -> dict[str, tuple[str, ...]]:
        """Return the values that were given by option."""
        return {
            "--slack": (self.slack,) if self.slack else (),
            "--frequency": (self.frequency,) if self.frequency else (),
            "--leave-out": self.leave_out,
            "--dyr-leave-out": self.dyr_leave_out,
            "--replace": self.replace,
        }


@dataclass(frozen=True)
class NewCase:
    text: str
    assumed: tuple[str, ...]
    scenarios: tuple[PreparedScenario, ...]
    questions: tuple[str, ...] = ()  # at the lines of the text
    black_box: bool = False  # whether its modes need --black-box

    @property
    def records(self) -> tuple[RecordUse, ...]:
        """Return what became of the records of the network's files."""
        return self.scenarios[0].records if self.scenarios else ()

    @property
    def beside_file(self) -> BesideFile | None:
        """How far the power flow of the base case is from the file's voltages; None where the file has none."""
        return self.scenarios[0].beside_file if self.scenarios else None


def read_converter(text: str) -> WantedConverter:
    """Read ``bus 9, 300 MVA, 200 MW, less sg3``, in any order.

    Raises `InputError` with what is missing, given twice or not understood."""
    how = "write it like 'bus 9, 300 MVA, 200 MW, less sg3' (or 'instead of sg3'; the last part may be left out)"
    found: dict[str, str] = {}
    replaces = False
    for part in (part.strip() for part in text.split(",")):
        quantity = re.fullmatch(r"[-+\d.eE]+\s*(MVA|GVA|kVA|MW|GW|kW)", part)
        word, _, rest = part.partition(" ")
        if quantity is not None:
            key = "MVA" if quantity[1].endswith("VA") else "MW"
        elif word in ("bus", "less") and rest.strip():
            key = word
        elif part.startswith("instead of "):
            key, rest, replaces = "less", part.removeprefix("instead of "), True
        elif re.fullmatch(r"bus_\w+", part):
            key, rest = "bus", part
        else:
            raise InputError(f"--converter {text!r}: {part!r} is not understood; {how}")
        if key in found:
            raise InputError(f"--converter {text!r}: {key} is given twice; {how}")
        found[key] = part if quantity is not None else rest.strip()
    missing = {"bus": "bus", "MVA": "rating in MVA", "MW": "power in MW"}
    lacks = [words for key, words in missing.items() if key not in found]
    if lacks:
        raise InputError(f"--converter {text!r}: the {' and the '.join(lacks)} is missing; {how}")
    rating, power = to_unit(found["MVA"], "MVA"), to_unit(found["MW"], "MW")
    if not 0 < rating < math.inf or not abs(power) <= rating:
        raise InputError(
            f"--converter {text!r}: {power:g} MW with a rating of {rating:g} MVA; {how}"
        )
    if 0 < abs(power) < 0.01 * rating:
        raise InputError(
            f"--converter {text!r}: {power:g} MW is {100 * power / rating:.2g} % of its rating; is "
            f"{1000 * power:g} MW meant? A converter that only holds the voltage has 0 MW"
        )
    return WantedConverter(found["bus"], rating, power, found.get("less"), replaces)


@uncollected()
def write_case(wanted: WantedCase) -> NewCase:
    """Compose a case, with the questions about its data as comments at their lines.

    Raises `InputError` if a file, a bus or a machine cannot be used; as a case of these files would be refused."""
    sources = sources_of(wanted.files)
    _check_controls(wanted, sources)
    try:
        return _compose(wanted, sources)
    except CaseError as error:
        raise of_what_was_given(error, sources, wanted.options) from error


def _compose(wanted: WantedCase, sources: dict[str, Path]) -> NewCase:
    """Compose a case of the files, by the keys of the case that name them."""
    device = (
        None
        if wanted.device is None
        else _described(wanted.device, wanted.binding, is_dll=wanted.is_dll)
    )
    if "units" in sources:  # tables say neither
        rows = rows_of(sources["units"], ("rating_mva",))
        machines = {bus_name(row["bus"]): number(row, "rating_mva") for row in rows}
        largest = max(machines, key=machines.__getitem__)
        wanted = replace(
            wanted, slack=wanted.slack or largest, frequency=wanted.frequency or "50 Hz"
        )
    first = _Text(wanted, sources, fault_bus=_largest_load(_Text(wanted, sources).text, wanted))
    base = _prepared(first.text, wanted, ["base"])[0]
    if wanted.move_controls:
        moved = _moved_controls(first.text, wanted, base)
        first = _Text(wanted, sources, fault_bus=first.fault_bus, moved=moved)
        base = _prepared(first.text, wanted, ["base"])[0]
    places: list[_Place] = []
    for converter in wanted.converters:
        places.append(_place_for(converter, base, _called(wanted.files), places))
    draft = _Text(wanted, sources, base, _with_names(places), _switched(device), moved=first.moved)
    if not places and wanted.kind == "phasor" and draft.fault_bus == first.fault_bus:
        # nothing of the scenario ``base`` has changed, and a large network takes seconds to prepare
        scenarios = [base, *_prepared(draft.text, wanted, ["fault"])]
    else:
        scenarios = _prepared(draft.text, wanted, [])
    questions = dict.fromkeys(q for prepared in scenarios for q in prepared.questions)
    text, numbers = _commented(draft.text, list(questions), sources)
    black_box = device is not None and not device.can_save_state
    placed = tuple(str(_renumber(question, numbers)) for question in questions)
    return NewCase(text, tuple(draft.assumed(len(placed))), tuple(scenarios), placed, black_box)


def _check_controls(wanted: WantedCase, sources: Mapping[str, Path]) -> None:
    if wanted.move_controls and "raw" not in sources:
        named = ", ".join(path.name for path in sources.values())
        raise InputError(
            f"--move-controls is for taps and switched shunts of a RAW file, and the network is {named}; leave it out"
        )
    if wanted.move_controls and wanted.kind != "phasor":
        raise InputError(
            "--move-controls: taps and switched shunts move in phasor models; write --models phasor, or leave it out"
        )


def _moved_controls(
    text: str, wanted: WantedCase, base: PreparedScenario
) -> dict[str, tuple[float, float]]:
    """Return the positions of the taps and shunts that move in the base case, before and after, by variable."""
    flow = base.power_flow
    if flow is None:
        return {}
    case: Case = case_of_text(text, tomllib.loads(text), wanted.out)
    (settled,) = case.prepare(["base"], voltages_before=flow.voltages)
    before, after = (x.system.components[x.grid] for x in (base, settled))
    positions = {name: (before.number(name), after.number(name)) for name in base.moving}
    return {name: pair for name, pair in positions.items() if pair[0] != pair[1]}


def _largest_load(text: str, wanted: WantedCase) -> str:
    """Return the bus of the largest load, which is faulted; "" if the network cannot be read, which is told later.

    With the fault the network of the first pass is that of the case, and its model is described once."""
    table = case_of_text(text, tomllib.loads(text), wanted.out).table
    if table.network is None:
        return ""
    try:
        slack = table.power_flow.slack if table.power_flow else None
        data = network_data(table.network, wanted.out.absolute().parent, slack)
    except InputError:
        return ""
    return _bus_of_largest(data.loads, data.buses) if data.buses else ""


def _bus_of_largest(loads: Sequence[Load], buses: Sequence[str]) -> str:
    largest = max(loads, key=lambda load: load.p_mw, default=None)
    return largest.bus if largest else buses[0]


def _switched(device: FmuDescription | None) -> dict[str, bool]:
    """The PODs, p or q, that a device has a switch for: ours where None; and whether it starts with them."""
    if device is None:
        return {"p": False, "q": False}
    found = {x: device.variables.get(f"pod_{x}.enabled") for x in "pq"}
    return {
        x: str(v.start).lower() in ("true", "1", "1.0") for x, v in found.items() if v is not None
    }


def _described(path: Path, binding: Path | None, *, is_dll: bool) -> FmuDescription:
    """A device that has the port of a case, perhaps by a binding."""
    found = bound_fmu(path, binding)
    other = [
        v.name
        for v in (V_RE, V_IM, I_RE, I_IM)
        if v.name not in found.variables or found.variables[v.name].unit not in (None, "", "pu")
    ]
    if other:
        way = "say which of its variables it is with --binding; `gfor fmu bind` drafts one"
        way = (
            "lay a circuit around the DLL in a device's file, and give that to --dll"
            if is_dll
            else way
        )
        raise InputError(
            f"{path}: it has no port of voltage and current in pu ({', '.join(other)}); {way}"
        )
    return found


def _prepared(text: str, wanted: WantedCase, names: Sequence[str]) -> list[PreparedScenario]:
    case: Case = case_of_text(text, tomllib.loads(text), wanted.out)
    return case.prepare(names)


def sources_of(files: Sequence[Path]) -> dict[str, Path]:
    """Key of the case file that names it → file."""
    found: dict[str, Path] = {}
    for path in files:
        suffix = path.suffix.lower()
        known = ", ".join([*_FILES, ".dyr", ".csv"])
        if not path.is_dir() and suffix not in (*_FILES, ".dyr", ".csv"):
            raise InputError(
                f"{path}: no network that is read; give a file {known}, or the folder of a CGMES model"
            )
        if not path.exists():
            near = close_names(path.name, [p.name for p in path.absolute().parent.glob("*")])
            raise InputError(f"{path}: there is no such file{f'; {near}' if near else ''}")
        key = (
            "cgmes"
            if path.is_dir()
            else "dyr"
            if suffix == ".dyr"
            else _FILES.get(suffix) or _table_of(path)
        )
        others = [k for k in found if "dyr" not in (k, key) and not {k, key} <= {*_TABLES}]
        if key in found or others:
            raise InputError(
                f"{path} and {found.get(key) or found[others[0]]}: a case has one of them; give one"
            )
        found[key] = path
    if not [key for key in found if key != "dyr"]:
        raise InputError("no network is given; name its file, such as own.raw, and with it own.dyr")
    if {*found} & {*_TABLES} and (
        lacks := [key for key in ("lines_file", "units") if key not in found]
    ):
        wanted = " and ".join(f"one with the columns {', '.join(_TABLES[key])}" for key in lacks)
        raise InputError(
            f"{', '.join(map(str, found.values()))}: of the tables of a network, {wanted} is missing"
        )
    if "dyr" in found and "raw" not in found:
        raise InputError(
            f"{found['dyr']}: dynamics data of PSS/E need the network's RAW file; give both"
        )
    return found


def _table_of(path: Path) -> str:
    columns = {*next(iter(rows_of(path, ())), ())}
    key = next((key for key, wanted in _TABLES.items() if columns >= {*wanted}), None)
    if key is None:
        kinds = "; ".join(", ".join(wanted) for wanted in _TABLES.values())
        raise InputError(
            f"{path}: no table of a network: none has its columns in line 1, or it has no row ({kinds})"
        )
    return key


@dataclass(frozen=True)
class _Place:
    """Where the converter goes, and what changes with it: machine that feeds less, its power before and now [MW]."""

    wanted: WantedConverter
    bus: str
    v_pu: float
    slack: str
    less: str | None = None
    before_mw: float = 0.0  # less what the converters before this one took over
    rating_mva: float = 1.0
    name: str = _CONVERTER
    injection: str = _INJECTION  # the same power without dynamics

    @property
    def left_mw(self) -> float:
        """Return what the machine still feeds."""
        return self.before_mw - self.wanted.p_mw

    @property
    def changed(self) -> dict[str, str]:
        """Values of every scenario with the converter."""
        if self.wanted.replaces or not self.less:
            return {}
        return {f"{self.less}.P_0": f"{self.left_mw / self.rating_mva:.6f}"}


def _with_names(places: Sequence[_Place]) -> tuple[_Place, ...]:
    """Several converters bear the names of their buses, ``gfor_9``, those at one bus with numbers, ``gfor_9_1``; one
    is ``gfor``."""
    if len(places) < 2:
        return tuple(places)
    at = Counter(place.bus for place in places)
    seen: Counter[str] = Counter()
    # a bus may be called as a numbered converter of another one is
    taken = {_of_bus(bus) for bus, count in at.items() if count == 1}
    found: list[_Place] = []
    for place in places:
        name = _of_bus(place.bus)
        if at[place.bus] > 1:
            numbers = itertools.count(seen[place.bus] + 1)
            seen[place.bus] = next(k for k in numbers if f"{name}_{k}" not in taken)
            name = f"{name}_{seen[place.bus]}"
            taken.add(name)
        found.append(replace(place, name=f"{_CONVERTER}_{name}", injection=f"{_INJECTION}_{name}"))
    return tuple(found)


def _of_bus(bus: str) -> str:
    return bus.removeprefix("bus_")


def _called(files: Sequence[Path]) -> dict[str, list[str]]:
    """The buses by the names that a RAW file gives them."""
    found: dict[str, list[str]] = {}
    raw = [path for path in files if path.suffix.lower() in (".raw", ".rawx")]
    for record in (record for path in raw for record in read_file(path).of("bus")):
        found.setdefault(record.text(1, "").strip(), []).append(
            bus_name(str(record.whole(0, "the bus' number")))
        )
    return found


def _place_for(
    wanted: WantedConverter,
    base: PreparedScenario,
    called: Mapping[str, Sequence[str]],
    others: Sequence[_Place] = (),
) -> _Place:
    network, flow = base.network, base.power_flow
    if network is None or flow is None:
        raise InputError("the network has no power flow")
    names = {
        wanted.bus,
        bus_name(wanted.bus),
        f"bus_{wanted.bus}",
        *called.get(wanted.bus, ()),
    } & set(network.buses)
    if len(names) != 1:
        hint = close_names(
            bus_name(wanted.bus), [*network.buses, *called], f"there are: {few(network.buses, 8)}"
        )
        raise InputError(f"--converter: the network has no bus {wanted.bus!r}; {hint}")
    (bus,) = names
    plans = base.system.components
    units = {port.name: port.bus for port in network.ports if port.name in plans}
    at_slack = [name for name, place in units.items() if place == flow.slack]
    found = _Place(wanted, bus, round(abs(flow.voltages[bus]), 5), ", ".join(at_slack))
    if wanted.less is None:
        return found
    if (
        len(
            there := [unit for unit, place in units.items() if place in called.get(wanted.less, ())]
        )
        == 1
    ):
        wanted = replace(wanted, less=there[0])
    if wanted.less not in units:
        known = f"the network's units: {', '.join(units)}"
        raise InputError(
            f"--converter: there is no unit {wanted.less!r} to feed less; "
            f"{close_names(str(wanted.less), units, known)}"
        )
    rating = plans[wanted.less].number("S_n")
    power = flow.powers[wanted.less].real * rating
    sharing = [one for one in others if one.less == wanted.less]
    if sharing and (wanted.replaces or sharing[-1].wanted.replaces):
        raise InputError(
            f"--converter: {wanted.less} is replaced, and another converter names it too; write "
            f"'less {wanted.less}' at both, or another machine"
        )
    power -= sum(one.wanted.p_mw for one in sharing)
    if wanted.replaces:
        if wanted.less in at_slack:
            raise InputError(
                f"--converter: instead of {wanted.less}: it is at the slack; replace another, or name "
                "another slack by --slack"
            )
        return replace(found, less=wanted.less, before_mw=power, rating_mva=rating)
    if wanted.less not in at_slack and abs(wanted.p_mw - power) < 1e-6:
        raise InputError(
            f"--converter: {wanted.less} would feed nothing; write 'instead of {wanted.less}'"
        )
    if wanted.p_mw > power + 1e-6:
        most = f"give the converter at most {power:.5g} MW, or leave the rest to the slack without 'less'"
        raise InputError(
            f"--converter: {wanted.less} feeds {power:.5g} MW and cannot feed {wanted.p_mw:g} MW less; {most}"
        )
    if wanted.less in at_slack:
        return found  # the slack feeds what is left, whatever it is given
    return replace(found, less=wanted.less, before_mw=power, rating_mva=rating)


class _Text:
    """The text of a case, without and with what the network's first power flow says."""

    def __init__(
        self,
        wanted: WantedCase,
        sources: dict[str, Path],
        base: PreparedScenario | None = None,
        places: Sequence[_Place] = (),
        pods: Mapping[str, bool] = MappingProxyType({}),
        fault_bus: str = "",
        moved: Mapping[str, tuple[float, float]] = MappingProxyType({}),
    ) -> None:
        self._pods, self.moved = pods, moved
        self._wanted, self._sources, self._base, self._places = wanted, sources, base, places
        self._stray, self._stray_why = _stray_capacitance(base) if base else (0.05, "")
        self._network = base.network if base else None
        self._fault_bus = fault_bus
        if places:
            self._fault_bus = places[0].bus
        elif self._network:
            self._fault_bus = _bus_of_largest(self._network.loads, self._network.buses)

    @property
    def fault_bus(self) -> str:
        """Return the bus of the scenario ``fault``; "" while it is not known."""
        return self._fault_bus

    def assumed(self, questions: int) -> list[str]:
        lines, device = [], self._wanted.device
        for p in self._places:
            w = p.wanted
            dispatch = f"the slack ({p.slack}) feeds {w.p_mw:g} MW less"
            if w.replaces:
                dispatch = f"{p.less} is gone ({p.before_mw:.5g} MW before); the slack ({p.slack}) feeds the difference"
            elif p.less:
                dispatch = f"{p.less} feeds {w.p_mw:g} MW less ({p.before_mw:.5g} before), with its rating and inertia"
            ours = "ours, with the POD gains of the paper's system (`gfor design` finds others)"
            what = ours if device is None else device.name
            called = "converter" if len(self._places) == 1 else p.name
            holding = f"at {p.bus} it holds the {p.v_pu:g} pu of the base"
            lines.append(f"{called}: {what}; {holding}; {dispatch}")
        if "dyr" not in self._sources:
            lines.append(
                "machines: no dynamics data, so all are a steam turbine's with exciter ST1: typical data"
            )
        elif self._wanted.kind == "phasor":
            lines.append(f"machines: {_EMF}")
        if "units" in self._sources:
            lines[-1] += (
                f"; slack {self._wanted.slack}, {self._wanted.frequency} (--slack, --frequency)"
            )
        lines.append(f"loads: {self._loads()}")
        lines += [f"controls: {self._moves()}"] if self._wanted.move_controls else []
        lines.append(
            f"models: {self._wanted.kind}; stray_B of EMT models: {self._stray:g} pu{self._stray_why}"
        )
        lines.append(f"fault: three-phase at {self._fault_bus}, 100 ms, nothing trips")
        beside = self._base.beside_file if self._base else None
        lines += [f"power flow: {beside.in_words}"] if beside else []
        if self._base is not None and (line := in_one_line(self._base.records)):
            lines.append(line + " (--details lists them)" * any(details(self._base.records)))
        more = f"{questions} question{'s' * (questions != 1)} about the data: comments at their lines in the file"
        return [*lines, more] if questions else lines

    def _moves(self) -> str:
        """Tell which taps and shunts moved, and that they do after an outage."""
        moves = [f"{name} {old:.4g} to {new:.4g}" for name, (old, new) in self.moved.items()]
        told = few(moves, _MOST_MOVES) if moves else "nothing had to move"
        return f"{told}; after an outage they move again (move_controls in [network])"

    def _positions(self) -> str:
        """Return the table of the case with the positions of what moved."""
        if not self.moved:
            return ""
        rows = [
            f"{name} = {new:.12g}    # {old:.6g} in the file"
            for name, (old, new) in self.moved.items()
        ]
        return "\n".join(["\n[components.grid.parameters]", *rows, ""])

    def _loads(self) -> str:
        """How the loads follow the voltage."""
        if self._tables():
            return "constant power; [network] load_model changes it"
        asked = (
            "constant impedance until [network] load_model says otherwise; `gfor modes` tells what power would "
            "change"
        )
        base = self._base
        if base is None or not base.recorded_loads:
            return asked
        recorded, network = base.recorded_loads, base.network
        names = {load.name for load in network.loads} if network else set()
        rest = f"; the others: {asked}" if names - recorded else ""
        return f"{len(recorded)} as their records in the DYR file say; [network] load_model goes before{rest}"

    def _path(self, path: Path) -> str:
        """Return a path as the file names it: relative where that is possible, with slashes everywhere."""
        try:
            return _quoted(
                Path(
                    os.path.relpath(path.absolute(), self._wanted.out.absolute().parent)
                ).as_posix()
            )
        except ValueError:  # on another drive
            return _quoted(path.absolute().as_posix())

    @property
    def text(self) -> str:
        w, places = self._wanted, self._places
        key = next(key for key in self._sources if key not in ("dyr", "units"))
        kind, other = w.kind, "phasor" if w.kind == "emt" else "emt"
        steps = {"emt": "100 us", "phasor": "2 ms"}
        stray = {
            "emt": f"stray_B = {self._stray:g}             # pu on 100 MVA{self._stray_why}\n",
            "phasor": "stray_B = 0                 # no bus needs any\n",
        }
        both = f'models = "{kind}"           # the same with the others: --set models={other}\n'
        rest = f"\n[{other}]                       # what --set models={other} takes instead\n"
        rest += f'step_size = "{steps[other]}"\n'
        kept = "\nkeep_load_parts = true      # IP, IQ stay constant currents, YP, YQ constant impedances"
        own = f"    # {_EMF}" if kind == "phasor" else ""
        dyr = "generator_parameters = { transformer.X_t = 0.0, transformer.R_t = 0.0 }    # the network has it"
        dyr = f"dyr = {self._path(self._sources['dyr'])}{own}" if "dyr" in self._sources else dyr
        dyr = (
            f"file = {self._path(self._sources['units'])}\n{dyr}"
            if "units" in self._sources
            else dyr
        )
        lines = self._network is not None and any(
            x.name.startswith("line_") for x in self._network.lines
        )
        return _TEMPLATE.format(
            command=w.command,
            name=_quoted(re.sub(r"[^0-9A-Za-z_]+", "_", w.out.stem).strip("_") or "case"),
            title=_quoted(self._sources[key].name + self._with_converters),
            source=_quoted(", ".join(path.name for path in self._sources.values())),
            models=both if w.device is None else "",
            step=steps[kind],
            record=', "grid.line_*.p"' * lines + "".join(f', "{place.name}.*"' for place in places),
            other=rest + stray[other] if w.device is None else "",
            slack=(f"\nslack = {_quoted(w.slack)}" if w.slack else "")
            + "\nreactive_limits = true" * w.reactive_limits,
            grid="grid" if kind == "emt" else "phasor_grid",
            moved=self._positions(),
            network=self._tables()
            or f"{key} = {self._path(self._sources[key])}"
            + kept * (key == "raw" and w.load_parts)
            + "\nmove_controls = true        # taps and switched shunts move after an outage"
            * w.move_controls,
            loads="" if self._tables() else "# ",
            more=(f"frequency = {_quoted(w.frequency)}\n" if w.frequency else "")
            + stray["emt"] * (kind == "emt")
            + (f"leave_out = {_toml_list(w.leave_out)}\n" if w.leave_out else ""),
            units=dyr
            + (f"\ndyr_leave_out = {_toml_list(w.dyr_leave_out)}" if w.dyr_leave_out else "")
            + "\ndyr_approximate = true" * w.dyr_approximate
            + (f"\nreplace = {_toml_list(w.replace)}" if w.replace else ""),
            generator="" if "dyr" in self._sources else "_st1",
            suffix="" if kind == "emt" else "_phasor",
            converter=self._converter(),
            scenarios="\n".join(
                "\n".join([*block, ""]) for block in [*self._scenarios(), *self._plots()]
            ),
        )

    def _tables(self) -> str:
        tables = [
            f"{k} = {self._path(self._sources[k])}"
            for k in ("lines_file", "loads_file")
            if k in self._sources
        ]
        if "buses" in self._sources:
            buses = [bus_name(row["bus"]) for row in rows_of(self._sources["buses"], ("bus",))]
            tables.append(f"buses = {_toml_list(buses)}")
        return "\n".join(tables)

    @property
    def _with_converters(self) -> str:
        """Where the converters are, as the end of a title."""
        if not self._places:
            return ""
        word = "a converter" if len(self._places) == 1 else "converters"
        return f" with {word} at {', '.join(place.bus for place in self._places)}"

    def _converter(self) -> str:
        return "".join(map(self._component, self._places))

    def _component(self, at: _Place) -> str:
        """The tables of one converter, and of the same power without dynamics."""
        w, device, place = self._wanted, self._wanted.device, at.wanted
        what = 'model = "gfor"' if w.kind == "emt" else 'model = "gfor_phasor"'
        if device is not None:
            what = f"{'dll' if w.is_dll else 'fmu'} = {self._path(device)}"
            what += f"\nbinding = {self._path(w.binding)}" if w.binding else ""
        if len(self._places) > 1:
            what += f"\nvendor = {_quoted(at.name)}    # for `gfor interactions`: whose make it is"
        power = f"P_0 = {place.p_mw / place.rating_mva:.6g}"
        values = f'S_n = "{place.rating_mva:g} MVA", {power}, v_0 = {at.v_pu:g}'
        without = values + "".join(
            f", pod_{x}.enabled = false" for x, starts in self._pods.items() if starts
        )
        still = f'model = "static_generation{"" if w.kind == "emt" else "_phasor"}"'
        parts = (
            (at.name, what, without, f"P_0 in parts of S_n: {place.p_mw:g} MW"),
            (
                at.injection,
                still,
                values,
                "the same power without dynamics, in [scenarios.dispatch]",
            ),
        )
        return "".join(
            f'\n[components.{name}]\n{kind}\nbus = "{at.bus}"\nparameters = {{ {given} }}    # {why}\n'
            for name, kind, given, why in parts
        )

    def _scenarios(self) -> list[list[str]]:
        devices = [x for place in self._places for x in (place.name, place.injection)]
        removed = [f"remove = {_toml_list(devices)}"] if devices else []
        found = [["[scenarios.base]", 'title = "As in the files"', *removed]]
        if self._base is None or self._network is None:
            return [*found, self._fault()] if self._fault_bus else found
        if self._places:
            without = "the device" if len(self._places) == 1 else "the devices"
            found.append(self._scenario("dispatch", f"Dispatch without {without}", beside=""))
            found.append(self._scenario("converter", f"Converter{'s' * (len(self._places) > 1)}"))
            found += [
                self._scenario(f"pod_{x}", f"POD-{x.upper()}", f"pod_{x}.enabled")
                for x in self._pods
            ]
        return [*found, self._fault()]

    def _fault(self) -> list[str]:
        fault = f'type = "bus_fault", time = "1 s", bus = "{self._fault_bus}", duration = "100 ms"'
        lines = sorted(
            self._network.lines if self._network else (),
            key=lambda x: (x.has_ratio, self._fault_bus not in (x.from_bus, x.to_bus)),
        )
        opening = (
            f'    # cleared_by = "{lines[0].name}" would open that line with it' if lines else ""
        )
        events = f"events = [{{ {fault} }}]{opening}"
        return [
            *self._scenario("fault", f"Fault of 100 ms at {self._fault_bus}", beside=""),
            events,
        ]

    def _scenario(
        self, name: str, title: str, enabled: str = "", beside: str = "dispatch"
    ) -> list[str]:
        places = self._places
        changed = {key: value for p in places for key, value in p.changed.items()}
        values = [f'"{key}" = {value}' for key, value in changed.items()]
        values += [f'"{p.name}.{enabled}" = true' for p in places if enabled]
        before: dict[str, float] = {}
        left: dict[str, float] = {}
        for p in (p for p in places if p.changed and p.less):
            before.setdefault(str(p.less), p.before_mw)
            left[str(p.less)] = p.left_mw
        less = "; ".join(f"{unit}: {mw:.5g} for {before[unit]:.5g} MW" for unit, mw in left.items())
        gone = [p.name if name == "dispatch" else p.injection for p in places]
        gone += [p.less for p in places if p.less and p.wanted.replaces]
        settings = [f"remove = {_toml_list(gone)}"] if gone else []
        told = f"beside = {_quoted(beside)}    # `gfor modes` tells what the device brings"
        settings += [told] if places and beside else []
        settings += (
            [f"set = {{ {', '.join(values)} }}{f'    # {less}' if less else ''}"] if values else []
        )
        return [f"[scenarios.{name}]", f'title = "{title}"', *settings]

    def _plots(self) -> list[list[str]]:
        if self._base is None or self._network is None:
            return []
        plans = self._base.system.components
        speeds = [
            f"{name}.omega" for name, plan in plans.items() if "omega" in plan.description.outputs
        ]
        with_units = {port.bus for port in self._network.ports}
        buses = [
            self._fault_bus,
            *(x for x in self._network.buses if x not in {*with_units, self._fault_bus}),
        ]
        found = [_plot("speeds", [(speeds, "Speed [pu]")])] if speeds else []
        found.append(_plot("voltages", [([f"grid.{bus}.v" for bus in buses], "v [pu]")]))
        if self._places:
            current = f"{'current_demand' if self._wanted.kind == 'emt' else 'current_limit'}"
            panels = [
                ([f"{place.name}.{signal}" for place in self._places], label)
                for signal, label in (
                    ("p", "p [pu]"),
                    ("q", "q [pu]"),
                    (current, "Current / limit"),
                )
            ]
            found.append(_plot("converter", panels[: 3 if self._wanted.device is None else 2]))
        return found


def _plot(name: str, panels: Sequence[tuple[Sequence[str], str]]) -> list[str]:
    lines = ["[[plots]]", f'name = "{name}"', f'title = "{name.capitalize()}"', "panels = ["]
    for signals, label in panels:
        also = f", also = {_toml_list(signals[1:_MOST_CURVES])}" if signals[1:] else ""
        lines.append(f"    {{ signal = {_quoted(signals[0])}{also}, label = {_quoted(label)} }},")
    return [*lines, "]"]


def _toml_list(names: Sequence[str]) -> str:
    return f"[{', '.join(map(_quoted, names))}]"


def _stray_capacitance(base: PreparedScenario) -> tuple[float, str]:
    """Capacitance [pu, 100 MVA] that EMT models need at buses without one, and why.

    Unit and bus swing at ω_b/√(X''·B), and exchange values once in a step H: H·ω_b/√(X''·B) ≤ 1 for the largest unit at
    a bus without capacitance."""
    network, plans = base.network, base.system.components
    if network is None:
        return 0.05, ""
    charged = {bus for line in network.lines if line.B > 0 for bus in (line.from_bus, line.to_bus)}
    charged |= {shunt.bus for shunt in network.shunts if shunt.b_mvar > 0}
    needed: dict[str, float] = {}
    for port in (port for port in network.ports if port.name in plans and port.bus not in charged):
        plan, z = plans[port.name], source_impedance(plans[port.name])
        X = abs(z) if z is not None else 0.15 * SYSTEM_BASE_MVA / plan.number("S_n")
        f_n = plan.number("f_n") if "f_n" in plan.description.variables else 50.0
        needed[port.name] = (2 * math.pi * f_n * _EMT_STEP) ** 2 / X
    if not needed:
        return 0.0, ", as every bus of a unit has a capacitance of its own"
    name = max(needed, key=needed.__getitem__)
    digits = 10 ** (math.floor(math.log10(needed[name])) - 1)
    return math.ceil(
        needed[name] / digits
    ) * digits, f", (ω_b·H)²/X'' of {name} at a bus without capacitance"


def _quoted(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'


def _commented(
    text: str, questions: Sequence[Problem], sources: dict[str, Path]
) -> tuple[str, list[int]]:
    """The text with every question as a comment above the line that it is about, and each line's new number."""
    lines = text.splitlines()
    above: dict[int, list[str]] = {}
    told = {
        ("" if one.place.startswith("line ") else f"{one.place}: ") + one.text: one
        for one in questions
    }
    for first, shown in by_kind(told, "gfor modes CASE --details").items():
        place = _line_of(told[first], lines, sources)
        above.setdefault(place, []).extend(
            textwrap.wrap(
                f"question: {shown}",
                116,
                initial_indent="# ",
                subsequent_indent="#   ",
                break_long_words=False,
            )
        )
    written: list[str] = []
    numbers = []
    for k, line in enumerate(lines):
        written += [*above.get(k, []), line]
        numbers.append(len(written))
    return "\n".join([*written, ""]), numbers


def _renumber(question: Problem, numbers: Sequence[int]) -> Problem:
    """Return a question at the line that has its key, by the new numbers of the lines."""
    found = _LINE.match(question.place)
    if found is None:
        return question
    number = numbers[int(found[1]) - 1]
    return replace(question, place=f"line {number}{question.place[found.end() :]}")


def _line_of(question: Problem, lines: Sequence[str], sources: dict[str, Path]) -> int:
    """Index of the line that a question is about: its own, that of the file that it names, else the first."""
    for key, path in sources.items():
        if path.name in question.place:
            return next(k for k, line in enumerate(lines) if line.startswith(f"{key} = "))
    found = _LINE.match(question.place)
    return int(found[1]) - 1 if found else 2
