"""Meaning of the columns of a file of operating points, for one scenario."""

import fnmatch
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field

from orchestrator.cases.flow.sharing import load_of
from orchestrator.cases.form.build_choices import STAND_IN
from orchestrator.cases.form.names import SERVICE, STATES, close_names
from orchestrator.cases.form.schema import Value
from orchestrator.cases.form.values import convert
from orchestrator.cases.networks.element_names import ElementNames
from orchestrator.cases.networks.step_ups import own_branches
from orchestrator.cases.scenario.dc_lines import other_stations
from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.core.errors import InputError, few
from orchestrator.core.units import read_value
from orchestrator.systems.coupling.system import ComponentPlan

# ends of the names of columns
IN_SERVICE = "in_service"  # 1 or 0
ACTIVE = "P_mw"  # [MW]
REACTIVE = "Q_mvar"  # [Mvar]


@dataclass(frozen=True)
class Elements:
    """Elements of a scenario's network that a column or an outage can name."""

    grid: str
    units: Mapping[str, str]
    lines: tuple[str, ...]
    loads: tuple[str, ...]
    shunts: tuple[str, ...]
    slack: str
    balancing: tuple[str, ...] = ()  # units at the slack bus that feed what is left
    # branch whose loss is that of a unit alone → the unit
    step_ups: Mapping[str, str] = field(default_factory=dict)
    file: ElementNames = field(default_factory=ElementNames)  # names in the network's file
    # both buses of every branch with two ends
    ends: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    # stations of DC lines, each with the one at its other end
    other_ends: Mapping[str, str] = field(default_factory=dict)
    of_phasors: bool = False  # whether ends of lines can switch one by one

    @classmethod
    def of(cls, prepared: PreparedScenario) -> "Elements":
        network, table = prepared.network, prepared.case.table.power_flow
        if network is None or table is None:
            raise InputError(
                f"{prepared.case.source}: a screening needs a power flow of each operating point; give the case a "
                "[power_flow] table and a network"
            )
        switches = prepared.system.components[table.grid].description.variables
        units = {p.name: p.bus for p in network.ports if p.name in prepared.system.components}
        branches = [*(line.name for line in network.lines), *(x.name for x in network.transformers)]
        wanted = table.slack or prepared.source_slack or ""

        balancing = prepared.power_flow.balancing if prepared.power_flow else ()
        ends = {line.name: (line.from_bus, line.to_bus) for line in network.lines}

        def with_switch(names: Iterable[str]) -> tuple[str, ...]:
            return tuple(name for name in names if f"{name}.connected" in switches)

        return cls(
            grid=table.grid,
            units=units,
            lines=with_switch(branches),
            loads=tuple(load.name for load in network.loads),
            shunts=with_switch(shunt.name for shunt in network.shunts),
            slack=units.get(wanted, wanted),
            balancing=balancing,
            step_ups=own_branches(network, units),
            file=prepared.names,
            ends=ends,
            other_ends=other_stations(prepared.system, units),
            of_phasors=prepared.system.components[table.grid].is_of_phasors,
        )

    @property
    def names(self) -> tuple[str, ...]:
        return (*self.units, *self.lines, *self.loads, *self.shunts)

    def balancing_in(self, column: str) -> list[str]:
        """Those to which a column gives a power."""
        name, _, quantity = column.rpartition(".")
        given = [u for u in self.balancing if name == self.units[u] or fnmatch.fnmatchcase(u, name)]
        return given if quantity in (ACTIVE, "P_0") else []


@dataclass(frozen=True)
class Setting:
    values: Mapping[str, Value] = field(default_factory=dict)  # by ``component.variable``
    out: tuple[str, ...] = ()  # elements that are out of service
    scale: float | None = None  # factor of all loads that the cell gives; None where it gives none
    fed_scale: float | None = None  # the same of the loads that feed, which is static generation
    fed: tuple[tuple[str, ...], float] | None = None  # units that together feed a power [MW]
    # power that a load draws, by ``component.variable`` [MW, Mvar]
    drawn: Mapping[str, float] = field(default_factory=dict)


