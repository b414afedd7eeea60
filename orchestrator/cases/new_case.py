"""A case file from a network's files: scenarios, plots and comments that a person can read and change."""

import math
import os
import re
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from fmus.toolchain.port_variables import SYSTEM_BASE_MVA
from orchestrator.cases.case import Case, case_of_text
from orchestrator.cases.names import close_names
from orchestrator.cases.network_data import bus_name
from orchestrator.cases.prepare import PreparedScenario
from orchestrator.cases.short_circuit import source_impedance
from orchestrator.errors import InputError, Problem
from orchestrator.units import to_unit

_FILES = {".raw": "raw", ".m": "matpower", ".mat": "matpower", ".json": "pandapower", ".zip": "cgmes"}
_STEPS = {"emt": "100 us", "phasor": "2 ms"}
_EMT_STEP = 1e-4
_CURRENT = {"emt": "current_demand", "phasor": "current_limit"}
_MOST_CURVES = 12
_LONGEST_COMMENT = 150


@dataclass(frozen=True)
class WantedConverter:
    """``bus 9, 300 MVA, 200 MW, less sg3``; ``less`` is the machine that feeds so much less."""

    bus: str
    rating_mva: float
    p_mw: float
    less: str | None = None


@dataclass(frozen=True)
class WantedCase:
    """What `gfor new` is asked for.

    Attributes
    ----------
    files
        Network, and perhaps dynamics data.
    device, binding, is_dll
        A vendor's file in place of our converter.
    models
        ``emt`` or ``phasor``; None chooses.
    command
        As it was typed, for the first line of the file.
    """

    files: tuple[Path, ...]
    out: Path
    converter: WantedConverter | None = None
    device: Path | None = None
    binding: Path | None = None
    is_dll: bool = False
    models: str | None = None
    frequency: str | None = None
    leave_out: tuple[str, ...] = ()
    dyr_leave_out: tuple[str, ...] = ()
    command: str = "gfor new"

    @property
    def kind(self) -> str:
        """A vendor's file has no phasor form."""
        return self.models or ("phasor" if self.device is None else "emt")


@dataclass(frozen=True)
class NewCase:
    """The text of a case, and what was assumed in it."""

    text: str
    assumed: tuple[str, ...]
    scenarios: tuple[str, ...]


def read_converter(text: str) -> WantedConverter:
    """Read ``bus 9, 300 MVA, 200 MW, less sg3``, in any order.

    Raises
    ------
    InputError
        With what is missing, given twice or not understood.
    """
    how = "write it like 'bus 9, 300 MVA, 200 MW, less sg3' (the last part may be left out)"
    found: dict[str, str] = {}
    for part in (part.strip() for part in text.split(",")):
        quantity = re.fullmatch(r"[-+\d.eE]+\s*(MVA|GVA|kVA|MW|GW|kW)", part)
        word, _, rest = part.partition(" ")
        if quantity is not None:
            key = "MVA" if quantity[1].endswith("VA") else "MW"
        elif word in ("bus", "less") and rest.strip():
            key = word
        elif re.fullmatch(r"bus_\w+", part):
            key, rest = "bus", part
        else:
            raise InputError(f"--converter {text!r}: {part!r} is not understood; {how}")
        if key in found:
            raise InputError(f"--converter {text!r}: {key} is given twice; {how}")
        found[key] = part if quantity is not None else rest.strip()
    missing = {"bus": "bus", "MVA": "rating in MVA", "MW": "power in MW"}
    if lacks := [words for key, words in missing.items() if key not in found]:
        raise InputError(f"--converter {text!r}: the {' and the '.join(lacks)} is missing; {how}")
    rating, power = to_unit(found["MVA"], "MVA"), to_unit(found["MW"], "MW")
    if not 0 < rating < math.inf or not abs(power) <= rating:
        raise InputError(f"--converter {text!r}: {power:g} MW with a rating of {rating:g} MVA; {how}")
    return WantedConverter(found["bus"], rating, power, found.get("less"))


def write_case(wanted: WantedCase) -> NewCase:
    """Compose a case, with the questions about its data as comments at their lines.

    Raises
    ------
    InputError
        If a file, a bus or a machine cannot be used; as a case of these files would be refused.
    """
    sources = _sources(wanted.files)
    base = _prepared(_Text(wanted, sources).text, wanted, ["base"])[0]
    place = None if wanted.converter is None else _placed(wanted.converter, base)
    draft = _Text(wanted, sources, base, place)
    scenarios = _prepared(draft.text, wanted, [])
    questions = dict.fromkeys(q for prepared in scenarios for q in prepared.questions)
    text = _commented(draft.text, list(questions), sources)
    return NewCase(text, tuple(draft.assumed(len(questions))), tuple(p.name for p in scenarios))


