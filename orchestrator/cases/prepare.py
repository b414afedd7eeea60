"""From a case's tables and one scenario to a system that can run, with every mistake collected on the way."""

import fnmatch
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

from fmus.grid.network import Network, Port
from fmus.toolchain.catalogue import build_model, model_names, needs_arguments, network_of
from fmus.toolchain.extras import require
from orchestrator.binding.binding import bound_fmu
from orchestrator.cases.assignment import assign_values
from orchestrator.cases.definition import CaseDefinition
from orchestrator.cases.draft import Draft
from orchestrator.cases.event_tables import scenario_events
from orchestrator.cases.layers import value_layers
from orchestrator.cases.native import is_native
from orchestrator.cases.network_data import network_data
from orchestrator.cases.parameter_files import ParameterFile
from orchestrator.cases.plausibility import check_plausibility, question_loading
from orchestrator.cases.power_flow import PowerFlow
from orchestrator.cases.schema import ComponentTable, Value
from orchestrator.cases.start_values import start_from_power_flow
from orchestrator.cases.unit_tables import unit_components
from orchestrator.cases.wiring import check_inputs, connect
from orchestrator.coupling.clock import Clock
from orchestrator.coupling.events import Event
from orchestrator.coupling.schedule import Schedule, gauss_seidel, jacobi
from orchestrator.coupling.step_awareness import tell_step
from orchestrator.coupling.system import System
from orchestrator.errors import InputError, Problem
from orchestrator.fmi.description import FmuDescription, read_description


@dataclass(frozen=True)
class PreparedScenario:
    """A scenario that is ready to run.

    Attributes
    ----------
    case
        The case that the scenario is of.
    record
        Names ``component.variable`` of what is recorded, every ``record_every`` communication steps.
    power_flow
        What the components start from; None where the case has no network.
    values
        Every value that was set, by ``component.variable``.
    questions
        Data that are most unusual, each with its place: see `plausibility`.
    """

    case: CaseDefinition
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
    questions: tuple[Problem, ...] = ()


def _takes_network(table: ComponentTable) -> bool:
    """Whether a component's model is built for the case's network table."""
    return table.model in model_names() and needs_arguments(table.model or "")


@cache
def catalogue_fmu(model: str, network: Network | None = None, native: bool = False) -> FmuDescription:
    """FMU of a model of the catalogue, built once a machine.

    Raises
    ------
    MissingLibraryError
        If the extra that builds FMUs is not installed.
    """
    require(f"building the FMU {model!r} of the catalogue", "casadi", "pythonfmu", "ziglang")
    from fmus.toolchain.exporter import cached  # noqa: PLC0415 - needs the extra `build`
    from fmus.toolchain.native_fmu import NativeFmu  # noqa: PLC0415 - as above
    from fmus.toolchain.python_fmu import PythonFmu  # noqa: PLC0415 - as above

    arguments = {"network": network} if network is not None else {}
    recipe = NativeFmu if native else PythonFmu
    return read_description(cached(recipe(build_model(model, **arguments))))