_PERCENT = 10.0  # factor of a power from which it looks like percent

Reading = Callable[[str], Setting]
"""What the text of a cell sets.

Raises `ValueError` where the text has no meaning in this column.
"""


def reading_of(column: str, elements: Elements, prepared: PreparedScenario) -> Reading:
    if column == "load":
        return lambda text: Setting(scale=_factor(column, text))
    if column == "generation":
        return lambda text: _generation(_factor(column, text), elements, prepared)
    if column == "static":
        return lambda text: _static(_part(column, text), elements, prepared)
    name, dot, quantity = column.partition(".")
    if (
        quantity in SERVICE
        and quantity != IN_SERVICE
        and name in {*elements.lines, *elements.loads, *elements.shunts}
    ):
        raise InputError(f"{name} is switched by the column {name}.{IN_SERVICE}, with 1 or 0")
    if dot and quantity == IN_SERVICE:
        return _service(column, name, elements, prepared)
    if dot and quantity in (ACTIVE, REACTIVE):
        return _power(column, name, quantity, elements, prepared)
    return _variable(column, prepared)


def _part(column: str, text: str) -> float:
    """A factor that may be 0: hours without wind are usual."""
    return 0.0 if _number(column, text) == 0 else _factor(column, text)


def _factor(column: str, text: str) -> float:
    """A factor of the case's own power; percent would be far above."""
    factor = _positive(column, text)
    if factor >= _PERCENT:
        raise ValueError(
            f"{column} = {text!r} is a factor of the case's own; write {factor / 100:g} for {factor:g} %"
        )
    return factor


def _service(column: str, name: str, elements: Elements, prepared: PreparedScenario) -> Reading:
    if name not in elements.names:
        hint = close_names(name, elements.names, f"there are: {few(elements.names, 8)}")
        raise InputError(f"there is no unit, line, load or shunt {name!r}; {hint}")

    def read(text: str) -> Setting:
        state = STATES.get(text.lower())
        if state is None:
            raise ValueError(f"{column} = {text!r}; it must be 1 or 0, true or false")
        return (
            Setting(_closing(column, name, elements, prepared)) if state else Setting(out=(name,))
        )

    return read


def _closing(
    column: str, name: str, elements: Elements, prepared: PreparedScenario
) -> dict[str, Value]:
    """The switches that are to be closed for an element that the case has out of service; none for one in service."""
    plans, grid = prepared.system.components, elements.grid
    if name in elements.loads:
        if not plans[grid].number(f"{name}.scale"):
            raise ValueError(
                f"{column} = 1, but the case has {name} off by its scale of 0; give {grid}.{name}.scale"
            )
        return {}
    switches = [
        (grid, f"{name}.connected"),
        *([(name, "connected")] if name in elements.units else []),
    ]
    found = [
        (owner, switch)
        for owner, switch in switches
        if switch in plans[owner].description.variables
    ]
    return {f"{owner}.{switch}": True for owner, switch in found if not plans[owner].value(switch)}


def _power(
    column: str, name: str, quantity: str, elements: Elements, prepared: PreparedScenario
) -> Reading:
    if name in elements.loads:
        variable = f"{name}.{'P' if quantity == ACTIVE else 'Q'}"
        if variable not in prepared.system.components[elements.grid].description.variables:
            raise InputError(
                f"the load {name} was built without reactive power, which cannot be given it here"
            )
        return lambda text: Setting(drawn={f"{elements.grid}.{variable}": _number(column, text)})
    members = tuple(unit for unit, bus in elements.units.items() if name in (unit, bus))
    if not members:
        known = (*elements.units, *dict.fromkeys(elements.units.values()), *elements.loads)
        raise InputError(
            f"there is no unit, bus with a unit, or load {name!r}; {close_names(name, known, '')}"
        )
    if quantity == REACTIVE:
        raise InputError(
            f"the reactive power of {name} follows from its voltage in the power flow; set {name}.v_0"
        )
    return lambda text: Setting(fed=(members, _number(column, text)))


