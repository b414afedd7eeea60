"""From a case's tables and one scenario to a system that can run, with every mistake collected on the way."""

import difflib
import fnmatch
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

from fmus.grid.network import Network, Port
from fmus.toolchain.catalogue import build_model, model_names, network_of
from fmus.toolchain.python_fmu import cached
from orchestrator.cases.event_tables import event_of
from orchestrator.cases.network_data import UNIT_KINDS, network_elements, unit_components, unit_rows
from orchestrator.cases.parameter_files import ParameterFile, read_parameter_file
from orchestrator.cases.power_flow import PowerFlow
from orchestrator.cases.schema import (
    CaseTable,
    ComponentTable,
    ScenarioTable,
    UnitsTable,
    Value,
)
from orchestrator.cases.start_values import start_from_power_flow
from orchestrator.cases.values import convert, flatten
from orchestrator.coupling.clock import Clock
from orchestrator.coupling.events import Event, ParameterChange
from orchestrator.coupling.schedule import Schedule, gauss_seidel, jacobi
from orchestrator.coupling.system import Endpoint, System
from orchestrator.errors import InputError, Problem
from orchestrator.fmi.description import FmuDescription, VariableInfo, read_description

Place = Callable[..., str]
Layer = tuple[Mapping[str, Value], Callable[[str], str]]
"""Values by ``component.variable``, and where each is written; a later layer goes before an earlier one."""
_COMMAND_LINE = "--set"
_ALPHA = "units.alpha"


@dataclass(frozen=True)
class PreparedScenario:
    """A scenario that is ready to run.

    Attributes
    ----------
    record
        Names ``component.variable`` of what is recorded, every ``record_every`` communication steps.
    power_flow
        What the components start from; None where the case has no network.
    values
        Every value that was set, by ``component.variable``.
    """

    name: str
    title: str
    system: System
    schedule: Schedule
    step_size: float
    stop_time: float
    record: tuple[str, ...]
    record_every: int
    events: tuple[Event, ...]
    power_flow: PowerFlow | None
    values: dict[str, float | bool]


@cache
def catalogue_fmu(model: str, network: Network | None = None) -> FmuDescription:
    """FMU of a model of the catalogue, built once a machine."""
    arguments = {"network": network} if network is not None else {}
    return read_description(cached(build_model(model, **arguments)))


def _layer(file: ParameterFile) -> Layer:
    return file.values, file.place


