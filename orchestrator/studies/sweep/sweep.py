"""A sweep: the modes of a case's scenarios over a grid of parameters, computed, kept, and followed."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import cast

import numpy as np

from orchestrator.cases.case import Case
from orchestrator.cases.form.build_choices import ALPHA
from orchestrator.cases.form.parameter_files import ParameterFile
from orchestrator.cases.form.schema import Value
from orchestrator.cases.questions.idle_values import Idle, idle_everywhere
from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.cases.settings.layers import joined_values
from orchestrator.core.errors import CaseError, InputError, Problem
from orchestrator.core.options import Option
from orchestrator.core.truth import all_true
from orchestrator.linear.spectra.mode_tracking import ModeSet, is_ambiguous
from orchestrator.studies.points.points import Work
from orchestrator.studies.points.task import StudyCase
from orchestrator.studies.sweep.axes import Axis, Vary, grid_places, refuse_doubles, resolve
from orchestrator.studies.sweep.limit import (
    COARSE,
    Ending,
    ParameterLimit,
    Until,
    least_damping,
    mode_behind,
    search,
)
from orchestrator.studies.sweep.point import (
    PointRecord,
    SweepPointTask,
    compute_point,
    fmus_kept_open,
)
from orchestrator.studies.sweep.request import SweepRequest
from orchestrator.studies.sweep.trajectories import GridPlace, Trajectory, find_trajectories

# how often the way between two points is halved where a mode is not recognised from one to the
# other
REFINEMENTS = 5


@dataclass(frozen=True)
class SweepPlan:
    case: Case
    # varied parameters; the last one runs fastest, and modes are followed along it
    axes: tuple[Axis, ...]
    scenarios: tuple[PreparedScenario, ...]  # the scenarios, prepared without the varied values
    # parameter files, and after them the values of the command line, that hold for all points; weakest first.
    layers: tuple[ParameterFile, ...]
    step_size: float | None  # communication step [s]; None for the case's
    frequency_range: tuple[float, float]  # [Hz]
    idle: tuple[Problem, ...] = ()  # questions about values that act in no scenario
    until: Until | None = None  # what is searched for along the only axis; None for a sweep alone
    black_box: bool = False  # as in `SweepPointTask`

    @property
    def overrides(self) -> dict[str, Value]:
        """Values by ``component.variable`` that hold for all points, those of the strongest layer that has the key."""
        return joined_values(self.layers)

    @property
    def number_of_points(self) -> int:
        return len(self.scenarios) * int(np.prod([len(axis.values) for axis in self.axes]))

    def values(self, place: GridPlace) -> dict[str, Value]:
        given = [
            axis.sets(_value_at(axis, position))
            for axis, position in zip(self.axes, place, strict=True)
        ]
        return {key: value for one in given for key, value in one.items()}

    @cached_property
    def studies(self) -> dict[str, StudyCase]:
        first = self.values(tuple(0 for _ in self.axes))
        return {
            one.name: StudyCase.of(one, self.layers, self.step_size, varied=first)
            for one in self.scenarios
        }

    def task(self, prepared: PreparedScenario, place: GridPlace) -> SweepPointTask:
        return SweepPointTask(
            self.studies[prepared.name], self.values(place), self.frequency_range, self.black_box
        )


def _value_at(axis: Axis, position: float) -> Value:
    below = int(position)
    if position == below:
        return axis.values[below]
    a, b, part = axis.values[below], axis.values[below + 1], position - below
    value = float(a * (b / a) ** part if axis.logarithmic else a + (b - a) * part)
    return value if axis.multiple_of is None else round(value / axis.multiple_of) * axis.multiple_of


@dataclass
class ScenarioSweep:
    prepared: PreparedScenario
    # points by place, including the refining points between two places of the grid.
    points: dict[GridPlace, PointRecord] = field(default_factory=dict)
    # modes followed over the grid, those with a name first.
    trajectories: list[Trajectory] = field(default_factory=list)

    def unstable(self, axes: Sequence[Axis]) -> list[GridPlace]:
        """Places of the grid where a mode grows at any frequency, the fastest first."""
        found = [
            place
            for place in grid_places(axes)
            if self.points[place].stability.get("stable") is False
        ]
        return sorted(found, key=lambda place: -self.points[place].stability["largest_growth_rate"])

    def counts(self, axes: Sequence[Axis]) -> Counter[bool | None]:
        """Numbers of grid places that are stable, that are not stable, and that have no verdict."""
        return Counter(self.points[place].stability.get("stable") for place in grid_places(axes))

    @property
    def stable(self) -> bool | None:
        return all_true(record.stability.get("stable") for record in self.points.values())


@dataclass
class SweepResult:
    plan: SweepPlan
    scenarios: list[ScenarioSweep]
    # computed, stored: number of points computed now, and number of points read from an earlier start.
    computed: int = 0
    stored: int = 0
    # number of refining points between grid points; both numbers above include them
    refined: int = 0
    # of each scenario, where they are searched for
    limits: list[ParameterLimit] = field(default_factory=list)

    def failures(self) -> Iterator[tuple[ScenarioSweep, GridPlace, str]]:
        """Points of the grid that have no modes, and why."""
        for sweep in self.scenarios:
            for place in grid_places(self.plan.axes):
                error = sweep.points[place].error
                if error is not None:
                    yield sweep, place, error


def plan_sweep(case: Case, request: SweepRequest) -> SweepPlan:
    vary, until = cast("Sequence[Vary]", request.vary), cast("Until | None", request.until)
    if not vary:
        raise InputError(
            "nothing is varied; give "
            + Option.VARY
            + ", such as "
            + Option.VARY
            + " grid.X_L=0.1:0.5:9, or "
            + Option.SCR
            + " bus_9=5:1.2:5"
        )
    vary = vary if until is None else [_searched(vary)]
    prepared = case.prepare(
        request.scenarios, request.overrides, request.step_size, None, request.files
    )
    axes = tuple(resolve(one, prepared) for one in vary)
    plan = SweepPlan(
        case,
        axes,
        scenarios=tuple(prepared),
        layers=request.layers,
        step_size=request.step_size,
        frequency_range=request.frequencies,
        idle=(),
        until=until,
        black_box=request.black_box,
    )
    refuse_doubles(axes, prepared)
    ends = [plan.values(tuple(end % len(axis.values) for axis in axes)) for end in (0, -1)]
    shares = any(axis.key == ALPHA for axis in axes)
    idle = [_check_end(plan, varied) for varied in (ends if shares else ends[:1])]
    return replace(plan, idle=tuple(idle[0]))


def _searched(vary: Sequence[Vary]) -> Vary:
    if len(vary) != 1:
        raise InputError(
            Option.UNTIL
            + f" searches along one range, and {len(vary)} are varied; give one "
            + Option.VARY
            + " (several parameters that move together stand in it with commas)"
        )
    if vary[0].limits is None:
        raise InputError(
            Option.VARY
            + f" {vary[0].key}: "
            + Option.UNTIL
            + f" needs a range such as {vary[0].key}=0.1:1.0, not a list"
        )
    return vary[0] if vary[0].count else replace(vary[0], count=COARSE)


def _check_end(plan: SweepPlan, varied: Mapping[str, Value]) -> list[Problem]:
    """Prepare one point of every scenario at an end of the grid. This finds parameters that cannot be varied, and those
    that cannot act, and builds FMUs that only this end needs."""
    marks: dict[str, str] = {(Option.SET + f" {key}"): (Option.VARY + f" {key}") for key in varied}
    found: dict[Problem, list[str]] = {}
    idle: list[Idle] = []
    case = replace(plan.case, varied=frozenset(varied))
    for name in [prepared.name for prepared in plan.scenarios]:
        try:
            (one,) = case.prepare([name], varied, plan.step_size, None, plan.layers)
            idle.append(one.idle)
        except CaseError as error:
            for problem in error.problems:
                # a question beside a failure of this end alone, such as no power flow, refuses no sweep
                if problem.place in marks and not problem.besides:
                    found.setdefault(Problem(marks[problem.place], problem.text), []).append(name)
    if found:
        everywhere = len(plan.scenarios)
        wrong = [
            p
            if len(names) == everywhere
            else Problem(p.place, f"{p.text} (scenario {', '.join(names)})")
            for p, names in found.items()
        ]
        raise CaseError(plan.case.source, wrong)
    return [replace(p, place=marks.get(p.place, p.place)) for p in idle_everywhere(idle)]


def run_sweep(plan: SweepPlan, work: Work) -> SweepResult:
    """Compute the points that are not stored yet, then follow the modes. Further points are added where a mode is not
    recognised."""
    with fmus_kept_open(work.executor):
        return _swept(plan, work)


def _swept(plan: SweepPlan, work: Work) -> SweepResult:
    result = SweepResult(plan, [ScenarioSweep(prepared) for prepared in plan.scenarios])
    grid = list(grid_places(plan.axes))
    wanted: list[tuple[ScenarioSweep, GridPlace]] = [
        (sweep, place) for sweep in result.scenarios for place in grid
    ]
    _fill(result, wanted, work)
    if plan.until is not None:
        result.limits = [_limit(result, sweep, work) for sweep in result.scenarios]
    for depth in range(1, REFINEMENTS + 1):
        gaps = [
            (s, place) for s in result.scenarios for place in _gaps(plan, s, 0.5 ** (depth - 1))
        ]
        if not gaps:
            break
        result.refined += len(gaps)
        _fill(result, gaps, work)
    names = [table.name for table in plan.case.table.analysis.modes]
    result.computed, result.stored = work.computed, work.stored
    for sweep in result.scenarios:
        sweep.trajectories = find_trajectories(sweep.points, names, plan.frequency_range)
    return result


def _fill(
    result: SweepResult, wanted: Sequence[tuple[ScenarioSweep, GridPlace]], work: Work
) -> None:
    tasks = [result.plan.task(sweep.prepared, place) for sweep, place in wanted]
    for index, record in work.each(compute_point, tasks):
        sweep, place = wanted[index]
        sweep.points[place] = record


def _limit(result: SweepResult, sweep: ScenarioSweep, work: Work) -> ParameterLimit:
    plan, (axis,) = result.plan, result.plan.axes
    until = plan.until or Until()
    count = len(axis.values)

    def kind_at(place: float) -> Ending:
        if (place,) not in sweep.points:
            _fill(result, [(sweep, (place,))], work)
            result.refined += 1
        return until.kind(sweep.points[(place,)])

    def between(low: float, high: float) -> bool:
        return _value_at(axis, (low + high) / 2) not in (
            _value_at(axis, low),
            _value_at(axis, high),
        )

    def value(place: float | None) -> float | None:
        return None if place is None else float(_value_at(axis, place))

    grid = [sweep.points[(k,)] for k in range(count)]
    holds, beyond, again = search([until.kind(record) for record in grid], kind_at, between)
    end = Ending.HOLDS if beyond is None else kind_at(beyond)
    worst = min(range(count), key=lambda k: _margin(grid[k]))
    shown = sweep.points[(float(worst) if beyond is None else beyond,)]
    mode, who = mode_behind(shown, plan.case.table.analysis.swing)
    tried = [
        {
            "value": float(axis.values[k]),
            "kind": str(until.kind(record)),
            "damping_percent": least_damping(record),
            "largest_growth_rate": record.stability.get("largest_growth_rate"),
            "error": record.error,
        }
        for k, record in enumerate(grid)
    ]
    why = shown.error or (str(shown.stability.get("reason", "")) if end is Ending.NOT_KNOWN else "")
    return ParameterLimit(
        axis.key,
        axis.unit,
        scenario=sweep.prepared.name,
        title=sweep.prepared.title,
        until=until,
        kind=end,
        holds_at=value(holds),
        beyond=value(beyond),
        mode=mode,
        who=who,
        tried=tuple(tried),
        again=tuple(float(axis.values[k]) for k in again),
        why=why,
        worst_at=float(axis.values[worst]),
        strained=None if holds is None else _first_overloads(sweep, axis, holds),
    )


def _first_overloads(
    sweep: ScenarioSweep, axis: Axis, holds: float
) -> tuple[float, tuple[str, ...]] | None:
    """The first value, up to the limit, at which units feed more than their rating, and these units.

    Those that do so at the axis' first value already are left out."""
    within = sweep.points[(0,)].overloads
    for place in sorted(sweep.points):
        beyond = tuple(name for name in sweep.points[place].overloads if name not in within)
        if beyond and place[0] <= holds:
            return float(_value_at(axis, place[0])), beyond
    return None


def _margin(record: PointRecord) -> float:
    rate = record.stability.get("largest_growth_rate")
    least = least_damping(record)
    if least is not None:
        return least
    return np.inf if rate is None else -rate


def _gaps(plan: SweepPlan, sweep: ScenarioSweep, width: float) -> Iterator[GridPlace]:
    """Middles between two neighbours along the last axis, ``width`` apart, where a mode of the first is not recognised
    in the second, and where there is a value in between: 1 and 2 of a whole number have none."""
    axis = plan.axes[-1]
    if any(isinstance(value, bool) for value in axis.values):
        return
    modes: dict[GridPlace, ModeSet] = {
        p: r.modes for p, r in sweep.points.items() if r.modes is not None
    }
    for place in sorted(modes):
        *row, at = place
        following = (*row, at + width)
        middle = (*row, at + width / 2)
        if following not in modes or middle in sweep.points:
            continue
        if _value_at(axis, middle[-1]) in (_value_at(axis, at), _value_at(axis, following[-1])):
            continue
        if is_ambiguous(modes[place], modes[following], plan.frequency_range):
            yield middle
