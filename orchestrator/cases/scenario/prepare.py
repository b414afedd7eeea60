"""From a case's tables and one scenario to a system that can run, with every mistake collected on the way."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from fmus.grid.network import Network
from fmus.toolchain.catalogue import model_names, network_of, parts_of
from orchestrator.cases.draft import Draft, DraftInput
from orchestrator.cases.events.event_tables import scenario_events
from orchestrator.cases.flow.beside_file import BesideFile, FileVoltages, compare_with_file
from orchestrator.cases.flow.power_flow import PowerFlow
from orchestrator.cases.flow.solved_fault import SolvedFault
from orchestrator.cases.form import component_forms
from orchestrator.cases.form.build_choices import MODELS, RECORDS, STAND_IN, chosen_parts
from orchestrator.cases.form.definition import CaseDefinition
from orchestrator.cases.form.names import close_names
from orchestrator.cases.form.parameter_files import ParameterFile
from orchestrator.cases.form.schema import ComponentTable, ReferenceModeTable, Value
from orchestrator.cases.networks.areas import in_two_areas
from orchestrator.cases.networks.branch_limits import FileLimits
from orchestrator.cases.networks.data import NetworkData
from orchestrator.cases.networks.element_names import ElementNames, names_of
from orchestrator.cases.networks.load_models import in_words, open_question
from orchestrator.cases.networks.record_use import RecordUse
from orchestrator.cases.networks.regions import Regions
from orchestrator.cases.questions.contradictions import doubts
from orchestrator.cases.questions.idle_values import Idle, idle_values
from orchestrator.cases.questions.plausibility import check_plausibility, question_loading
from orchestrator.cases.questions.widened_limits import widened_questions
from orchestrator.cases.scenario.case_network import (
    check_network_is_used,
    find_network,
    read_network,
    takes_network,
)
from orchestrator.cases.scenario.catalogue_fmus import PlannedFmu, build_fmu, plan_fmu
from orchestrator.cases.scenario.drawing_devices import with_motors
from orchestrator.cases.scenario.motor_relays import check_motor_relays
from orchestrator.cases.scenario.operating_point import power_flow_of
from orchestrator.cases.scenario.protection_relays import relays_of
from orchestrator.cases.scenario.run_plan import (
    check_length,
    checked_schedule,
    clock_of,
    record_every,
    recorded,
)
from orchestrator.cases.scenario.scheduling import schedule_in, told_again
from orchestrator.cases.scenario.unit_tables import unit_components
from orchestrator.cases.scenario.wiring import check_inputs, connect
from orchestrator.cases.settings.assignment import EMF, TORQUE, assign_values
from orchestrator.cases.settings.imperfection_tables import disturb_connections
from orchestrator.cases.settings.layers import value_layers
from orchestrator.cases.settings.references import references_of
from orchestrator.core.errors import InputError, Problem, QuestionTopic
from orchestrator.core.options import Option
from orchestrator.devices.binding.binding import bound_fmu
from orchestrator.devices.fmi.description import FmuDescription
from orchestrator.devices.fmi.instance import is_ours
from orchestrator.systems.coupling.bus_relays import Relay
from orchestrator.systems.coupling.events import Event
from orchestrator.systems.coupling.schedule import (
    SECOND_ORDER,
    Schedule,
    ScheduleName,
    check_tolerance,
)
from orchestrator.systems.coupling.step_awareness import STEP_PARAMETER, tell_step
from orchestrator.systems.coupling.system import ComponentPlan, System

_MADE_OF_PARTS = "'synchronous_generator' or 'synchronous_generator_phasor'"
_MADE_OF_RECORDS = "'wecc_plant_phasor'"
"""Models that let one choose what they are made of, in words."""


@dataclass(frozen=True)
class PreparedScenario:
    case: CaseDefinition
    name: str
    title: str
    system: System
    schedule: Schedule
    step_size: float
    stop_time: float
    # names ``component.variable`` of the signals that are recorded every ``record_every`` communication steps.
    record: tuple[str, ...]
    record_every: int
    events: tuple[Event, ...]
    # the power flow that gives the components' start values; None if the case has no network.
    power_flow: PowerFlow | None
    values: dict[str, float | bool]  # every value that was set, by ``component.variable``
    # data that are most unusual, each with its place: see `plausibility`
    questions: tuple[Problem, ...] = ()
    # what became of the records of the network's files
    records: tuple[RecordUse, ...] = ()
    # whether the recorded signals go through a low-pass filter before
    record_filtered: bool = False
    # questions about the interval of the recording, which only a run asks
    about_rows: tuple[Problem, ...] = ()
    # published modes of the scenario by name, where the conditions of ``[reference]`` hold.
    references: Mapping[str, ReferenceModeTable] = field(default_factory=dict)
    places: Mapping[str, str] = field(default_factory=dict)  # file and line of every component
    told: frozenset[str] = frozenset()  # components that are told the communication step
    # behind the grid component of the power flow; None if there is none
    network: Network | None = None
    source_slack: str | None = None  # reference bus of the network's source
    file_limits: FileLimits = field(default_factory=FileLimits)  # of the network's source
    file_voltages: FileVoltages = field(default_factory=FileVoltages)  # of the network's source
    titles: Mapping[str, str] = field(default_factory=dict)  # names in the network's file, by bus
    names: ElementNames = field(default_factory=ElementNames)  # of the network's file, for people
    regions: Regions = field(default_factory=Regions)  # area, zone, … of the buses in the file
    recorded_loads: frozenset[str] = frozenset()  # loads whose laws are of records of dynamics data
    told_loads: frozenset[str] = frozenset()  # loads that the network's source tells part by part
    # likely ratings [MVA] of units whose S_n is only the base of their data
    base_ratings: Mapping[str, float] = field(default_factory=dict)
    following_loads: tuple[str, ...] = ()  # loads that follow the voltage in an outage's power flow
    # variables of the grid that move in an outage's power flow: taps and switched shunts
    moving: tuple[str, ...] = ()
    counted_controls: str = ""  # how many taps and switched shunts could move, in words
    device_loads: tuple[
        str, ...
    ] = ()  # loads in the place of DC lines and the like, which no load factor scales
    # prepares another scenario of the case with the same values, or with those of its file alone where that is asked
    # for; None where nothing but the file gave values.
    beside: "Callable[..., PreparedScenario | None] | None" = field(
        default=None, repr=False, compare=False
    )
    # what the scenario, parameter files and the command line give, as it is written; a later source goes first.
    given: Mapping[str, Value] = field(default_factory=dict, repr=False)
    # what came from outside of the file, and where that cannot act; see `idle_everywhere`.
    idle: Idle = field(default_factory=dict, repr=False)
    changed: str = ""  # what parameter files and the caller set, in few words
    not_reached: tuple[float, ...] = ()  # times of events for which the run stops too early [s]
    relays: tuple[Relay, ...] = ()  # of units and loads, by the network's dynamics data
    faults: tuple[SolvedFault, ...] = ()  # of fewer phases than three, and poles that open

    @cached_property
    def buses_of(self) -> Mapping[str, tuple[str, ...]]:
        """Buses of every element of the network: of a branch its ends, of what else its own."""
        network = self.network
        if network is None:
            return {}
        found: dict[str, tuple[str, ...]] = {bus: (bus,) for bus in network.buses}
        found |= {x.name: (x.from_bus, x.to_bus) for x in network.lines}
        for x in network.transformers:
            found[x.name] = x.buses
            found |= {f"{x.name}.leg_{k + 1}": (bus,) for k, bus in enumerate(x.buses)}
        found |= {x.name: (x.bus,) for x in network.loads}
        found |= {x.name: (x.bus,) for x in network.shunts}
        return found | {x.name: (x.bus,) for x in network.ports}

    def area_of(self, *elements: str) -> str:
        """Return the areas of elements as the file names them; "" where it has not several."""
        return self.regions.area_of(*(x for one in elements for x in self.buses_of.get(one, ())))

    @property
    def areas_of_units(self) -> dict[str, str]:
        """Areas of the units as the file names them; empty where it has not several."""
        ports = self.network.ports if self.network and self.regions.has_areas else ()
        return {port.name: self.regions.area_of(port.bus) for port in ports}

    @property
    def subject(self) -> str:
        """The title, with what parameter files and the caller set."""
        return ", with ".join(filter(None, (self.title, self.changed)))

    @property
    def models(self) -> str | None:
        """``emt`` or ``phasor``; None where no component's model is of the catalogue."""
        named = [table.model for table in self.case.table.components.values() if table.model]
        of_names = "phasor" if any("phasor" in name for name in named) else "emt"
        return self.case.table.models or (of_names if named else None)

    @property
    def about(self) -> dict[str, Any]:
        """Return what the JSON of every study says of its scenario."""
        return {
            "case": self.case.name,
            "scenario": self.name,
            "subject": self.subject,
            "models": self.models,
            "basis": self.basis,
            "questions": [*map(str, self.questions)],
            **self.names.as_json(),
        }

    @property
    def basis(self) -> dict[str, Any]:
        """Network, model of its loads, and model of each machine: results that differ in them are not compared."""
        table = self.case.table.network
        file = table and (
            table.raw or table.matpower or table.pandapower or table.cgmes or table.lines_file
        )
        loads = [load for load in (self.network.loads if self.network else ()) if load.p_mw > 0]
        machines = {
            name: _machine(plan)
            for name, plan in self.system.components.items()
            if plan.kind == "machine"
        }
        network = Path(file).name if file else self.case.name
        words = with_motors(in_words(loads) if loads else "", self.system.components)
        return {"network": network, "loads": words, "machines": machines}

    @property
    def beside_file(self) -> BesideFile | None:
        """How far the power flow is from the voltages of the network's file; None where it has none."""
        if self.power_flow is None or self.network is None:
            return None
        at_devices = [x.bus for x in self.network.loads if x.name in self.device_loads]
        return compare_with_file(self.power_flow, self.file_voltages, at_devices)

    @property
    def grid(self) -> str:
        return self.case.table.power_flow.grid if self.case.table.power_flow else ""

    def rescheduled(self, name: ScheduleName) -> "PreparedScenario":
        """The same scenario with another schedule; components that know the communication step are told what fits."""
        schedule = schedule_in(self.case, self.name, self.system, name)
        step = 0.0 if schedule.is_second_order else self.step_size
        values = self.values | {f"{component}.{STEP_PARAMETER}": step for component in self.told}
        return replace(
            self, schedule=schedule, system=told_again(self.system, self.told, step), values=values
        )

    def with_tolerance(self, tolerance: float) -> "PreparedScenario":
        """The same scenario with steps as long as a tolerance allows; under ``newton`` unless it is ``midpoint``."""
        check_tolerance(tolerance)
        ready = self if self.schedule.is_second_order else self.rescheduled("newton")
        return replace(ready, schedule=replace(ready.schedule, tolerance=tolerance))