class Preparer:
    """Makes one scenario ready; ``problems`` collects what is wrong."""

    def __init__(
        self,
        case: CaseDefinition,
        name: str,
        overrides: dict[str, Value],
        parameters: Sequence[ParameterFile] = (),
    ) -> None:
        scenario = case.scenarios[name]
        self._case = case
        self.draft = draft = Draft(case.table, name, scenario, case.directory, case.place)
        draft.layers = value_layers(draft, parameters, overrides)
        self._read_network()
        self._everything = dict(case.table.components) | unit_components(draft)
        draft.known |= set(self._everything)
        draft.tables = {n: t for n, t in self._everything.items() if n not in scenario.remove}

    @property
    def problems(self) -> list[Problem]:
        """The mistakes found so far."""
        return self.draft.problems

    def assemble(self) -> System:
        """The scenario's components with their values; nothing is connected yet."""
        draft = self.draft
        for name in draft.scenario.remove:
            if name not in draft.known:
                draft.note(draft.place("scenarios", draft.name, "remove"), f"there is no component {name!r} to remove")
        self._find_network()
        for name, table in draft.tables.items():
            self._add_component(name, table)
        assign_values(draft)
        return draft.system

    def prepare(self, step_size: float | None, stop_time: float | None) -> PreparedScenario | None:
        """Go through all of it; None if there were problems that leave nothing to run."""
        draft = self.draft
        self.assemble()
        connect(draft)
        check_inputs(draft)
        check_plausibility(draft)
        flow = None if draft.problems else self._power_flow()
        question_loading(draft)
        clock = self._clock(step_size)
        if clock is not None:
            tell_step(draft.system, clock.step_size)
        stop = stop_time if stop_time is not None else draft.case.solver.stop_time
        events = scenario_events(draft, clock, stop)
        schedule = self._schedule()
        if draft.problems or clock is None:
            return None
        return PreparedScenario(
            case=self._case,
            name=draft.name,
            title=draft.scenario.title or draft.name,
            system=draft.system,
            schedule=schedule,
            step_size=clock.step_size,
            stop_time=stop,
            record=self._recorded(),
            record_every=max(1, round(draft.case.solver.record_interval / clock.step_size)),
            events=events,
            power_flow=flow,
            values={f"{n}.{v}": x for n, p in draft.system.components.items() for v, x in p.parameters.items()},
            questions=tuple(draft.questions),
        )

    # -- network and components ------------------------------------------------------------------

    def _read_network(self) -> None:
        """The elements of the network table; the units may need what its source knows of them."""
        table = self.draft.case.network
        if table is None:
            return
        if table.matpower is not None and table.pandapower is not None:
            self.draft.note_network(self.draft.place("network"), "give either 'matpower' or 'pandapower', not both")
            return
        source = next((key for key in ("matpower", "pandapower") if getattr(table, key) is not None), None)
        try:
            self.draft.data = network_data(table, self.draft.directory)
        except InputError as error:
            where = self.draft.place("network", source) if source else self.draft.place("network")
            self.draft.note_network(where, str(error))

    def _find_network(self) -> None:
        """The network behind the grid component: the model's own, or the file's table."""
        draft = self.draft
        if draft.grid is None:
            return
        grid = draft.tables.get(draft.grid)
        if grid is None:
            draft.note(draft.place("power_flow", "grid"), f"there is no component {draft.grid!r}")
        elif _takes_network(grid):
            draft.network = self._network_from_table(grid)
        elif grid.model in model_names():
            draft.network = network_of(grid.model or "")

    def _network_from_table(self, grid: ComponentTable) -> Network | None:
        draft, data = self.draft, self.draft.data
        if data is None:
            if draft.case.network is None:
                draft.note_network(
                    draft.place("power_flow", "grid"),
                    f"the model {grid.model!r} needs a [network] table with buses, lines and loads",
                )
            return None
        held = {table.bus for table in self._everything.values()}
        idle = [bus for bus in data.generation if bus not in held]
        if idle:
            draft.note_network(
                draft.place("network"),
                f"the source has generators at {', '.join(idle)}, where the case has no unit and no component; "
                "add a row to the units' file, or a component with this bus",
            )
            return None
        ports = tuple(Port(n, t.bus) for n, t in draft.tables.items() if t.bus)
        name = f"{draft.case.name}_grid"
        try:
            return Network(name, data.buses, data.lines, data.loads, ports, data.shunts, data.stray_B)
        except ValueError as error:
            draft.note_network(draft.place("network"), str(error))
            return None

    def _add_component(self, name: str, table: ComponentTable) -> None:
        where = self.draft.place("components", name)
        if _takes_network(table) and self.draft.network_failed:
            return
        if (table.model is None) == (table.fmu is None):
            self.draft.note(where, "give either 'model' (a model of the catalogue) or 'fmu' (the path of an .fmu)")
            return
        if table.binding is not None and table.fmu is None:
            self.draft.note(where, "'binding' is for an FMU of others; give its path as 'fmu', or remove 'binding'")
            return
        try:
            description = self._description(table, is_native(self.draft, name, table))
            self.draft.system.add(name, description, isolated=table.isolated)
        except (InputError, ValueError) as error:  # the latter from a model that does not fit the network
            self.draft.note(where, str(error))
        except KeyError as error:
            self.draft.note(self.draft.place("components", name, "model"), str(error.args[0]))

    def _description(self, table: ComponentTable, native: bool) -> FmuDescription:
        if table.fmu is not None:
            directory = self.draft.directory
            return bound_fmu(directory / table.fmu, directory / table.binding if table.binding else None)
        own = _takes_network(table)
        if own and self.draft.network is None:
            raise InputError(
                f"the model {table.model!r} needs a [network] table and a [power_flow] table that names this component"
            )
        return catalogue_fmu(table.model or "", self.draft.network if own else None, native)

    # -- operating point -------------------------------------------------------------------------

    def _power_flow(self) -> PowerFlow | None:
        draft, table = self.draft, self.draft.case.power_flow
        if table is None or draft.network is None:
            return None
        units = {p.name: p.bus for p in draft.network.ports if p.name in draft.system.components}
        wanted = table.slack or (draft.data.slack if draft.data else None)
        if wanted is None:
            draft.note(
                draft.place("power_flow"),
                "the key 'slack' is missing; name a unit or a bus with one that feeds what is left",
            )
            return None
        slack = units.get(wanted, wanted)
        if slack not in units.values():
            known = ", ".join(units)
            draft.note(
                draft.place("power_flow", "slack"),
                f"{wanted!r} is neither a unit of this scenario nor a bus with one; units: {known}",
            )
            return None
        try:
            return start_from_power_flow(draft.system, draft.network, table.grid, units, slack)
        except InputError as error:
            draft.note(draft.place("power_flow"), f"scenario {draft.name!r}: {error}")
            return None

    def _recorded(self) -> tuple[str, ...]:
        """All Real outputs that fit one of the file's patterns."""
        plans = {name: plan.description for name, plan in self.draft.system.components.items()}
        outputs = [f"{n}.{v}" for n, fmu in plans.items() for v in fmu.outputs if fmu.variables[v].type == "Real"]
        wanted = {name for pattern in self.draft.case.solver.record for name in fnmatch.filter(outputs, pattern)}
        return tuple(name for name in outputs if name in wanted)

    # -- time ------------------------------------------------------------------------------------

    def _clock(self, step_size: float | None) -> Clock | None:
        try:
            return Clock(step_size if step_size is not None else self.draft.case.solver.step_size)
        except InputError as error:
            self.draft.note("--step", str(error))
            return None

    def _schedule(self) -> Schedule:
        """The case's schedule, checked against its components."""
        schedule = self._chosen_schedule()
        if self.draft.network_failed:
            return schedule
        try:
            schedule.check(set(self.draft.system.components))
        except InputError as error:
            self.draft.note(self.draft.place("solver", "groups"), str(error))
        return schedule

    def _chosen_schedule(self) -> Schedule:
        """The file's groups; else devices and then the grid, or every component in a group of its own."""
        solver, grid = self.draft.case.solver, self.draft.grid
        names = tuple(self.draft.system.components)
        if solver.schedule == "jacobi":
            return jacobi(names)
        if solver.groups is not None:
            groups = [tuple(n for n in group if n not in self.draft.scenario.remove) for group in solver.groups]
            return gauss_seidel(tuple(group for group in groups if group))
        if grid is not None:
            return gauss_seidel((tuple(n for n in names if n != grid), (grid,)))
        return gauss_seidel(tuple((name,) for name in names))
