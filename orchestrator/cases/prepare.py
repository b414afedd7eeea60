"""From a case's tables and one scenario to a system that can run, with every mistake collected on the way."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from fmus.grid.network import Network, Port
from fmus.toolchain.catalogue import model_names, needs_arguments, network_of, parts_of
from orchestrator.binding.binding import bound_fmu
from orchestrator.cases.areas import in_two_areas
from orchestrator.cases.assignment import assign_values
from orchestrator.cases.build_choices import PARTS
from orchestrator.cases.catalogue_fmus import PlannedFmu, build_fmu, plan_fmu
from orchestrator.cases.contradictions import doubts
from orchestrator.cases.definition import CaseDefinition
from orchestrator.cases.draft import Draft
from orchestrator.cases.event_tables import scenario_events
from orchestrator.cases.imperfection_tables import disturb_connections
from orchestrator.cases.layers import value_layers
from orchestrator.cases.names import close_names
from orchestrator.cases.network_data import network_data
from orchestrator.cases.parameter_files import ParameterFile
from orchestrator.cases.plausibility import check_plausibility, question_loading
from orchestrator.cases.power_flow import PowerFlow
from orchestrator.cases.recording import record_every, recorded
from orchestrator.cases.references import references_of
from orchestrator.cases.schema import (
    BusFaultTable,
    CaseTable,
    ComponentTable,
    ReferenceModeTable,
    ShuntReconnectionTable,
    ShuntTripTable,
    Value,
)
from orchestrator.cases.start_values import RESULTS, start_from_power_flow
from orchestrator.cases.unit_tables import unit_components
from orchestrator.cases.wiring import check_inputs, connect
from orchestrator.coupling.clock import Clock
from orchestrator.coupling.events import Event
from orchestrator.coupling.schedule import Schedule, gauss_seidel, jacobi
from orchestrator.coupling.step_awareness import tell_step
from orchestrator.coupling.system import System
from orchestrator.errors import InputError, Problem
from orchestrator.fmi.description import FmuDescription
from orchestrator.fmi.instance import is_ours

MOST_STEPS = 1e11
"""Communication steps of a run: a month and more."""

_STEPS_A_SECOND = 30_000
"""Of the two-area system on one core, about."""


_USUAL_VOLTAGES = (0.8, 1.2)
"""Magnitudes [pu] of bus voltages that are not questioned."""

_SHOWN = 5
"""Buses that a question names; the others are counted."""


@dataclass(frozen=True)
class PreparedScenario:
    """A scenario that is ready to run.

    Attributes
    ----------
    case
        The case that the scenario is of.
    record
        Names ``component.variable`` of the signals that are recorded every ``record_every`` communication steps.
    about_rows
        Questions about the interval of the recording, which only a run asks.
    record_filtered
        Whether the recorded signals go through a low-pass filter before.
    power_flow
        The power flow that gives the components' start values; None if the case has no network.
    values
        Every value that was set, by ``component.variable``.
    questions
        Data that are most unusual, each with its place: see `plausibility`.
    references
        Published modes of the scenario by name, where the conditions of ``[reference]`` hold.
    places
        File and line of every component.
    of_units
        Components that come from the units table.
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
    record_filtered: bool = False
    about_rows: tuple[Problem, ...] = ()
    references: Mapping[str, ReferenceModeTable] = field(default_factory=dict)
    places: Mapping[str, str] = field(default_factory=dict)
    of_units: frozenset[str] = frozenset()


def _takes_network(table: ComponentTable) -> bool:
    """Whether a component's model is built for the case's network table."""
    return table.model in model_names() and needs_arguments(table.model or "")


def _with_switches(network: Network | None, case: CaseTable) -> Network | None:
    """The network with the faults and switched shunts of all scenarios, which share one FMU.

    Unknown names are the events' matter.
    """
    tables = [*case.events, *(event for scenario in case.scenarios.values() for event in scenario.events or ())]
    faults = {table.bus for table in tables if isinstance(table, BusFaultTable)}
    switched = {table.shunt for table in tables if isinstance(table, ShuntTripTable | ShuntReconnectionTable)}
    if network is None or not (faults or switched):
        return network
    shunts = tuple(replace(shunt, switched=shunt.name in switched) for shunt in network.shunts)
    return replace(network, faults=tuple(bus for bus in network.buses if bus in faults), shunts=shunts)


def _first_few(texts: Sequence[str]) -> str:
    return ", ".join(texts[:_SHOWN]) + (f" and {len(texts) - _SHOWN} more" if len(texts) > _SHOWN else "")