def _names(draft: Draft) -> ElementNames:
    """Names of the network's file; a DC line's with a model means its rectifier's station."""
    if draft.data is None or draft.network is None:
        return ElementNames()
    found = names_of(draft.network, draft.data)
    return found.with_meanings({one.line.name: one.rectifier.name for one in draft.dc_lines})


def _machine(plan: ComponentPlan) -> str:
    """The model of a machine, and what it assumes of itself; EMT and phasor models of one machine are one."""
    known = plan.description.variables
    other = ["emf e''"] if EMF in known and not plan.value(EMF) else []
    other += ["the governor gives the torque"] if TORQUE in known and plan.value(TORQUE) else []
    return ", ".join([plan.description.model_name.removesuffix("_phasor"), *other])


class Preparer:
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
        outside = frozenset(overrides).union(*(file.values for file in parameters)) - {MODELS}
        given = DraftInput(
            case.source,
            case.table,
            name=name,
            scenario=scenario,
            directory=case.directory,
            place=case.place,
            parameter_files=case.parameter_files,
            whole=case.numbered,
            injections=case.injections,
            faulted=case.faulted,
            line_ends=case.line_ends,
            exchanged=frozenset(case.exchanged),
            from_outside=outside,
            varied=case.varied,
        )
        self.draft = draft = Draft(given)
        given.layers = value_layers(draft, parameters, overrides)
        read_network(draft)
        self._everything = dict(case.table.components) | unit_components(draft)
        draft.known |= set(self._everything)
        draft.tables = {
            n: case.exchanged.get(n, t)
            for n, t in self._everything.items()
            if n not in scenario.remove
        }

    @property
    def problems(self) -> list[Problem]:
        return self.draft.found.problems

    def assemble(self) -> System:
        """The scenario's components with their values; nothing is connected yet."""
        draft = self.draft
        for name in draft.given.scenario.remove:
            if name not in draft.known:
                where = draft.given.place("scenarios", draft.given.name, "remove")
                draft.note(where, f"there is no component {name!r} to remove")
        check_network_is_used(draft, self._everything)
        find_network(draft, self._everything)
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
        flow = None if draft.found.problems else power_flow_of(draft)
        question_loading(draft, flow)
        draft.found.questions += widened_questions(draft)
        clock = clock_of(draft, step_size)
        check_motor_relays(draft, flow, clock.step_size if clock else None)
        told: frozenset[str] = frozenset()
        if clock is not None:
            second_order = draft.given.case.solver.schedule in SECOND_ORDER
            told = tell_step(draft.system, 0.0 if second_order else clock.step_size)
        stop = stop_time if stop_time is not None else draft.given.case.solver.stop_time
        check_length(draft, clock, stop)
        imperfections = disturb_connections(draft, clock, stop) if clock is not None else {}
        events = scenario_events(draft, clock, stop, flow)
        relays = relays_of(draft, flow)
        schedule = checked_schedule(draft)
        references = references_of(draft, imperfections)
        if draft.found.problems or clock is None:
            return None
        self._build()
        every, about_rows = record_every(draft, clock, stop)
        record, left_out = recorded(draft)
        data = draft.data or NetworkData()
        loads = draft.network.loads if draft.network else ()
        draft.found.questions += open_question(
            draft.given.case.network,
            loads,
            data.recorded_loads | data.told_loads,
            draft.given.place("network"),
        )
        draft.found.questions += [
            *doubts(draft.given.case, draft.given.place),
            *self._area_questions(),
        ]
        plans = draft.system.components
        values = {f"{n}.{v}": x for n, p in plans.items() for v, x in p.parameters.items()}
        given: dict[str, Value] = {}
        for layer in draft.given.layers:
            given |= layer.given
        return PreparedScenario(
            self._case,
            draft.given.name,
            title=draft.given.scenario.title or draft.given.name,
            system=draft.system,
            schedule=schedule,
            step_size=clock.step_size,
            stop_time=stop,
            record=record,
            record_every=every,
            events=events,
            relays=relays,
            power_flow=flow,
            values=values | imperfections,
            questions=tuple(draft.found.questions),
            records=tuple(draft.found.records),
            about_rows=(*about_rows, *left_out),
            references=references,
            record_filtered=draft.given.case.solver.record_filter == "low-pass",
            told=told,
            network=draft.network,
            places={name: draft.place_of_component(name) for name in plans},
            not_reached=tuple(sorted(draft.found.not_reached)),
            faults=tuple(draft.found.faults),
            source_slack=data.slack,
            file_limits=data.limits,
            file_voltages=data.file_voltages,
            titles=data.titles,
            names=_names(draft),
            regions=data.regions,
            recorded_loads=data.recorded_loads,
            told_loads=data.told_loads,
            base_ratings=draft.base_ratings,
            following_loads=tuple(data.flow_laws),
            moving=tuple(control.variable for control in data.controls),
            counted_controls=data.counted_controls,
            device_loads=data.device_loads,
            idle=idle_values(
                draft.system, draft.given.from_outside, draft.places, events, draft.found.absent
            ),
            given=given,
        )

    def _add_component(self, name: str, table: ComponentTable) -> None:
        where = self.draft.given.place("components", name)
        if takes_network(table) and self.draft.found.network_failed:
            return
        wrong = component_forms.contradiction(table)
        if wrong:
            self.draft.note(where, wrong)
            return
        if table.scan is not None and not self._case.scans:
            text = component_forms.NO_STATES.format(name, self.draft.given.source)
            self.draft.note(self.draft.given.place("components", name, "scan"), text)
        try:
            description = self._description(
                name, table, self._is_native(name, table), self._parts(name, table)
            )
            self._check_trust(name, table)
            self.draft.system.add(name, description, isolated=table.isolated)
        except (InputError, ValueError) as error:  # ValueError: the model does not fit the network
            self.draft.note(where, str(error))
        except KeyError as error:
            self._note_model(name, table.model or "", str(error.args[0]))

    def _note_model(self, name: str, model: str, text: str) -> None:
        """A model that is not there, once for all units that are to be of it."""
        hint = close_names(model, model_names())
        text = (
            f"there is no model {model!r}; {hint}" if hint and model not in model_names() else text
        )
        origin = self.draft.origins.get(name)
        if origin is None:
            self.draft.note(self.draft.given.place("components", name, "model"), text)
        else:
            self.draft.note_network(
                self.draft.given.place("units", origin.common.removesuffix("_parameters")), text
            )

    def _is_native(self, name: str, table: ComponentTable) -> bool:
        """The kind of FMU that a component of the catalogue gets; the strongest layer decides."""
        native = table.native
        for choice in (
            choice
            for layer in self.draft.given.layers
            for choice in layer.natives
            if choice.fits(name)
        ):
            try:
                native = choice.native
            except ValueError as error:
                self.draft.note(choice.place, str(error))
        return native

    def _check_trust(self, name: str, table: ComponentTable) -> None:
        """A file may come from anybody; only the user lets foreign code into this process."""
        if table.file is None or table.isolated is not False or self._case.trust_fmus:
            return
        if not is_ours(self.draft.given.directory / table.file):
            self.draft.note(
                self.draft.given.place("components", name, "isolated"),
                (
                    f"this file wants {table.file} to run in gfor's own process, where it can do "
                    "whatever you can; if you trust the FMU, say so by "
                    + Option.TRUST_FMUS
                    + " (in Python load(case, trust_fmus=True)), else remove 'isolated = false', "
                    "and it runs in a process that is closed off"
                ),
            )

    def _parts(self, name: str, table: ComponentTable) -> tuple[tuple[str, str], ...]:
        """The parts of a component of the catalogue; the strongest layer decides on each."""
        known = (
            parts_of(table.model)
            if table.model in model_names() and not takes_network(table)
            else {}
        )
        chosen = chosen_parts(table)
        choices = [choice for layer in self.draft.given.layers for choice in layer.parts]
        for choice in (c for c in choices if c.fits(name, has_part=c.part in known)):
            try:
                chosen[choice.part] = choice.name
            except ValueError as error:
                self.draft.note(choice.place, str(error))
        for part in (
            part
            for part in chosen
            if part not in known and (table.model is None or table.model in model_names())
        ):
            what = f"the model {table.model!r}" if table.model else "an FMU file"
            raise InputError(
                f"{part} = {chosen[part]!r}: {what} has no such part to choose; remove the key, or take the model "
                f"{_MADE_OF_RECORDS if part == RECORDS else _MADE_OF_PARTS}"
            )
        return tuple(chosen.items())

    def _build(self) -> None:
        """Build the FMUs that are described so far and not there; nothing is wrong with the case."""
        for name, planned in self._planned.items():
            self.draft.system.components[name].description = build_fmu(planned)

    def _description(
        self, name: str, table: ComponentTable, native: bool, parts: tuple[tuple[str, str], ...]
    ) -> FmuDescription:
        if table.file is not None:
            directory = self.draft.given.directory
            return bound_fmu(
                directory / table.file, directory / table.binding if table.binding else None
            )
        own = takes_network(table)
        if (
            not own
            and self.draft.network is not None
            and table is self.draft.tables.get(self.draft.grid or "")
        ):
            # A model with a network of its own is built anew, with the faults and ports that this one has besides.
            own = self.draft.network != network_of(table.model or "")
        if own and self.draft.network is None:
            raise InputError(
                f"the model {table.model!r} needs a [network] table and a [power_flow] table that names this component"
            )
        # a scan's current keeps the operating point
        model = STAND_IN if table.scan is not None else table.model or ""
        planned = plan_fmu(model, self.draft.network if own else None, native, parts)
        self._planned[name] = planned
        return planned.description

    def _area_questions(self) -> list[Problem]:
        given, system = self.draft.given, self.draft.system
        counts = "{} is in {}; it counts to {}, the first"
        return [
            Problem(
                given.place("analysis", "areas", found[1]),
                counts.format(name, " and ".join(found), found[0]),
                topic=QuestionTopic("a machine in two areas", name),
            )
            for name, found in in_two_areas(given.case.analysis.areas, system).items()
        ]