def _prepared(text: str, wanted: WantedCase, names: Sequence[str]) -> list[PreparedScenario]:
    case: Case = case_of_text(text, tomllib.loads(text), wanted.out)
    return case.prepare(names)


def _sources(files: Sequence[Path]) -> dict[str, Path]:
    """Key of the case file that names it → file."""
    found: dict[str, Path] = {}
    for path in files:
        key = "cgmes" if path.is_dir() else "dyr" if path.suffix.lower() == ".dyr" else _FILES.get(path.suffix.lower())
        if key is None:
            known = ", ".join([*_FILES, ".dyr"])
            raise InputError(f"{path}: no network that is read; give a file {known}, or the folder of a CGMES model")
        if not path.exists():
            near = close_names(path.name, [p.name for p in path.absolute().parent.glob("*")])
            raise InputError(f"{path}: there is no such file{f'; {near}' if near else ''}")
        networks = [k for k in found if k != "dyr"]
        if key in found or (key != "dyr" and networks):
            raise InputError(f"{path} and {found.get(key) or found[networks[0]]}: a case has one of them; give one")
        found[key] = path
    if not [key for key in found if key != "dyr"]:
        raise InputError("no network is given; name its file, such as own.raw, and with it own.dyr")
    if "dyr" in found and "raw" not in found:
        raise InputError(f"{found['dyr']}: dynamics data of PSS/E need the network's RAW file; give both")
    return found


@dataclass(frozen=True)
class _Place:
    """Where the converter goes, and what changes with it: machine that feeds less, its power before and now [MW]."""

    wanted: WantedConverter
    bus: str
    v_pu: float
    slack: str
    less: str | None = None
    before_mw: float = 0.0
    rating_mva: float = 1.0

    @property
    def changed(self) -> dict[str, float]:
        """Values of every scenario with the converter."""
        if self.less is None:
            return {}
        return {f"{self.less}.P_0": round((self.before_mw - self.wanted.p_mw) / self.rating_mva, 6)}


def _placed(wanted: WantedConverter, base: PreparedScenario) -> _Place:
    network, flow = base.network, base.power_flow
    if network is None or flow is None:
        raise InputError("the network has no power flow")
    names = {wanted.bus, bus_name(wanted.bus), f"bus_{wanted.bus}"} & set(network.buses)
    if len(names) != 1:
        hint = close_names(bus_name(wanted.bus), network.buses, f"there are: {', '.join(network.buses[:8])}")
        raise InputError(f"--converter: the network has no bus {wanted.bus!r}; {hint}")
    (bus,) = names
    plans = base.system.components
    units = {port.name: port.bus for port in network.ports if port.name in plans}
    at_slack = [name for name, place in units.items() if place == flow.slack]
    found = _Place(wanted, bus, round(abs(flow.voltages[bus]), 5), ", ".join(at_slack))
    if wanted.less is None:
        return found
    if wanted.less not in units:
        known = f"the network's units: {', '.join(units)}"
        raise InputError(f"--converter: there is no unit {wanted.less!r} to feed less; "
                         f"{close_names(wanted.less, units, known)}")  # fmt: skip
    rating = plans[wanted.less].number("S_n")
    power = flow.powers[wanted.less].real * rating
    if wanted.p_mw > power + 1e-6:
        raise InputError(
            f"--converter: {wanted.less} feeds {power:.5g} MW and cannot feed {wanted.p_mw:g} MW less; give the converter "
            f"at most {power:.5g} MW, or leave the rest to the slack without 'less'"
        )
    if wanted.less in at_slack:
        return found  # the slack feeds what is left, whatever it is given
    return replace(found, less=wanted.less, before_mw=power, rating_mva=rating)


