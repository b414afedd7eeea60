"""A study of interactions: its systems planned, and computed at the same operating point."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

from orchestrator.cases.case import Case
from orchestrator.cases.form.build_choices import STAND_IN
from orchestrator.cases.form.parameter_files import ParameterFile
from orchestrator.cases.form.schema import ComponentTable
from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.core.asked import names
from orchestrator.core.errors import CaseError, InputError, Problem
from orchestrator.core.options import Option
from orchestrator.studies.interactions.exchange import (
    exchanged_case,
    require_same_flow,
    voltages_of,
)
from orchestrator.studies.interactions.places import Place, groups_of, places_of, vendors_of
from orchestrator.studies.interactions.point import SystemRecord, SystemTask, compute_system
from orchestrator.studies.interactions.request import InteractionsRequest
from orchestrator.studies.interactions.systems import (
    Exchanged,
    Kind,
    SystemName,
    assignments,
    systems_of_vendors,
)
from orchestrator.studies.points.key import component_content
from orchestrator.studies.points.points import Work
from orchestrator.studies.points.task import StudyCase


@dataclass(frozen=True)
class InteractionsPlan:
    case: Case
    prepared: PreparedScenario
    # parameter files, and after them the values of the command line; weakest first
    layers: tuple[ParameterFile, ...]
    step_size: float | None  # communication step [s]; None for the case's
    request: InteractionsRequest
    places: dict[str, Place]  # the converters, by component
    groups: dict[str, str]  # group of every component: its vendor, or what else it is
    stand_in: str  # model at the places of the vendors that a system does without
    swapped: tuple[str, ...]  # places that are swapped; none without a swap
    systems: dict[SystemName, Exchanged]  # devices that are other than the case's, of every system
    # what stands for the files of such devices in keys, by model or file
    files: dict[str, list[str]]

    @property
    def vendors(self) -> tuple[str, ...]:
        return vendors_of(self.places)

    def converters(self, name: SystemName) -> frozenset[str]:
        """The places of a system at which a vendor's converter stands, and no stand-in."""
        if name.kind is Kind.ASSIGNMENT:
            return frozenset(self.places)
        return frozenset(self.places) - frozenset(self.systems[name])

    @cached_property
    def study(self) -> StudyCase:
        return StudyCase.of(self.prepared, self.layers, self.step_size)

    def task(self, exchanged: Exchanged) -> SystemTask:
        tables = {
            name: table.model_dump(exclude_defaults=True) for name, table in exchanged.items()
        }
        files = {name: self.files[_content_name(table)] for name, table in exchanged.items()}
        voltages = {
            bus: (v.real, v.imag) for bus, v in voltages_of(self.prepared.power_flow).items()
        }
        return SystemTask(
            self.study, self.request.frequencies, tables, files, self.request.black_box, voltages
        )


@dataclass
class InteractionsResult:
    plan: InteractionsPlan
    records: dict[SystemName, SystemRecord] = field(default_factory=dict)
    # computed, stored: Number of systems computed now, and number read from an earlier start. Systems of the same
    # devices count once.
    computed: int = 0
    stored: int = 0


def plan_interactions(case: Case, request: InteractionsRequest) -> InteractionsPlan:
    name, layers, step_size = _scenario(case, request.scenario), request.layers, request.step_size
    (prepared,) = case.prepare([name], request.overrides, step_size, None, request.files)
    components = case.tables_and_plans(name, {}, layers)
    grid = None if case.table.power_flow is None else case.table.power_flow.grid
    places = places_of(components, grid)
    if not places:
        raise InputError(
            f"{case.source}: scenario {name!r} has no converter: no component with the inputs v_re, v_im and the "
            "outputs i_re, i_im that is no generator; to mark a component as a converter, set 'vendor' in its table"
        )
    sources = (c.source for c in prepared.system.connections)
    # an emf behind an admittance
    phasors = any(s.component in places and s.variable == "y_re" for s in sources)
    stand_in = request.stand_in or (f"{STAND_IN}_phasor" if phasors else STAND_IN)
    systems, swapped = systems_of_vendors(places, stand_in), tuple[str, ...]()
    devices = request.given_devices()
    if request.swap or devices:
        swapped = _swapped(places, names(request.places, "places"))
        systems |= assignments(places, swapped, devices)
    files = _tried(case, prepared, layers, step_size, systems)
    groups = groups_of(components, places, grid)
    return InteractionsPlan(
        case,
        prepared,
        layers=layers,
        step_size=step_size,
        request=request,
        places=places,
        groups=groups,
        stand_in=stand_in,
        swapped=swapped,
        systems=systems,
        files=files,
    )


def run_interactions(plan: InteractionsPlan, work: Work) -> InteractionsResult:
    """Compute the systems that are not stored yet; systems of the same devices are computed once."""
    tasks = {name: plan.task(exchanged) for name, exchanged in plan.systems.items()}
    wanted = {task.key: task for task in tasks.values()}
    found = dict(zip(wanted, work.all(compute_system, list(wanted.values())), strict=True))
    records = {name: found[task.key] for name, task in tasks.items()}
    return InteractionsResult(plan, records, work.computed, work.stored)


def _scenario(case: Case, wanted: str | None) -> str:
    known = list(case.scenarios)
    if wanted is None and len(known) > 1:
        raise InputError(
            f"{case.source}: the case has several scenarios, and interactions are those of "
            "one; choose it with " + Option.SCENARIO + f": {', '.join(known)}"
        )
    return known[0] if wanted is None else wanted


def _swapped(places: Mapping[str, Place], wanted: Sequence[str]) -> tuple[str, ...]:
    unknown = [name for name in wanted if name not in places]
    if unknown:
        raise InputError(
            Option.PLACE
            + f" {unknown[0]}: no converter stands there; the places of converters are: "
            f"{', '.join(places)}"
        )
    return tuple(dict.fromkeys(wanted)) or tuple(places)


def _tried(
    case: Case,
    prepared: PreparedScenario,
    layers: Sequence[ParameterFile],
    step_size: float | None,
    systems: Mapping[SystemName, Exchanged],
) -> dict[str, list[str]]:
    """Prepare one system for each device that is other than the case's: this finds what cannot stand there, and builds
    its FMU. What stands for its file in keys, by `_content_name`."""
    voltages, files = voltages_of(prepared.power_flow), dict[str, list[str]]()
    seen: set[tuple[str, str]] = set()
    for name, exchanged in systems.items():
        new = {(place, _content_name(table)) for place, table in exchanged.items()} - seen
        if not new:
            continue
        seen |= new
        try:
            (changed,) = exchanged_case(case, exchanged).prepare(
                [prepared.name], {}, step_size, None, layers
            )
        except CaseError as error:
            what = ", ".join(
                f"{_content_name(exchanged[place])} at {place}"
                for place in sorted({p for p, _ in new})
            )
            head = "assignment" if name.kind is Kind.ASSIGNMENT else "stand-in"
            raise CaseError(
                case.source,
                [Problem(f"{head}: {what}", str(problem)) for problem in error.problems],
            ) from error
        require_same_flow(voltages, changed)
        for place, table in exchanged.items():
            files[_content_name(table)] = component_content(
                changed.system.components[place].description
            )
    return files


def _content_name(table: ComponentTable) -> str:
    return (
        f"{table.model or table.file or ''}{'' if table.binding is None else f' ({table.binding})'}"
    )
