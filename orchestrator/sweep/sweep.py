"""A sweep: the modes of a case's scenarios over a grid of parameters, computed, kept, and followed."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from orchestrator.analysis.mode_tracking import ModeSet, is_ambiguous
from orchestrator.analysis.modes import ELECTROMECHANICAL_HZ
from orchestrator.cases.case import Case
from orchestrator.cases.prepare import PreparedScenario
from orchestrator.cases.schema import Value
from orchestrator.errors import CaseError, Problem
from orchestrator.points.executor import Executor
from orchestrator.points.points import CountReport, kept_or_computed
from orchestrator.points.store import PointStore
from orchestrator.sweep.axes import ALPHA, Axis, Vary, grid_places, resolve
from orchestrator.sweep.point import PointRecord, SweepPointTask, compute_point, make_task
from orchestrator.sweep.trajectories import GridPlace, Trajectory, find_trajectories

REFINEMENTS = 5
"""How often the way between two points is halved where a mode is not recognised from one to the other."""


@dataclass(frozen=True)
class SweepPlan:
    """What is to be computed.

    Attributes
    ----------
    axes
        Varied parameters; the last one runs fastest, and modes are followed along it.
    scenarios
        Prepared without what is varied.
    overrides
        Values by ``component.variable`` that hold for all points.
    step_size
        Communication step [s]; None for the case's.
    frequency_range
        [Hz]
    """

    case: Case
    axes: tuple[Axis, ...]
    scenarios: tuple[PreparedScenario, ...]
    overrides: dict[str, Value]
    step_size: float | None
    frequency_range: tuple[float, float]

    @property
    def number_of_points(self) -> int:
        """Points of the grid in all scenarios."""
        return len(self.scenarios) * int(np.prod([len(axis.values) for axis in self.axes]))

    def values(self, place: GridPlace) -> dict[str, Value]:
        """What is set at a place; between two places of the last axis, what lies between their values."""
        return {axis.key: _value_at(axis, position) for axis, position in zip(self.axes, place, strict=True)}

    def task(self, prepared: PreparedScenario, place: GridPlace) -> SweepPointTask:
        """The task of one point."""
        varied = self.values(place)
        return make_task(prepared, self.overrides, varied, self.step_size, self.frequency_range)


def _value_at(axis: Axis, position: float) -> Value:
    below = int(position)
    if position == below:
        return axis.values[below]
    a, b, part = axis.values[below], axis.values[below + 1], position - below
    if axis.logarithmic:
        return float(a * (b / a) ** part)
    return float(a + (b - a) * part)


@dataclass
class ScenarioSweep:
    """One scenario over the grid.

    Attributes
    ----------
    points
        By place, the refining ones between two places of the grid included.
    trajectories
        Modes followed over the grid, those with a name first.
    """

    prepared: PreparedScenario
    points: dict[GridPlace, PointRecord] = field(default_factory=dict)
    trajectories: list[Trajectory] = field(default_factory=list)

    def unstable(self, axes: Sequence[Axis]) -> list[GridPlace]:
        """Places of the grid where a mode grows at any frequency, the fastest first."""
        found = [place for place in grid_places(axes) if self.points[place].is_unstable]
        return sorted(found, key=lambda place: -self.points[place].stability["largest_growth_rate"])

    def counts(self, axes: Sequence[Axis]) -> Counter[bool | None]:
        """How many places of the grid are stable, are not, and have no verdict."""
        return Counter(self.points[place].stability.get("stable") for place in grid_places(axes))

    @property
    def stable(self) -> bool | None:
        """Whether every point is stable; None where a point has no verdict and none is unstable."""
        verdicts = [record.stability.get("stable") for record in self.points.values()]
        if any(verdict is False for verdict in verdicts):
            return False
        return True if all(verdicts) else None


@dataclass
class SweepResult:
    """All points of a sweep.

    Attributes
    ----------
    computed, stored
        Points that were computed now, and those that an earlier start had left.
    refined
        Points between those of the grid, among both.
    """

    plan: SweepPlan
    scenarios: list[ScenarioSweep]
    computed: int = 0
    stored: int = 0
    refined: int = 0

    def failures(self) -> Iterator[tuple[ScenarioSweep, GridPlace, str]]:
        """Points of the grid that have no modes, and why."""
        for sweep in self.scenarios:
            for place in grid_places(self.plan.axes):
                error = sweep.points[place].error
                if error is not None:
                    yield sweep, place, error


def plan_sweep(
    case: Case,
    vary: Sequence[Vary],
    scenarios: Sequence[str] = (),
    overrides: Mapping[str, Value] | None = None,
    step_size: float | None = None,
    frequency_range: tuple[float, float] = ELECTROMECHANICAL_HZ,
) -> SweepPlan:
    """Check a sweep, and build the FMUs that it needs.

    Parameters
    ----------
    case
        The file that is swept.
    vary
        What is varied, one for each axis; modes are followed along the last one.
    scenarios
        Names; all of them where empty.
    overrides
        Values by ``component.variable`` that hold at every point.
    step_size
        Communication step [s]; the case's where None.
    frequency_range
        Modes of these frequencies are followed [Hz].

    Raises
    ------
    InputError
        If something is wrong that no point can do anything about.
    """
    fixed = dict(overrides or {})
    prepared = case.prepare(scenarios, fixed, step_size)
    axes = tuple(resolve(one, prepared) for one in vary)
    plan = SweepPlan(case, axes, tuple(prepared), fixed, step_size, frequency_range)
    ends = [{axis.key: axis.values[end] for axis in axes} for end in (0, -1)]
    for varied in ends if any(axis.key == ALPHA for axis in axes) else ends[:1]:
        _check_end(plan, varied)
    return plan


def _check_end(plan: SweepPlan, varied: Mapping[str, Value]) -> None:
    """Prepare one point at an end: it shows what cannot be varied, and builds FMUs that only appear there."""
    try:
        plan.case.prepare([plan.scenarios[-1].name], {**plan.overrides, **varied}, plan.step_size)
    except CaseError as error:
        marks = {f"--set {key}": f"--vary {key}" for key in varied}
        wrong = [Problem(marks[p.place], p.text) for p in error.problems if p.place in marks]
        if wrong:
            raise CaseError(str(plan.case.path), wrong) from error


def run_sweep(
    plan: SweepPlan,
    executor: Executor,
    store: PointStore,
    report: CountReport = lambda done, total: None,
) -> SweepResult:
    """Compute what is not stored yet, then follow the modes, with more points where one is not recognised.

    Parameters
    ----------
    plan
        What is computed, as `plan_sweep` found it to be in order.
    executor
        Where the points are computed.
    store
        Keeps every point as soon as it is there.
    report
        Progress.
    """
    result = SweepResult(plan, [ScenarioSweep(prepared) for prepared in plan.scenarios])
    grid = list(grid_places(plan.axes))
    wanted: list[tuple[ScenarioSweep, GridPlace]] = [(sweep, place) for sweep in result.scenarios for place in grid]
    _fill(result, wanted, executor, store, report)
    for depth in range(1, REFINEMENTS + 1):
        gaps = [(s, place) for s in result.scenarios for place in _gaps(plan, s, 0.5 ** (depth - 1))]
        if not gaps:
            break
        result.refined += len(gaps)
        _fill(result, gaps, executor, store, report)
    names = [table.name for table in plan.case.table.analysis.modes]
    for sweep in result.scenarios:
        sweep.trajectories = find_trajectories(sweep.points, names, plan.frequency_range)
    return result


def _fill(
    result: SweepResult,
    wanted: Sequence[tuple[ScenarioSweep, GridPlace]],
    executor: Executor,
    store: PointStore,
    report: CountReport,
) -> None:
    """Load or compute some points."""
    tasks = [result.plan.task(sweep.prepared, place) for sweep, place in wanted]
    before = result.stored + result.computed

    def report_all(done: int, total: int) -> None:
        report(before + done, before + total)

    for index, record, stored in kept_or_computed(PointRecord, compute_point, tasks, executor, store, report_all):
        sweep, place = wanted[index]
        sweep.points[place] = record
        result.stored += stored
        result.computed += not stored


def _gaps(plan: SweepPlan, sweep: ScenarioSweep, width: float) -> Iterator[GridPlace]:
    """Middles between neighbours along the last axis, ``width`` apart, with a mode that is not recognised."""
    if any(isinstance(value, bool) for value in plan.axes[-1].values):
        return
    modes: dict[GridPlace, ModeSet] = {p: r.modes for p, r in sweep.points.items() if r.modes is not None}
    for place in sorted(modes):
        *row, at = place
        following = (*row, at + width)
        middle = (*row, at + width / 2)
        if following not in modes or middle in sweep.points:
            continue
        if is_ambiguous(modes[place], modes[following], plan.frequency_range):
            yield middle