class _Text:
    """The lines of a case, without and with what the network's first power flow says."""

    def __init__(
        self,
        wanted: WantedCase,
        sources: dict[str, Path],
        base: PreparedScenario | None = None,
        place: _Place | None = None,
    ) -> None:
        self._wanted, self._sources, self._base, self._place = wanted, sources, base, place
        self._kind = wanted.kind
        self._stray, self._stray_why = _stray_capacitance(base) if base else (0.05, "")

    @property
    def text(self) -> str:
        blocks = [self._head(), self._solver(), self._network(), self._units(), self._converter(), self._scenarios()]
        blocks += [self._analysis()]
        return "\n".join(line for block in blocks for line in [*block, ""] if block).rstrip() + "\n"

    def assumed(self, questions: int) -> list[str]:
        """What was assumed, five lines at most."""
        lines = ["loads: PL, QL of constant power, as the file's own power flow has them; [network] load_model changes it"]
        if self._place is not None:
            p, w = self._place, self._place.wanted
            dispatch = f"the slack ({p.slack}) feeds {w.p_mw:g} MW less"
            if p.less:
                dispatch = f"{p.less} feeds {w.p_mw:g} MW less ({p.before_mw:.5g} MW before) and keeps rating and inertia"
            what = self._wanted.device.name if self._wanted.device else "our converter with droop, a stiff DC side"
            lines.append(f"converter: {what}, at {p.bus}, holds the {p.v_pu:g} pu of the base; {dispatch}")
            if self._wanted.device is None:
                lines.append("POD: gains of the paper's system; `gfor design` finds those of this one")
        if "dyr" not in self._sources:
            lines.append("machines: no dynamics data, so all are a typical steam turbine's with ST1 exciter and governor")
        lines.append(f"models: {self._kind}; for EMT stray_B = {self._stray:g} pu{self._stray_why}")
        lines.append(f"fault: three-phase at {self._fault_bus}, 100 ms, nothing trips")
        if questions:
            lines[-1] += f"; {questions} questions about the data stand at their lines in the file"
        return lines

    @property
    def _other(self) -> str:
        return "emt" if self._kind == "phasor" else "phasor"

    @property
    def _fault_bus(self) -> str:
        if self._place is not None:
            return self._place.bus
        network = self._base.network if self._base else None
        if network is None:
            return ""
        largest = max(network.loads, key=lambda load: load.p_mw, default=None)
        return largest.bus if largest is not None else network.buses[0]

    def _path(self, path: Path) -> str:
        """As the file names it: relative where that is possible, with slashes everywhere."""
        try:
            shown = os.path.relpath(path.absolute(), self._wanted.out.absolute().parent)
        except ValueError:  # on another drive
            shown = str(path.absolute())
        return _quoted(Path(shown).as_posix())

    def _head(self) -> list[str]:
        network = next(path for key, path in self._sources.items() if key != "dyr")
        name = re.sub(r"\W+", "_", self._wanted.out.stem).strip("_") or "case"
        where = f" with a converter at {self._place.bus}" if self._place else ""
        both = [] if self._wanted.device is not None else [
            f"models = {_quoted(self._kind)}{' ' * 12}# the same with the others: --set models={self._other}"
        ]  # fmt: skip
        return [
            f"# Written by: {self._wanted.command}",
            "# Change what you like. What each key means: orchestrator/cases/README.md",
            f"name = {_quoted(name)}",
            f"title = {_quoted(network.name + where)}",
            f"source = {_quoted(', '.join(path.name for path in self._sources.values()))}",
            *both,
        ]

    def _solver(self) -> list[str]:
        devices = ["gfor.*"] if self._place else []
        record = ["*.omega", "grid.*.v", *(["grid.line_*.p"] if self._has_lines else []), *devices]
        lines = [
            "[solver]",
            f"step_size = {_quoted(_STEPS[self._kind])}",
            'stop_time = "10 s"',
            'record_interval = "10 ms"',
            f"record = [{', '.join(map(_quoted, record))}]",
        ]
        if self._wanted.device is None:
            lines += ["", f"[{self._other}]{' ' * 20}# what these models take instead",
                      f"step_size = {_quoted(_STEPS[self._other])}"]  # fmt: skip
            stray = self._stray if self._other == "emt" else 0.0
            lines.append(f"stray_B = {stray:g}{' ' * 10}# {_why_stray(stray, self._stray_why)}")
        return [*lines, "", "[power_flow]", 'grid = "grid"', "", "[components.grid]",
                f'model = "{"grid" if self._kind == "emt" else "phasor_grid"}"']  # fmt: skip

    @property
    def _has_lines(self) -> bool:
        network = self._base.network if self._base else None
        return network is not None and any(line.name.startswith("line_") for line in network.lines)

    def _network(self) -> list[str]:
        (key,) = (key for key in self._sources if key != "dyr")
        lines = ["[network]", f"{key} = {self._path(self._sources[key])}"]
        if key == "raw":
            lines.append("keep_load_parts = true      # IP, IQ stay constant currents, YP, YQ constant impedances")
        lines.append('load_model = { active = "power", reactive = "power" }    # or "current", "impedance"')
        if self._wanted.frequency:
            lines.append(f"frequency = {_quoted(self._wanted.frequency)}")
        if self._kind == "emt":
            lines.append(f"stray_B = {self._stray:g}{' ' * 10}# {_why_stray(self._stray, self._stray_why)}")
        if self._wanted.leave_out:
            lines.append(f"leave_out = [{', '.join(map(_quoted, self._wanted.leave_out))}]")
        return lines

    def _units(self) -> list[str]:
        suffix = "" if self._kind == "emt" else "_phasor"
        dyr = self._sources.get("dyr")
        lines = ["[units]", *([f"dyr = {self._path(dyr)}"] if dyr else [])]
        if self._wanted.dyr_leave_out:
            lines.append(f"dyr_leave_out = [{', '.join(map(_quoted, self._wanted.dyr_leave_out))}]")
        machine = "synchronous_generator" if dyr else "synchronous_generator_st1"
        lines += [
            f'generator = "{machine}{suffix}"',
            f'converter = "gfor{suffix}"      # of a unit only where --set units.alpha.N=0.3 gives it a share',
        ]
        if not dyr:
            lines.append("generator_parameters = { transformer.X_t = 0.0, transformer.R_t = 0.0 }    # the network has them")
        return lines

    def _converter(self) -> list[str]:
        if self._place is None:
            return []
        p, wanted = self._place, self._place.wanted
        device = self._wanted.device
        if device is None:
            what = [f'model = "gfor{"" if self._kind == "emt" else "_phasor"}"']
        else:
            what = [f"{'dll' if self._wanted.is_dll else 'fmu'} = {self._path(device)}"]
            what += [f"binding = {self._path(self._wanted.binding)}"] if self._wanted.binding else []
        power = round(wanted.p_mw / wanted.rating_mva, 6)
        values = f"S_n = {_quoted(f'{wanted.rating_mva:g} MVA')}, P_0 = {power:g}, v_0 = {p.v_pu:g}"
        return [
            "[components.gfor]",
            *what,
            f'bus = "{p.bus}"',
            f"parameters = {{ {values} }}    # P_0 in parts of S_n: {wanted.p_mw:g} MW",
        ]

    def _scenarios(self) -> list[str]:
        base = ["[scenarios.base]", 'title = "As in the files"', *(['remove = ["gfor"]'] if self._place else [])]
        if self._base is None:
            return base
        lines = [*base, ""]
        changed = self._place.changed if self._place else {}
        if self._place is not None:
            lines += [*self._scenario("converter", "Converter", changed), ""]
            if self._wanted.device is None:
                for pod, title in (("pod_p", "Converter with POD-P"), ("pod_q", "Converter with POD-Q")):
                    lines += [*self._scenario(pod, title, {**changed, f"gfor.{pod}.enabled": True}), ""]
        lines += self._scenario("fault", f"Fault of 100 ms at {self._fault_bus}", changed)
        event = f'{{ type = "bus_fault", time = "1 s", bus = "{self._fault_bus}", duration = "100 ms" }}'
        return [*lines, f"events = [{event}]    # a line that opens with it: cleared_by = {_quoted(self._example_line)}"]

    @property
    def _example_line(self) -> str:
        network = self._base.network if self._base else None
        lines = network.lines if network else ()
        near = [line.name for line in lines if self._fault_bus in (line.from_bus, line.to_bus) and not line.has_ratio]
        return near[0] if near else lines[0].name if lines else "line_1_2"

    def _scenario(self, name: str, title: str, values: dict[str, float | bool]) -> list[str]:
        shown = ", ".join(f'"{key}" = {str(v).lower() if isinstance(v, bool) else v}' for key, v in values.items())
        less = ""
        if self._place and self._place.less:
            less = f"    # {self._place.before_mw - self._place.wanted.p_mw:.5g} MW in place of {self._place.before_mw:.5g} MW"
        return [f"[scenarios.{name}]", f"title = {_quoted(title)}", *([f"set = {{ {shown} }}{less}"] if values else [])]

    def _analysis(self) -> list[str]:
        if self._base is None or self._base.network is None:
            return []
        plans = self._base.system.components
        machines = [name for name, plan in plans.items() if "omega" in plan.description.outputs][:_MOST_CURVES]
        speeds = [f"{name}.omega" for name in machines]
        lines = _plot("speeds", "Speeds", [(speeds, "Speed [pu]")]) if speeds else []
        units = [port.bus for port in self._base.network.ports]
        buses = [bus for bus in self._base.network.buses if bus not in units] or list(self._base.network.buses)
        first = [self._fault_bus, *(bus for bus in buses if bus != self._fault_bus)][:_MOST_CURVES]
        lines += _plot("voltages", "Voltages", [([f"grid.{bus}.v" for bus in first], "v [pu]")])
        if self._place is not None:
            panels = [(["gfor.p"], "p [pu]"), (["gfor.q"], "q [pu]")]
            if self._wanted.device is None:
                panels.append(([f"gfor.{_CURRENT[self._kind]}"], "Current / limit"))
            lines += _plot("converter", "Converter", panels)
        return lines[:-1]


