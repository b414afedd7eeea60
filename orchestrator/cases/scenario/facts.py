"""One line on the content of a network's files, so that a reader sees at once what was computed."""

from dataclasses import dataclass

from fmus.grid.element_data import Load
from orchestrator.cases.flow.power_flow import PowerFlow
from orchestrator.cases.networks.load_models import in_words
from orchestrator.cases.scenario.drawing_devices import LOAD, drawn_mw, is_dc_terminal, with_motors
from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.core.errors import number_of
from orchestrator.core.units import whole_percent
from orchestrator.systems.coupling.system import ComponentPlan

# keys of ``[network]`` that name another program's data
SOURCES = ("raw", "matpower", "pandapower", "cgmes")


@dataclass(frozen=True)
class Facts:
    sources: tuple[str, ...]  # files, as the case names them
    # whether devices give the network an emf behind an admittance; else the models are EMT ones
    phasors: bool
    frequency_hz: float | None  # rated; None where no component has one
    # how many; units out of service do not count
    buses: int
    machines: int
    converters: int
    others: int  # devices of another kind, such as static var compensators
    motors: int  # devices that draw power as loads
    dc_terminals: int  # of DC lines with models of their own
    governed: bool  # whether a machine has a governor
    load_mw: float  # active power of all loads, without what feeds in [MW]
    load_model: str
    # units at the slack bus, with their power [MW] and their S_n [MVA]: the base of their data, MBASE in a RAW file
    slack: tuple[tuple[str, float, float], ...]
    voltages_pu: tuple[float, float]  # least and largest magnitude

    def sentence(self) -> str:
        counts = {
            "machine": self.machines,
            "converter": self.converters,
            "motor": self.motors,
            "DC terminal": self.dc_terminals,
            "other device": self.others,
        }
        parts = ["phasor models" if self.phasors else "EMT models"]
        if self.frequency_hz:
            parts.append(f"{self.frequency_hz:g} Hz")
        parts.append(number_of(self.buses, "bus"))
        parts += [number_of(count, kind) for kind, count in counts.items() if count]
        if self.machines and not self.governed:
            parts.append("no governor")
        parts.append(f"{self.load_mw:.5g} MW of load ({self.load_model})")
        if self.slack:
            units = [
                f"{name} at {p:.4g} MW ({whole_percent(p, S_n)} of S_n = {S_n:g} MVA)"
                for name, p, S_n in self.slack
            ]
            parts.append(f"slack {', '.join(units)}")
        parts.append("voltages {:.3g} to {:.3g} pu".format(*self.voltages_pu))
        return f"{', '.join(self.sources)}: {', '.join(parts)}"


def _is_governed(machine: ComponentPlan) -> bool:
    return any(v.startswith("governor.T_") for v in machine.description.variables)


def _feeding(name: str, unit: ComponentPlan, flow: PowerFlow) -> tuple[str, float, float]:
    """A unit's name, its power [MW] and its S_n [MVA]."""
    S_n = unit.number("S_n")
    return name, flow.powers[name].real * S_n, S_n


def facts_of(prepared: PreparedScenario) -> Facts | None:
    """The facts of a scenario whose network comes from another program's files; else None."""
    table, flow, network = prepared.case.table, prepared.power_flow, prepared.network
    if table.network is None or table.power_flow is None or flow is None or network is None:
        return None
    sources = tuple(file for key in SOURCES if (file := getattr(table.network, key)) is not None)
    if not sources:
        return None
    plans = prepared.system.components
    units = {p.name: p.bus for p in network.ports if p.name in plans}
    grid = plans[table.power_flow.grid]
    wanted = table.power_flow.slack or prepared.source_slack or ""
    feeding = [name for name in units if flow.powers.get(name)]
    at_slack = [name for name in feeding if units[name] == units.get(wanted, wanted)]
    machines = [n for n in feeding if plans[n].kind == "machine"]
    drawing = drawn_mw(plans)
    others = sum(plans[n].kind == LOAD for n in feeding)
    terminals = [n for n in feeding if is_dc_terminal(plans[n])]
    motors = sum(n in drawing for n in feeding)
    magnitudes = [abs(flow.voltages[bus]) for bus in network.buses]
    loads = [
        (x, grid.number(f"{x.name}.scale") * grid.number(f"{x.name}.P")) for x in network.loads
    ]
    drawn = [p for _, p in loads if p > 0]
    laws = _laws([load for load, p in loads if p > 0])
    dyr = [table.units.dyr] if table.units is not None and table.units.dyr is not None else []
    phasors = any(name.endswith(".y_re") for name in grid.description.inputs)
    return Facts(
        (*sources, *dyr),
        phasors,
        frequency_hz=rated_frequency(prepared),
        buses=len(network.buses),
        machines=len(machines),
        converters=len(feeding) - len(machines) - others,
        others=others - len(terminals) - motors,
        motors=motors,
        dc_terminals=len(terminals),
        governed=any(_is_governed(plans[n]) for n in machines),
        load_mw=sum(drawn) + sum(drawing.values()),
        load_model=with_motors(laws, plans),
        slack=tuple(_feeding(n, plans[n], flow) for n in at_slack),
        voltages_pu=(min(magnitudes), max(magnitudes)),
    )


def _laws(loads: list[Load]) -> str:
    return in_words(loads) if loads else ""


def rated_frequency(prepared: PreparedScenario) -> float | None:
    """Return the rated frequency that all components have in common [Hz]; None where none has one."""
    plans = prepared.system.components.values()
    return next((plan.number("f_n") for plan in plans if "f_n" in plan.description.variables), None)
