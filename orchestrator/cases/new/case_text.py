"""Text of a new case: its tables, scenarios and plots, and comments that a person can read and change."""

import math
import os
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType

from fmus.grid.network import Load
from fmus.grid_following.dyr_approximation import MODEL as APPROXIMATION
from fmus.toolchain.port_variables import SYSTEM_BASE_MVA
from orchestrator.cases.flow.source_impedances import source_impedance
from orchestrator.cases.form.csv_rows import rows_of
from orchestrator.cases.networks.data import bus_name
from orchestrator.cases.networks.psse.dyr_mistakes import WITHOUT_RECORD, share_of_power
from orchestrator.cases.networks.psse.machine_model import STATIC
from orchestrator.cases.networks.record_use import details, in_one_line
from orchestrator.cases.new.converter_places import ConverterPlace
from orchestrator.cases.new.wanted_case import WantedCase
from orchestrator.cases.new.widened_limits import HEADROOM, WidenedLimit
from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.core.errors import few, number_of
from orchestrator.core.options import Option

_TEMPLATE = Path(__file__).with_suffix(".txt").read_text(encoding="utf-8")
_EMT_STEP = 1e-4  # [s]
_STEPS = {"emt": "100 us", "phasor": "2 ms"}
"""Communication step that a new case has, by the kind of its models."""

_MOST_CURVES = 12
_MOST_REPLACED = 3  # units that a title names; the others are counted
_MOST_MOVES = 5  # of taps and shunts that are named; the others are counted
_EMF = (
    """emf w·e''; [conventions] like = "psse" takes PSS/E's e'', which moves dampings by tenths of a point, of """
    "classical machines by up to about one"
)


def bus_of_largest_load(loads: Sequence[Load], buses: Sequence[str]) -> str:
    largest = max(loads, key=lambda load: load.p_mw, default=None)
    return largest.bus if largest else buses[0]


def _dispatch(place: ConverterPlace) -> str:
    """Return which unit feeds less or more with a converter, and by how much."""
    p_mw, slack = place.wanted.p_mw, f"the slack ({place.slack})"
    before = f"{place.before_mw:.5g}"
    if place.wanted.replaces:
        return f"{place.less} is gone ({before} MW before); {slack} feeds the difference"
    if not p_mw:
        return "it feeds 0 MW, so no MW moves: the Mvar that this voltage takes alone do"
    change = f"{abs(p_mw):g} MW {'less' if p_mw > 0 else 'more'}"
    if place.less:
        return f"{place.less} feeds {change} ({before} before), with its rating and inertia"
    return f"{slack} feeds {change}"