def least_scale(load: str, grid: ComponentPlan) -> float:
    """The scale of a load that is off: 0, or the trace that keeps a voltage which it alone determines."""
    return max(0.0, grid.description.variables[f"{load}.scale"].minimum or 0.0)


def own_power(column: str, elements: Elements, prepared: PreparedScenario) -> float | None:
    """Return what a column of powers gives in the case itself [MW, Mvar]; None for another column."""
    name, _, quantity = column.partition(".")
    if quantity == ACTIVE and name not in elements.loads:
        plans = {
            unit: prepared.system.components[unit]
            for unit, bus in elements.units.items()
            if name in (unit, bus)
        }
        return sum(
            _dispatched(prepared, unit, plan) * float(plan.number("S_n"))
            for unit, plan in plans.items()
        )
    if quantity not in (ACTIVE, REACTIVE):
        return None
    grid = prepared.system.components[elements.grid]
    return grid.number(f"{name}.{'P' if quantity == ACTIVE else 'Q'}") * grid.number(
        f"{name}.scale"
    )


def _generation(factor: float, elements: Elements, prepared: PreparedScenario) -> Setting:
    plans = {
        u: prepared.system.components[u] for u in elements.units if u not in elements.balancing
    }
    return Setting(
        {f"{unit}.P_0": factor * _dispatched(prepared, unit, plan) for unit, plan in plans.items()}
    )


def _static(factor: float, elements: Elements, prepared: PreparedScenario) -> Setting:
    plans = {u: prepared.system.components[u] for u in elements.units}
    values = {
        f"{unit}.P_0": factor * _dispatched(prepared, unit, plan)
        for unit, plan in plans.items()
        if plan.description.model_name.startswith(STAND_IN) and unit not in elements.balancing
    }
    return Setting(values, fed_scale=factor)


def feeding_loads(elements: Elements, prepared: PreparedScenario) -> dict[str, float]:
    """The loads of the case that feed, and what each feeds [MW], without those in the place of DC lines."""
    grid = prepared.system.components[elements.grid]
    own = [name for name in elements.loads if name not in prepared.device_loads]
    drawn = {name: load_of([name], grid) for name in own}
    return {name: -power for name, power in drawn.items() if power < 0}


def _dispatched(prepared: PreparedScenario, unit: str, plan: ComponentPlan) -> float:
    flow = prepared.power_flow
    return flow.powers[unit].real if flow is not None else plan.number("P_0")


def _variable(column: str, prepared: PreparedScenario) -> Reading:
    pattern, dot, variable = column.partition(".")
    plans = {n: p for n, p in prepared.system.components.items() if fnmatch.fnmatchcase(n, pattern)}
    if not dot or not plans:
        raise InputError(
            "it is none of time, name, hours, load, generation, static, ELEMENT.in_service, UNIT.P_mw, LOAD.P_mw, "
            f"LOAD.Q_mvar, and no component.variable; components: {', '.join([*prepared.system.components][:6])} …"
        )
    infos = {
        n: found
        for n, p in plans.items()
        if (found := p.description.variables.get(variable)) is not None
    }
    if not infos:
        known = next(iter(plans.values())).description.parameters
        raise InputError(
            f"{pattern} has no parameter {variable!r}; {close_names(variable, known, '`gfor fmu info`')}"
        )
    # Each component by its own name: other columns look up what they share with this one.
    return lambda text: Setting(
        {f"{n}.{variable}": convert(info, read_value(text)) for n, info in infos.items()}
    )


def _number(column: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not abs(value) < float("inf"):
        raise ValueError(f"{column} = {text!r} is not a number")
    return value


def _positive(column: str, text: str) -> float:
    value = _number(column, text)
    if not value > 0:
        raise ValueError(f"{column} = {text}; it must exceed 0")
    return value