class Preparer:
    """Prepares one scenario; ``problems`` collects the mistakes."""

    def __init__(
        self,
        case: CaseDefinition,
        name: str,
        overrides: dict[str, Value],
        parameters: Sequence[ParameterFile] = (),
    ) -> None:
        scenario = case.scenarios[name]
        self._case = case
        self._planned: dict[str, PlannedFmu] = {}
        self.draft = draft = Draft(str(case.path), case.table, name, scenario, case.directory, case.place)
        draft.parameter_files, draft.whole = case.parameter_files, case.numbered
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
        self._check_network_is_used()
        self._find_network()
        for name, table in draft.tables.items():
            self._add_component(name, table)
        assign_values(draft)
        return draft.system

    def prepare(self, step_size: float | None, stop_time: float | None) -> PreparedScenario | None:
        """Prepare the whole scenario; None if its problems leave nothing to run."""
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
        self._check_length(clock, stop)
        imperfections = disturb_connections(draft, clock, stop) if clock is not None else {}
        events = scenario_events(draft, clock, stop)
        schedule = self._schedule()
        references = references_of(draft, imperfections)
        if draft.problems or clock is None:
            return None
        self._build()
        every, about_rows = record_every(draft, clock, stop)
        record, left_out = recorded(draft)
        draft.questions += [*doubts(draft.case, draft.place), *self._area_questions()]
        return PreparedScenario(
            case=self._case,
            name=draft.name,
            title=draft.scenario.title or draft.name,
            system=draft.system,
            schedule=schedule,
            step_size=clock.step_size,
            stop_time=stop,
            record=record,
            record_every=every,
            record_filtered=draft.case.solver.record_filter == "low-pass",
            events=events,
            power_flow=flow,
            values={f"{n}.{v}": x for n, p in draft.system.components.items() for v, x in p.parameters.items()}
            | imperfections,
            questions=tuple(draft.questions),
            about_rows=(*about_rows, *left_out),
            references=references,
            places={name: draft.place_of_component(name) for name in draft.system.components},
            of_units=frozenset(draft.origins),
        )

    # -- network and components ------------------------------------------------------------------

    def _read_network(self) -> None:
        """Read the elements of the network table. Its source may have data for the units."""
        table = self.draft.case.network
        if table is None:
            return
        given = [key for key in ("matpower", "pandapower", "raw", "cgmes") if getattr(table, key) is not None]
        if len(given) > 1:
            names = " or ".join(map(repr, given))
            self.draft.note_network(self.draft.place("network"), f"give either {names}, not both")
            return
        source = given[0] if given else None
        try:
            self.draft.data = network_data(table, self.draft.directory)
            self.draft.questions += self.draft.data.changes
        except InputError as error:
            where = self.draft.place("network", source) if source else self.draft.place("network")
            self.draft.note_network(where, str(error))

    def _check_network_is_used(self) -> None:
        """Refuse a network that nothing is built from; its frequency alone would still set that of every component."""
        tables = self._everything.values()
        unknown = [table.model for table in tables if table.model is not None and table.model not in model_names()]
        if self.draft.case.network is None or self.draft.case.units is not None or unknown:
            return
        if not any(_takes_network(table) for table in tables):
            self.draft.note(
                self.draft.place("network"),
                "no component is built from this network; give the grid the model 'grid' or 'phasor_grid', or remove "
                "the table",
            )

    def _find_network(self) -> None:
        """The network behind the grid component: the model's own, or the file's table."""
        draft = self.draft
        if draft.grid is None:
            self._check_buses_have_a_grid()
            return
        grid = draft.tables.get(draft.grid)
        if grid is None:
            hint = close_names(draft.grid, draft.tables, f"the case has: {', '.join([*draft.tables][:12])}")
            draft.note_network(draft.place("power_flow", "grid"), f"there is no component {draft.grid!r}; {hint}")
        elif _takes_network(grid):
            draft.network = self._network_from_table(grid)
        elif grid.model in model_names():
            draft.network = _with_switches(network_of(grid.model or ""), draft.case)

    def _check_buses_have_a_grid(self) -> None:
        """Name the first of the components at a bus; what is said of it holds for all."""
        for name, table in self.draft.tables.items():
            if table.bus is not None:
                place = "units" if name in self.draft.origins else "components"
                where = self.draft.place(place) if place == "units" else self.draft.place(place, name, "bus")
                self.draft.note_network(
                    where,
                    "a bus needs a [power_flow] table whose grid is a model with a network; or use [[connections]]",
                )
                return

    def _network_from_table(self, grid: ComponentTable) -> Network | None:
        draft, data = self.draft, self.draft.data
        if data is None:
            if draft.case.network is None:
                draft.note_network(
                    draft.place("power_flow", "grid"),
                    f"the model {grid.model!r} needs a [network] table with buses, lines and loads",
                )
            return None
        if draft.network_failed:
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
            network = Network(
                name, data.buses, data.lines, data.loads, ports, data.shunts, data.stray_B, (), data.transformers
            )
            return _with_switches(network, draft.case)
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
            description = self._description(name, table, self._is_native(name, table), self._parts(name, table))
            self._check_trust(name, table)
            self.draft.system.add(name, description, isolated=table.isolated)
        except (InputError, ValueError) as error:  # ValueError: the model does not fit the network
            self.draft.note(where, str(error))
        except KeyError as error:
            self._note_model(name, table.model or "", str(error.args[0]))

    def _note_model(self, name: str, model: str, text: str) -> None:
        """A model that is not there, once for all units that are to be of it."""
        hint = close_names(model, model_names())
        text = f"there is no model {model!r}; {hint}" if hint and model not in model_names() else text
        origin = self.draft.origins.get(name)
        if origin is None:
            self.draft.note(self.draft.place("components", name, "model"), text)
        else:
            self.draft.note_network(self.draft.place("units", origin.common.removesuffix("_parameters")), text)

    def _is_native(self, name: str, table: ComponentTable) -> bool:
        """The kind of FMU that a component of the catalogue gets; the strongest layer decides."""
        native = table.native
        for choice in (choice for layer in self.draft.layers for choice in layer.natives if choice.fits(name)):
            try:
                native = choice.native
            except ValueError as error:
                self.draft.note(choice.place, str(error))
        return native

    def _check_trust(self, name: str, table: ComponentTable) -> None:
        """A file may come from anybody; only the user lets foreign code into this process."""
        if table.fmu is None or table.isolated is not False or self._case.trust_fmus:
            return
        if not is_ours(self.draft.directory / table.fmu):
            self.draft.note(
                self.draft.place("components", name, "isolated"),
                f"this file wants {table.fmu} to run in gfor's own process, where it can do whatever you can; if you "
                "trust the FMU, say so by --trust-fmus (in Python load(case, trust_fmus=True)), else remove "
                "'isolated = false', and it runs in a process that is closed off",
            )

    def _parts(self, name: str, table: ComponentTable) -> tuple[tuple[str, str], ...]:
        """What a component of the catalogue is made of; the strongest layer decides on each part."""
        known = parts_of(table.model) if table.model in model_names() and not _takes_network(table) else {}
        chosen = {part: found for part in PARTS if (found := getattr(table, part)) is not None}
        choices = [choice for layer in self.draft.layers for choice in layer.parts]
        for choice in (c for c in choices if c.fits(name, has_part=c.part in known)):
            try:
                chosen[choice.part] = choice.name
            except ValueError as error:
                self.draft.note(choice.place, str(error))
        for part in (
            part for part in chosen if part not in known and (table.model is None or table.model in model_names())
        ):
            what = f"the model {table.model!r}" if table.model else "an FMU file"
            raise InputError(
                f"{part} = {chosen[part]!r}: {what} has no such part to choose; remove the key, or take the model "
                "'synchronous_generator' or 'synchronous_generator_phasor'"
            )
        return tuple(chosen.items())

    def _build(self) -> None:
        """Build the FMUs that are described so far and not there; nothing is wrong with the case."""
        for name, planned in self._planned.items():
            self.draft.system.components[name].description = build_fmu(planned)

    def _description(
        self, name: str, table: ComponentTable, native: bool, parts: tuple[tuple[str, str], ...]
    ) -> FmuDescription:
        if table.fmu is not None:
            directory = self.draft.directory
            return bound_fmu(directory / table.fmu, directory / table.binding if table.binding else None)
        own = _takes_network(table)
        faulted = self.draft.network is not None and bool(self.draft.network.faults)
        if faulted and table is self.draft.tables.get(self.draft.grid or ""):
            own = True  # a model with a network of its own is built anew, with that network's faults
        if own and self.draft.network is None:
            raise InputError(
                f"the model {table.model!r} needs a [network] table and a [power_flow] table that names this component"
            )
        planned = plan_fmu(table.model or "", self.draft.network if own else None, native, parts)
        self._planned[name] = planned
        return planned.description

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
        for name, variable in ((n, v) for n in units for v in RESULTS if v in draft.system.components[n].parameters):
            place = draft.places.get(f"{name}.{variable}", draft.place_of_component(name))
            draft.note(place, f"{name}: {variable} cannot be set, because the power flow computes it; remove it, and "
                       "set P_0 and v_0")  # fmt: skip
        if draft.problems:
            return None
        try:
            flow = start_from_power_flow(
                draft.system, draft.network, table.grid, units, slack, self._reactive_limits(),
                keep_limits=table.reactive_limits is True,
            )  # fmt: skip
        except InputError as error:
            draft.note(draft.place("power_flow"), f"scenario {draft.name!r}: {error}")
            return None
        draft.questions += [*self._limit_questions(flow), *self._voltage_questions(flow)]
        return flow

    def _voltage_questions(self, flow: PowerFlow) -> list[Problem]:
        """Ask about voltages with which no network is run."""
        low, high = _USUAL_VOLTAGES
        unusual = [f"{bus!r} {abs(v):.3f} pu" for bus, v in flow.voltages.items() if not low <= abs(v) <= high]
        if not unusual:
            return []
        return [
            Problem(
                self.draft.place("power_flow"),
                f"the power flow gives voltages outside of {low:g} to {high:g} pu: {_first_few(unusual)}; check loads, "
                "shunts and stray_B there",
            )
        ]

    def _reactive_limits(self) -> dict[str, tuple[float, float]]:
        """Limits of the source's generators, which the units' file overrides [Mvar]."""
        generation = self.draft.data.generation if self.draft.data else {}
        return {bus: (g.q_min_mvar, g.q_max_mvar) for bus, g in generation.items()} | self.draft.reactive_limits

    def _limit_questions(self, flow: PowerFlow) -> list[Problem]:
        """What is to be said of limits of reactive power."""
        kept = self.draft.case.power_flow.reactive_limits if self.draft.case.power_flow else None
        where = self.draft.place("power_flow", *(["reactive_limits"] if kept is not None else []))
        found = []
        if flow.at_limits:
            told = _first_few([excess.text(kept=True) for excess in flow.at_limits])
            found.append(Problem(where, f"limits of reactive power are reached: {told}"))
        if flow.beyond_limits and kept is not False:
            told = _first_few([excess.text(kept=False) for excess in flow.beyond_limits])
            remedy = (
                "the slack bus keeps no limit; take another slack"
                if kept
                else "write reactive_limits = true to keep the limits, or false if the voltages are meant"
            )
            found.append(Problem(where, f"limits of reactive power are exceeded: {told}; {remedy}"))
        return found

    def _area_questions(self) -> list[Problem]:
        areas = self.draft.case.analysis.areas
        return [
            Problem(
                self.draft.place("analysis", "areas", found[1]),
                f"{name} is in {' and '.join(found)}; it counts to {found[0]}, the first",
            )
            for name, found in in_two_areas(areas, self.draft.system).items()
        ]

    # -- time ------------------------------------------------------------------------------------

    def _clock(self, step_size: float | None) -> Clock | None:
        try:
            return Clock(step_size if step_size is not None else self.draft.case.solver.step_size)
        except InputError as error:
            self.draft.note("--step", str(error))
            return None

    def _check_length(self, clock: Clock | None, stop: float) -> None:
        """Refuse a run that nobody lives to see the end of: one of its two times was mistyped."""
        steps = 0.0 if clock is None else stop / clock.step_size
        if steps > MOST_STEPS:
            years = steps / (_STEPS_A_SECOND * 365 * 86400)
            self.draft.note(
                "solver",
                f"{stop:g} s in steps of {stop / steps:g} s are {steps:.3g} communication steps, which take about "
                f"{years:.2g} years; at most {MOST_STEPS:.0g} are run: stop earlier, or take a longer step",
            )

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
        """The groups of the file. By default the devices step first and then the grid, or every component is a group of
        its own.
        """
        solver, grid = self.draft.case.solver, self.draft.grid
        names = tuple(self.draft.system.components)
        if solver.schedule == "jacobi":
            self._check_unused_groups(solver.groups or [])
            return jacobi(names)
        if solver.groups is not None:
            groups = [tuple(n for n in group if n not in self.draft.scenario.remove) for group in solver.groups]
            return gauss_seidel(tuple(group for group in groups if group))
        if grid is not None:
            return gauss_seidel((tuple(n for n in names if n != grid), (grid,)))
        return gauss_seidel(tuple((name,) for name in names))

    def _check_unused_groups(self, groups: Sequence[Sequence[str]]) -> None:
        """With Jacobi's schedule the groups are kept for later and do nothing; wrong names are wrong all the same."""
        for name in (name for group in groups for name in group if name not in self.draft.known):
            hint = close_names(name, sorted(self.draft.known), f"the case has: {', '.join(sorted(self.draft.known))}")
            self.draft.note(self.draft.place("solver", "groups"), f"there is no component {name!r}; {hint}")