class CaseText:
    """The text of a case, without and with what the network's first power flow says."""

    def __init__(
        self,
        wanted: WantedCase,
        sources: dict[str, Path],
        base: PreparedScenario | None = None,
        places: Sequence[ConverterPlace] = (),
        pods: Mapping[str, bool] = MappingProxyType({}),
        fault_bus: str = "",
        moved: Mapping[str, tuple[float, float]] = MappingProxyType({}),
        widened: Sequence[WidenedLimit] = (),
    ) -> None:
        self._pods, self.moved, self.widened = pods, moved, widened
        self._wanted, self._sources, self._base, self._places = wanted, sources, base, places
        self._stray, self._stray_why = _stray_capacitance(base) if base else (0.05, "")
        self._network = base.network if base else None
        self._fault_bus = fault_bus
        if places:
            self._fault_bus = places[0].bus
        elif self._network:
            self._fault_bus = bus_of_largest_load(self._network.loads, self._network.buses)

    @property
    def fault_bus(self) -> str:
        """Return the bus of the scenario ``fault``; "" while it is not known."""
        return self._fault_bus

    def assumed(self, questions: int) -> list[str]:
        lines, device = [], self._wanted.device
        for p in self._places:
            ours = "ours, with the POD gains of the paper's system (`gfor design` finds others)"
            what = ours if device is None else device.name
            called = "converter" if len(self._places) == 1 else p.name
            holding = f"at {p.bus} it holds the {p.v_pu:g} pu of the base"
            lines.append(f"{called}: {what}; {holding}; {_dispatch(p)}")
        lines += self._about_replacements()
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
        lines += self._about_static()
        lines.append(f"loads: {self._loads()}")
        lines += [f"controls: {self._moves()}"] if self._wanted.move_controls else []
        if self.widened:
            lines.append(
                f"limits: {len(self.widened)} widened to {HEADROOM:g} pu beyond the operating point ("
                + Option.NO_WIDENED_LIMITS
                + " keeps them)"
            )
        lines.append(
            f"models: {self._wanted.kind}; stray_B of EMT models: {self._stray:g} pu{self._stray_why}"
        )
        lines.append(f"fault: three-phase at {self._fault_bus}, 100 ms, nothing trips")
        beside = self._base.beside_file if self._base else None
        lines += [f"power flow: {beside.in_words}"] if beside else []
        records = self._base.records if self._base else ()
        line = in_one_line(records)
        if line:
            lines.append(line + " (--details lists them)" * any(details(records)))
        more = f"{questions} question{'s' * (questions != 1)} about the data: comments at their lines in the file"
        return [*lines, more] if questions else lines

    @property
    def _approximation(self) -> str:
        """Tell that converters of the files are approximated, for the end of a title."""
        plans = self._base.system.components.values() if self._base else ()
        stands = any(plan.description.model_name == APPROXIMATION for plan in plans)
        return ", with WECC's converters approximated" if stands else ""

    @property
    def _replacements(self) -> str:
        """Tell which converters of ours stand in place of machines of the files, as the end of a title."""
        named = [f"gfor{unit} for unit {unit}" for unit in self._replaced_by_name]
        if WITHOUT_RECORD in self._wanted.replace:
            named.append("converters for machines without a record")
        return f", but with our {few(named, _MOST_REPLACED)}" if named else ""

    @property
    def _replaced_by_name(self) -> list[str]:
        return [unit for unit in self._wanted.replace if unit != WITHOUT_RECORD]

    def _about_replacements(self) -> list[str]:
        """Tell what converters of ours replace: each that is asked for by its unit, and the others together."""
        lines = [self._about_replacement(unit) for unit in self._replaced_by_name]
        if WITHOUT_RECORD not in self._wanted.replace or self._base is None:
            return lines
        fed = self._fed()
        table = self._base.case.table.units
        model = table.converter if table else ""
        by_name = {f"gfor{unit}" for unit in self._replaced_by_name}
        plans = self._base.system.components
        others = [x for x in fed if plans[x].description.model_name == model and x not in by_name]
        share = share_of_power(sum(fed[name] for name in others), sum(fed.values()))
        converters = number_of(len(others), "grid-forming converter")
        named = few(others, _MOST_REPLACED)
        told = f"machines without a record: {converters} of ours with a droop ({named}), {share}"
        return [*lines, told]

    def _about_replacement(self, unit: str) -> str:
        """Tell what a converter of ours replaces, and with how much power."""
        name = f"gfor{unit}"
        plan = self._base.system.components.get(name) if self._base else None
        fed = ""
        if plan is not None:
            fed = f" and its {plan.number('P_0') * plan.number('S_n'):.5g} MW"
        return (
            f"{name}: our grid-forming converter with a droop replaces unit {unit}{fed}; the records of its dynamics "
            "are not used"
        )

    def _about_static(self) -> list[str]:
        """Tell how much power comes from machines without a record, which are constant currents."""
        plans = self._base.system.components if self._base else {}
        fed = self._fed()
        static = [name for name in fed if plans[name].description.model_name == STATIC]
        share = share_of_power(sum(fed[name] for name in static), sum(fed.values()))
        if not static or not share:
            return []
        machines = number_of(len(static), "constant current")
        return [f"machines without a record: {machines}, {share}"]

    def _fed(self) -> dict[str, float]:
        """Return the active power of each unit in the base case [MW]."""
        plans = self._base.system.components if self._base else {}
        fed = dict[str, float]()
        for port in self._network.ports if self._network else ():
            plan = plans.get(port.name)
            if plan is not None and {"P_0", "S_n"} <= plan.description.variables.keys():
                fed[port.name] = plan.number("P_0") * plan.number("S_n")
        return fed

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

    def _limits(self) -> str:
        """Return the table of the case with the limits that are widened."""
        if not self.widened:
            return ""
        rows = [
            f"{x.name} = {x.taken:g}    # {x.given:g} in {self._sources['dyr'].name}; {x.at_start:.4g} at the start"
            for x in self.widened
        ]
        return "\n".join(["\n[units.widened_limits]", *rows, ""])

    def _loads(self) -> str:
        """How the loads follow the voltage."""
        if self._tables():
            return "constant power; [network] load_model changes it"
        asked = (
            "constant impedance until [network] load_model says otherwise; `gfor modes` tells what power would "
            "change"
        )
        base = self._base
        if base is None or not base.recorded_loads | base.told_loads:
            return asked
        recorded, network = base.recorded_loads, base.network
        told = base.told_loads - recorded
        names = {load.name for load in network.loads} if network else set()
        said = [f"{len(told)} as IP, IQ, YP and YQ of the RAW file say"] if told else []
        if recorded:
            records = f"{len(recorded)} as their records in the DYR file say"
            said.append(f"{records}; [network] load_model goes before")
        said += [f"the others: {asked}"] if names - recorded - told else []
        return "; ".join(said)

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
        w = self._wanted
        name = re.sub(r"[^0-9A-Za-z_]+", "_", w.out.stem).strip("_") or "case"
        sources = [path.name for path in self._sources.values()]
        tables = self._tables()
        scenarios = ["\n".join([*block, ""]) for block in [*self._scenarios(), *self._plots()]]
        grid, suffix = ("grid", "") if w.kind == "emt" else ("phasor_grid", "_phasor")
        return _TEMPLATE.format(
            command=w.command,
            name=_quoted(name),
            title=_quoted(self._sources[self._key].name + self._with_converters),
            source=_quoted(", ".join(sources)),
            models=self._models(),
            step=_STEPS[w.kind],
            record=self._record(),
            other=self._other_models(),
            slack=self._slack(),
            grid=grid,
            moved=self._positions(),
            network=tables or self._file_of_network(),
            loads="" if tables else "# ",
            more=self._about_network(),
            units=self._units(),
            generator="" if "dyr" in self._sources else "_st1",
            suffix=suffix,
            widened=self._limits(),
            converter=self._converter(),
            scenarios="\n".join(scenarios),
        )

    @property
    def _key(self) -> str:
        """The key of ``[network]`` that names the network's file."""
        return next(key for key in self._sources if key not in ("dyr", "seq", "units"))

    @property
    def _other_kind(self) -> str:
        """The models that the case does not take."""
        return "phasor" if self._wanted.kind == "emt" else "emt"

    def _models(self) -> str:
        """The line that chooses the models; none with a device, which is of one kind."""
        if self._wanted.device is not None:
            return ""
        other = f"# the same with the others: --set models={self._other_kind}"
        return f'models = "{self._wanted.kind}"           {other}\n'

    def _other_models(self) -> str:
        """The table that the other models take instead."""
        if self._wanted.device is not None:
            return ""
        other = self._other_kind
        heading = f"\n[{other}]                       # what --set models={other} takes instead\n"
        return f'{heading}step_size = "{_STEPS[other]}"\n{self._stray_line(other)}'

    def _stray_line(self, kind: str) -> str:
        if kind == "phasor":
            return "stray_B = 0                 # no bus needs any\n"
        return f"stray_B = {self._stray:g}             # pu on 100 MVA{self._stray_why}\n"

    def _record(self) -> str:
        """Further signals to record."""
        signals = []
        if self._fault_bus:
            signals.append("grid.*.fault.*")
        if self._network and any(x.name.startswith("line_") for x in self._network.lines):
            signals.append("grid.line_*.p")
        signals += [f"{place.name}.*" for place in self._places]
        return "".join(f', "{signal}"' for signal in signals)

    def _slack(self) -> str:
        """Further lines of ``[power_flow]``."""
        lines = ""
        if self._wanted.slack:
            lines += f"\nslack = {_quoted(self._wanted.slack)}"
        if self._wanted.reactive_limits:
            lines += "\nreactive_limits = true"
        return lines

    def _file_of_network(self) -> str:
        """The line of ``[network]`` that names its file, and how that is read."""
        lines = f"{self._key} = {self._path(self._sources[self._key])}"
        if self._key == "raw" and self._wanted.load_parts:
            lines += "\nkeep_load_parts = true      # IP, IQ stay constant currents, YP, YQ constant impedances"
        if self._wanted.move_controls:
            lines += "\nmove_controls = true        # taps and switched shunts move after an outage"
        return lines

    def _about_network(self) -> str:
        """The last lines of ``[network]``."""
        w, lines = self._wanted, self._sequences()
        if w.frequency:
            lines += f"frequency = {_quoted(w.frequency)}\n"
        if w.kind == "emt":
            lines += self._stray_line("emt")
        if w.leave_out:
            lines += f"leave_out = {_toml_list(w.leave_out)}\n"
        return lines

    def _units(self) -> str:
        """The first lines of ``[units]``: where the machines are from."""
        w, lines = self._wanted, ""
        if "units" in self._sources:
            lines += f"file = {self._path(self._sources['units'])}\n"
        if "dyr" not in self._sources:
            lines += "generator_parameters = { transformer.X_t = 0.0, transformer.R_t = 0.0 }    # the network has it"
        else:
            own = f"    # {_EMF}" if w.kind == "phasor" else ""
            lines += f"dyr = {self._path(self._sources['dyr'])}{own}"
        if w.dyr_leave_out:
            lines += f"\ndyr_leave_out = {_toml_list(w.dyr_leave_out)}"
        if w.dyr_approximate:
            lines += "\ndyr_approximate = true"
        if w.replace:
            lines += f"\nreplace = {_toml_list(w.replace)}"
        return lines

    def _sequences(self) -> str:
        """The line that names the file of the negative and the zero sequence."""
        if "seq" not in self._sources:
            return ""
        path = self._path(self._sources["seq"])
        return f"seq = {path}    # for faults of fewer than three phases\n"

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

    def _component(self, at: ConverterPlace) -> str:
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
        title = f"As in the files{self._approximation}{self._replacements}"
        found = [["[scenarios.base]", f"title = {_quoted(title)}", *removed]]
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
        why = f"    # {less}" if less else ""
        settings += [f"set = {{ {', '.join(values)} }}{why}"] if values else []
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