def _plot(name: str, title: str, panels: Sequence[tuple[Sequence[str], str]]) -> list[str]:
    def panel(signals: Sequence[str], label: str) -> str:
        also = f", also = [{', '.join(map(_quoted, signals[1:]))}]" if signals[1:] else ""
        return f"    {{ signal = {_quoted(signals[0])}{also}, label = {_quoted(label)} }},"

    return ["[[plots]]", f'name = "{name}"', f"title = {_quoted(title)}", "panels = [",
            *(panel(signals, label) for signals, label in panels), "]", ""]  # fmt: skip


def _stray_capacitance(base: PreparedScenario) -> tuple[float, str]:
    """Capacitance [pu, 100 MVA] that EMT models need at buses without one, and why.

    Unit and bus swing at ω_b/√(X''·B); their values meet once in a step H, so H·ω_b/√(X''·B) is kept at 1 or below for
    the largest unit at a bus without capacitance.
    """
    network, plans = base.network, base.system.components
    if network is None:
        return 0.05, ""
    charged = {bus for line in network.lines if line.B > 0 for bus in (line.from_bus, line.to_bus)}
    charged |= {shunt.bus for shunt in network.shunts if shunt.b_mvar > 0}
    worst, name = 0.0, ""
    for port in (port for port in network.ports if port.name in plans and port.bus not in charged):
        z = source_impedance(plans[port.name])
        X = abs(z) if z is not None else 0.15 * SYSTEM_BASE_MVA / plans[port.name].number("S_n")
        f_n = plans[port.name].number("f_n") if "f_n" in plans[port.name].description.variables else 50.0
        needed = (2 * math.pi * f_n * _EMT_STEP) ** 2 / X
        worst, name = max((worst, name), (needed, port.name))
    if not name:
        return 0.0, ": every bus of a unit has a capacitance of its own"
    digits = 10 ** (math.floor(math.log10(worst)) - 1)
    return math.ceil(worst / digits) * digits, f", for {name} at a bus without capacitance: (ω_b·H)²/X'' at 100 us"


def _why_stray(stray: float, why: str) -> str:
    return f"pu on 100 MVA{why}" if stray else "no bus needs any"


def _quoted(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'


def _commented(text: str, questions: Sequence[Problem], sources: dict[str, Path]) -> str:
    """The text with every question as a comment above the line that it is about."""
    lines = text.splitlines()
    above: dict[int, list[str]] = {}
    for question in questions:
        place = _line_of(question, lines, sources)
        said = str(question)
        said = said if len(said) <= _LONGEST_COMMENT else f"{said[: _LONGEST_COMMENT - 2].rstrip()} …"
        above.setdefault(place, []).append(f"# question: {' '.join(said.split())}")
    return "\n".join(part for k, line in enumerate(lines) for part in [*above.get(k, []), line]) + "\n"


def _line_of(question: Problem, lines: Sequence[str], sources: dict[str, Path]) -> int:
    """Index of the line that a question is about: its own, that of the file that it names, else the first."""
    for key, path in sources.items():
        if path.name in question.place:
            return next(k for k, line in enumerate(lines) if line.startswith(f"{key} = "))
    found = re.match(r"line (\d+)", question.place)
    return int(found[1]) - 1 if found else 2