class Preparer:
    """Makes one scenario ready; ``problems`` collects what is wrong."""

    def __init__(
        self,
        case: CaseTable,
        name: str,
        scenario: ScenarioTable,
        overrides: dict[str, Value],
        directory: Path,
        place: Place,
        parameters: Sequence[ParameterFile] = (),
    ) -> None:
        self.case, self.name, self.scenario = case, name, scenario
        self.directory, self.place = directory, place
        self.problems: list[Problem] = []
        self.layers = [*self._scenario_layers(), *map(_layer, parameters)]
        self.layers.append((overrides, lambda key: f"{_COMMAND_LINE} {key}"))
        self.system = System()
        self.network: Network | None = None
        everything = dict(case.components) | self._units()
        self.known = {*everything, *self._possible_units}
        self.tables = {n: t for n, t in everything.items() if n not in scenario.remove}

    def note(self, place: str, text: str) -> None:
        """Add a problem."""
        self.problems.append(Problem(place, text))

    def assemble(self) -> System:
        """The scenario's components with their values; nothing is connected yet."""
        for name in self.scenario.remove:
            if name not in self.known:
                self.note(self.place("scenarios", self.name, "remove"), f"there is no component {name!r} to remove")
        self._find_network()
        for name, table in self.tables.items():
            self._add_component(name, table)
        self._assign_values()
        return self.system

    def prepare(self, step_size: float | None, stop_time: float | None) -> PreparedScenario | None:
        """Go through all of it; None if there were problems that leave nothing to run."""
        self.assemble()
        self._connect()
        self._check_inputs()
        flow = None if self.problems else self._power_flow()
        clock = self._clock(step_size)
        stop = stop_time if stop_time is not None else self.case.solver.stop_time
        events = self._events(clock, stop)
        schedule = self._schedule()
        if self.problems or clock is None:
            return None
        return PreparedScenario(
            name=self.name,
            title=self.scenario.title or self.name,
            system=self.system,
            schedule=schedule,
            step_size=clock.step_size,
            stop_time=stop,
            record=self._recorded(),
            record_every=max(1, round(self.case.solver.record_interval / clock.step_size)),
            events=events,
            power_flow=flow,
            values={f"{n}.{v}": x for n, p in self.system.components.items() for v, x in p.parameters.items()},
        )

    # -- components ------------------------------------------------------------------------------

    def _units(self) -> dict[str, ComponentTable]:
        """Generators ``sg<bus>`` and converters ``gfor<bus>`` of the units table; a share of 0 has none."""
        self._possible_units: set[str] = set()
        if self.case.units is None:
            return {}
        table, alpha = self.case.units, self._alpha(self.case.units)
        try:
            rows = unit_rows(table, self.directory)
        except InputError as error:
            self.note(self.place("units", "file"), str(error))
            return {}
        self._possible_units = {f"{kind}{row.label}" for row in rows for kind in UNIT_KINDS}
        return unit_components(table, alpha, rows)

    def _alpha(self, table: UnitsTable) -> float:
        """The converters' share: from the command line, else a parameter file, else the scenario, else the table."""
        for values, place in reversed(self.layers):
            if _ALPHA in values:
                value = values[_ALPHA]
                if isinstance(value, bool | str) or not 0 <= value <= 1:
                    self.note(place(_ALPHA), f"alpha = {value!r}; it must be a number from 0 to 1")
                    return table.alpha
                return value
        return table.alpha

    def _find_network(self) -> None:
        """The network behind the grid component: the model's own, or the file's table."""
        if self.case.power_flow is None:
            return
        grid = self.tables.get(self.case.power_flow.grid)
        if grid is None:
            self.note(self.place("power_flow", "grid"), f"there is no component {self.case.power_flow.grid!r}")
        elif grid.model == "grid":
            self.network = self._network_from_table()
        elif grid.model in model_names():
            self.network = network_of(grid.model or "")

    def _network_from_table(self) -> Network | None:
        if self.case.network is None:
            self.note(
                self.place("power_flow", "grid"),
                "the model 'grid' needs a [network] table with buses, lines and loads",
            )
            return None
        try:
            buses, lines, loads = network_elements(self.case.network, self.directory)
            ports = [Port(n, t.bus) for n, t in self.tables.items() if t.bus]
            return Network(f"{self.case.name}_grid", buses, tuple(lines), tuple(loads), tuple(ports))
        except (ValueError, InputError) as error:
            self.note(self.place("network"), str(error))
            return None

    def _add_component(self, name: str, table: ComponentTable) -> None:
        where = self.place("components", name)
        if (table.model is None) == (table.fmu is None):
            self.note(where, "give either 'model' (a model of the catalogue) or 'fmu' (the path of an .fmu)")
            return
        try:
            self.system.add(name, self._description(table))
        except InputError as error:
            self.note(where, str(error))
        except KeyError as error:
            self.note(self.place("components", name, "model"), str(error.args[0]))

    def _description(self, table: ComponentTable) -> FmuDescription:
        if table.fmu is not None:
            return read_description(self.directory / table.fmu)
        own = table.model == "grid"
        if own and self.network is None:
            raise InputError(
                "the model 'grid' needs a [network] table and a [power_flow] table that names this component"
            )
        return catalogue_fmu(table.model or "", self.network if own else None)

    # -- values ----------------------------------------------------------------------------------

    def _scenario_layers(self) -> list[Layer]:
        """The scenario's parameter files, then what it sets itself."""
        layers: list[Layer] = []
        for index, name in enumerate(self.scenario.parameters):
            try:
                layers.append(_layer(read_parameter_file(self.directory / name)))
            except InputError as error:
                self.note(self.place("scenarios", self.name, "parameters", index), str(error))
        return [*layers, (self.scenario.set, lambda key: self.place("scenarios", self.name, "set", key))]

    def _assign_values(self) -> None:
        for name, table in self.tables.items():
            for group in ("parameters", "inputs"):
                for path, value in flatten(getattr(table, group)):
                    self._assign(name, ".".join(path), value, self.place("components", name, group, *path))
        for values, place in self.layers:
            for key, value in values.items():
                self._assign_key(key, value, place(key))

    def _assign_key(self, key: str, value: Value, where: str) -> None:
        """Assign to one component, or to all whose name fits a pattern such as ``gfor*``."""
        if key == _ALPHA and self.case.units is not None:
            return  # done before the units were made
        pattern, _, variable = key.partition(".")
        for name in fnmatch.filter(self.tables, pattern):
            self._assign(name, variable, value, where)
        if not fnmatch.filter(self.known, pattern):
            some = ", ".join([*self.case.components][:12])
            self.note(where, f"there is no component {pattern!r}; the case has: {some}")

    def _assign(self, name: str, variable: str, value: Value, where: str) -> None:
        plan = self.system.components.get(name)
        if plan is None:
            return  # the component itself is a problem already
        info = plan.description.variables.get(variable)
        if info is None:
            settable = [*plan.description.parameters, *plan.description.inputs]
            close = difflib.get_close_matches(variable, settable, n=3, cutoff=0.5)
            hint = f"did you mean {' or '.join(close)}?" if close else f"`gfor info {plan.description.path}` lists them"
            self.note(where, f"component {name!r} has no variable {variable!r}; {hint}")
            return
        if info.causality not in ("parameter", "input"):
            self.note(where, f"{variable} is of causality {info.causality}; only parameters and inputs can be set")
            return
        converted = self._convert(info, value, where)
        if converted is not None:
            target: dict[str, Any] = plan.inputs if info.causality == "input" else plan.parameters
            target[variable] = converted

    def _convert(self, info: VariableInfo, value: Value, where: str) -> float | bool | None:
        try:
            return convert(info, value)
        except ValueError as error:
            self.note(where, str(error))
            return None

    # -- connections -----------------------------------------------------------------------------

    def _connect(self) -> None:
        for index, wire in enumerate(self.case.connections):
            ends = {wire.source.partition(".")[0], wire.target.partition(".")[0]}
            if not ends & set(self.scenario.remove):
                self._try_connect(wire.source, wire.target, self.place("connections", index))
        for name, table in self.tables.items():
            if table.bus is not None and name in self.system.components:
                self._connect_to_bus(name, table.bus)

    def _connect_to_bus(self, name: str, bus: str) -> None:
        where = self.place("components", name, "bus")
        if self.case.power_flow is None or self.network is None:
            self.note(
                where,
                "a bus needs a [power_flow] table whose grid is a model with a network; or use [[connections]]",
            )
            return
        ports = {port.name: port.bus for port in self.network.ports}
        if ports.get(name) != bus:
            known = ", ".join(f"{p} at {b}" for p, b in ports.items())
            self.note(where, f"the network has no port {name!r} at bus {bus!r}; it has: {known}")
            return
        grid = self.case.power_flow.grid
        if grid in self.system.components:
            for part in ("re", "im"):
                self._try_connect(f"{grid}.{bus}.v_{part}", f"{name}.v_{part}", where)
                self._try_connect(f"{name}.i_{part}", f"{grid}.{name}.i_{part}", where)

    def _try_connect(self, source: str, target: str, where: str) -> None:
        known = self.known - set(self.system.components)
        if {source.partition(".")[0], target.partition(".")[0]} & known:
            return  # an end is a problem already
        try:
            self.system.connect(source, target)
        except InputError as error:
            self.note(where, str(error))

    def _check_inputs(self) -> None:
        for wire in self.system.connections:
            if wire.target.variable in self.system.components[wire.target.component].inputs:
                self.note(
                    self.place("components", wire.target.component, "inputs"),
                    f"{wire.target} is given a constant, but {wire.source} feeds it; remove the one or the other",
                )
        for endpoint in self.system.unconnected_inputs():
            self.note(
                self.place("components", endpoint.component),
                f"scenario {self.name!r}: nothing feeds the input {endpoint}; "
                "connect it, or give it a constant under 'inputs'",
            )

    # -- operating point -------------------------------------------------------------------------

    def _power_flow(self) -> PowerFlow | None:
        if self.case.power_flow is None or self.network is None:
            return None
        table = self.case.power_flow
        units = {p.name: p.bus for p in self.network.ports if p.name in self.system.components}
        slack = units.get(table.slack, table.slack)
        if slack not in units.values():
            known = ", ".join(units)
            self.note(
                self.place("power_flow", "slack"),
                f"{table.slack!r} is neither a unit of this scenario nor a bus with one; units: {known}",
            )
            return None
        try:
            return start_from_power_flow(self.system, self.network, table.grid, units, slack)
        except InputError as error:
            self.note(self.place("power_flow"), f"scenario {self.name!r}: {error}")
            return None

    def _recorded(self) -> tuple[str, ...]:
        """All outputs that fit one of the file's patterns."""
        outputs = [f"{n}.{v}" for n, plan in self.system.components.items() for v in plan.description.outputs]
        wanted = {name for pattern in self.case.solver.record for name in fnmatch.filter(outputs, pattern)}
        return tuple(name for name in outputs if name in wanted)

    # -- time ------------------------------------------------------------------------------------

    def _clock(self, step_size: float | None) -> Clock | None:
        try:
            return Clock(step_size if step_size is not None else self.case.solver.step_size)
        except InputError as error:
            self.note("--step", str(error))
            return None

    def _schedule(self) -> Schedule:
        """The case's schedule, checked against its components."""
        schedule = self._chosen_schedule()
        try:
            schedule.check(set(self.system.components))
        except InputError as error:
            self.note(self.place("solver", "groups"), str(error))
        return schedule

    def _chosen_schedule(self) -> Schedule:
        """The file's groups; else devices and then the grid, or every component in a group of its own."""
        names = tuple(self.system.components)
        if self.case.solver.schedule == "jacobi":
            return jacobi(names)
        if self.case.solver.groups is not None:
            groups = [tuple(n for n in group if n not in self.scenario.remove) for group in self.case.solver.groups]
            return gauss_seidel(tuple(group for group in groups if group))
        if self.case.power_flow is not None:
            grid = self.case.power_flow.grid
            return gauss_seidel((tuple(n for n in names if n != grid), (grid,)))
        return gauss_seidel(tuple((name,) for name in names))

    def _events(self, clock: Clock | None, stop: float) -> tuple[Event, ...]:
        own = self.scenario.events is not None
        tables = self.scenario.events if self.scenario.events is not None else self.case.events
        events = []
        for index, table in enumerate(tables):
            where = self.place("scenarios", self.name, "events", index) if own else self.place("events", index)
            event = event_of(table)
            if event.component in self.scenario.remove:
                continue
            checked = self._checked(event, where)
            if checked is not None and clock is not None:
                try:
                    clock.index(event.time, "the event")
                except InputError as error:
                    self.note(where, str(error))
                events.append(checked)
        if clock is not None:
            try:
                clock.index(stop, "the stop")
            except InputError as error:
                self.note(
                    "--stop" if stop != self.case.solver.stop_time else self.place("solver", "stop_time"), str(error)
                )
        return tuple(event for event in events if event.time < stop)

    def _checked(self, event: Event, where: str) -> Event | None:
        """The event with its values in the variables' units; None if something is wrong with it."""
        plan = self.system.components.get(event.component)
        if plan is None:
            if event.component not in self.tables:
                self.note(where, f"there is no component {event.component!r}; the case has: {', '.join(self.tables)}")
            return None
        fed = {c.target: c.source for c in self.system.connections}
        before = len(self.problems)
        for variable, value in event.settings().items():
            info = plan.description.variables.get(variable)
            if info is None:
                self.note(where, f"component {event.component!r} has no variable {variable!r} for this event to set")
            elif source := fed.get(Endpoint(event.component, variable)):
                self.note(where, f"{event.component}.{variable} is fed by {source}; change that one's source")
            elif info.causality != "input" and info.variability != "tunable":
                kind = f"{info.variability} {info.causality}"
                self.note(
                    where,
                    f"{event.component}.{variable} is a {kind}; only tunable parameters and open inputs can change",
                )
            else:
                converted = self._convert(info, value, where)
                if isinstance(event, ParameterChange) and converted is not None:
                    event = replace(event, value=converted)
        return event if len(self.problems) == before else None
