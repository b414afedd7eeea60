"""A design over operating points and outages: open loops of all points, the search, and all modes computed anew."""

from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, MISSING, dataclass, replace
from functools import partial
from itertools import product
from typing import Any

import numpy as np

from orchestrator.cases.case import Case
from orchestrator.cases.form.definition import CaseDefinition
from orchestrator.cases.form.schema import Value
from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.cases.settings.layers import OptionValues
from orchestrator.core.asked import (
    DAMPING,
    GAIN_BOUNDS,
    NAMES,
    OUTAGES,
    RANKED,
    STAGES,
    Names,
    request_field,
)
from orchestrator.core.errors import AnalysisError, InputError
from orchestrator.core.options import Option
from orchestrator.core.threads import one_thread
from orchestrator.linear.spectra.modes import Mode
from orchestrator.studies.coordinated_design.following import with_followed_names
from orchestrator.studies.coordinated_design.objective import Aim, RatedPoint, worth_of_all
from orchestrator.studies.coordinated_design.open_loops import PodPlace
from orchestrator.studies.coordinated_design.point import PointModes, PointsTask, compute_points
from orchestrator.studies.coordinated_design.search import (
    RankedConverter,
    SettingSearch,
    Tried,
    best_first,
    ranked,
)
from orchestrator.studies.coordinated_design.settings import PodGroup, SettingSpace
from orchestrator.studies.coordinated_design.verdict import (
    MORE,
    JudgedPoint,
    PointsVerdict,
    judge_points,
    least_of,
)
from orchestrator.studies.modes.naming import modes_named
from orchestrator.studies.operating_points.plan import OperatingPoints, read_operating_points
from orchestrator.studies.pod_design.closed_loop import PodSetting, check_tunable
from orchestrator.studies.pod_design.stages import (
    GAIN_ALONE,
    LEAD_LAG,
    count_stages,
    neutral_time,
)
from orchestrator.studies.pod_design.target import (
    check_range,
    find_scenario,
    find_target,
    require_controllers,
    with_controller,
)
from orchestrator.studies.points.points import Work, nobody
from orchestrator.studies.points.request import POINTS_FILE, OverCluster, of_scenario, of_values
from orchestrator.studies.points.task import StudyCase
from orchestrator.studies.points.under_way import tell_doing

ALL = "all"  # stands for all electromechanical modes
# damping ratio beyond the wanted one with which a search for the smallest gain is content
_SPARE = 1e-4
TOGETHER = 4  # operating points with outages that are computed together


@dataclass(frozen=True)
class PointsDesignRequest(OverCluster):
    """Design POD controllers with one setting for many operating points, each with its outages.

    Raises
    ------
    InputError
        If points, outages, scenario, components or modes cannot be used.
    AnalysisError
        If no point has modes.

    Examples
    --------
    >>> import orchestrator as gfor
    >>> from pathlib import Path
    >>> lines = "name,grid.X_L", "short,0.05", "long,0.3"
    >>> _ = Path("two.csv").write_text(chr(10).join(lines))
    >>> design = gfor.load("two_area").design_over_points("two.csv", damping=15)
    >>> design.met
    True
    >>> bool(design.points()["damping_percent"].min() >= 15)
    True
    """

    points: Any = request_field(
        POINTS_FILE, MISSING, "operating points: a CSV file, as gfor screen has it"
    )
    controllers: Sequence[str] = request_field(
        NAMES,
        ("pod_p",),
        '``"pod_p"``, ``"pod_q"``, or several; each gets a setting of its own, and as many as components are pairs',
        option=None,
    )
    outages: Names | None = request_field(
        OUTAGES, None, "n-1, lines, units, or names, each at every point (repeatable)"
    )
    scenario: str | None = of_scenario("its name; by default the one without these controllers")
    values: Mapping[str, Any] | None = of_values()
    _: KW_ONLY
    components: Sequence[str] = request_field(
        NAMES,
        (),
        "converters, or patterns, each with a setting of its own; as many as controllers: pairs",
        option="--component",
    )
    modes: Sequence[str] = request_field(
        NAMES, (), "the case's modes to damp (default: all from 0.1 to 2 Hz)", option="--mode"
    )
    damping: float | None = request_field(
        DAMPING,
        None,
        "required damping, such as 20",
        python="wanted everywhere; the best that there is by default",
    )
    gain_bounds: tuple[float, float] = request_field(
        GAIN_BOUNDS, (0.0, 400.0), "bounds of every gain [pu]"
    )
    stages: int | None = request_field(
        STAGES, None, "lead/lag stages (default: the components' own)"
    )
    # no other mode may fall below this damping ratio, or, where it is below already, below what it has
    least_damping: float = request_field(
        DAMPING,
        0.05,
        "damping below which no other mode may be pushed (default: 5)",
        option="--min-damping",
    )
    ranked: int = request_field(
        RANKED,
        3,
        "converters for which a controller alone is designed to rank them (default: 3)",
        option="--rank",
    )


@dataclass(frozen=True)
class PointsDesignPlan:
    request: PointsDesignRequest
    case: Case
    read: OperatingPoints
    groups: tuple[PodGroup, ...]
    candidates: tuple[PodPlace, ...]
    off: Mapping[str, Value]
    aim: Aim

    @property
    def prepared(self) -> PreparedScenario:
        return self.read.prepared


def plan_points_design(case: Case, request: PointsDesignRequest) -> PointsDesignPlan:
    require_controllers(request.controllers)
    groups = _groups(case, request)
    known = [table.name for table in case.table.analysis.modes]
    for name in request.modes:
        if name not in known:
            raise InputError(
                Option.MODE
                + f": the case names no mode {name!r}; it names: {', '.join([*known, ALL])}"
            )
    scenario = _scenario(case, request)
    candidates = _candidates(case, request, scenario, groups)
    off: dict[str, Value] = {}
    plan = case.components_of(scenario, request.overrides, request.files)
    for place in candidates:
        time = neutral_time(plan[place.component], place.controller)
        off[f"{place.name}.enabled"] = False
        if time != GAIN_ALONE:
            off |= {f"{place.name}.{name}": time or 0.0 for name in LEAD_LAG}
    settable = [group for group in groups if group.neutral is None]
    off |= {
        f"{place.name}.N_S": float(group.stages) for group in settable for place in group.places
    }
    read = read_operating_points(case, request, request.points, request.outages, scenario, off)
    plans = read.prepared.system.components
    for group in groups:
        for bound in request.gain_bounds:
            check_range(plans, group.components, f"{group.controller}.K", bound, Option.GAIN_BOUNDS)
    for place in candidates:
        check_tunable(place.component, plans[place.component].description, place.controller)
    clash = {key for item in read.items for key in item.values} & {
        *off,
        *(f"{p.name}.K" for p in candidates),
    }
    if clash:
        raise InputError(
            f"{request.points}: the column for {min(clash)} sets what is to be designed; leave it out"
        )
    naming = partial(naming_of, case) if request.modes else None
    aim = Aim(tuple(request.modes), request.least_damping, naming)
    return PointsDesignPlan(
        case=case,
        request=request,
        read=read,
        groups=groups,
        candidates=candidates,
        off=off,
        aim=aim,
    )


def naming_of(case: CaseDefinition, names: Sequence[str], modes: list[Mode]) -> Mapping[str, Mode]:
    return modes_named(case, names, modes).named


def _groups(case: Case, request: PointsDesignRequest) -> tuple[PodGroup, ...]:
    """The controllers with a setting of their own."""
    found: list[PodGroup] = []
    for controller, pattern in _pairs(request):
        target = find_target(
            case,
            controller,
            scenario=request.scenario,
            pattern=pattern,
            stages=request.stages,
            overrides=request.overrides,
            parameters=request.files,
        )
        group = PodGroup(
            controller,
            target.components,
            target.key,
            target.stages,
            target.neutral,
            target.remarks,
        )
        for other in found:
            shared = set(other.places) & set(group.places)
            if shared:
                raise InputError(
                    Option.COMPONENT
                    + f": {min(shared).component} is in two of the patterns; a converter gets one "
                    "setting: let each pattern have converters of its own"
                )
        found.append(group)
    return tuple(found)


def _pairs(request: PointsDesignRequest) -> list[tuple[str, str | None]]:
    """Controllers with patterns of converters: of as many of both, several, the first with the first and so on; else
    each with each."""
    controllers, patterns = request.controllers, request.components
    if len(controllers) == len(patterns) > 1:
        return list(zip(controllers, patterns, strict=True))
    return list(product(dict.fromkeys(controllers), patterns or (None,)))


def _scenario(case: Case, request: PointsDesignRequest) -> str:
    return find_scenario(
        case,
        request.controllers[0],
        scenario=request.scenario,
        overrides=request.overrides,
        parameters=request.files,
    )


def _candidates(
    case: Case, request: PointsDesignRequest, scenario: str, groups: Sequence[PodGroup]
) -> tuple[PodPlace, ...]:
    """Loops of the groups, and for the ranking those of other converters whose controller is off."""
    own = [place for group in groups for place in group.places]
    plan = case.components_of(scenario, request.overrides, request.files)
    for controller in request.controllers if request.ranked else ():
        able = with_controller(plan, controller)
        own += [
            PodPlace(name, controller)
            for name in able
            if not plan[name].value(f"{controller}.enabled")
        ]
    return tuple(dict.fromkeys(own))


@dataclass(frozen=True)
class PointsDesign:
    plan: PointsDesignPlan
    frequency: float  # ω that the centres relate to [rad/s]
    settings: tuple[PodSetting, ...]
    # the search's own figures, on the linear models; nothing of the verdict rests on them
    found: Tried
    # every operating point with every outage, without the controllers and with them, all modes computed anew
    points: tuple[JudgedPoint, ...]
    # converters by what a controller there alone would give, the best first
    ranking: tuple[RankedConverter, ...]
    evaluations: int
    compared: int = 0  # number of settings of an exhaustive grid that were tried; 0 without one
    thin: float | None = None  # as `PointsVerdict` has it

    @property
    def used(self) -> list[tuple[PodGroup, PodSetting]]:
        """The controllers with a gain."""
        placed = zip(self.plan.groups, self.settings, strict=True)
        return [(group, setting) for group, setting in placed if setting.gain]

    @property
    def left_out(self) -> list[PodGroup]:
        """The controllers whose gains bring nothing."""
        placed = zip(self.plan.groups, self.settings, strict=True)
        return [group for group, setting in placed if not setting.gain]

    @property
    def verdict(self) -> PointsVerdict:
        request = self.plan.request
        return PointsVerdict(
            self.points,
            request.damping,
            request.gain_bounds[1],
            self.compared,
            self.thin,
            names=request.modes,
        )


def design_over_points(plan: PointsDesignPlan, work: Work) -> PointsDesign:
    # each point is computed twice, and counted once: half of the count is that without the controllers
    tell_doing("operating points without the controllers")
    first = replace(work, report=lambda n, of: work.report((n + 1) // 2, of))
    before = modes_at(plan, plan.off, plan.candidates, first)
    usable = [k for k, point in enumerate(before) if point.loops is not None]
    if not usable:
        raise AnalysisError(
            f"no operating point has modes, so nothing can be designed; the first: {before[0].text}"
        )
    frequency = _frequency([before[k] for k in usable])
    largest = plan.request.gain_bounds[1]
    own = {place: largest for group in plan.groups for place in group.places}
    space = SettingSpace(plan.groups, plan.request.gain_bounds, frequency)
    with one_thread():  # thousands of small matrices, of which two threads take many times the time
        rated = [
            RatedPoint(k, loops, plan.aim, own)
            for k in usable
            if (loops := before[k].loops) is not None
        ]
        search = SettingSearch(space, rated)
        best = _search(search, plan)
    settings, setting = tuple(space.group_settings(best.tried.x)), space.setting(best.tried.x)
    tell_doing("operating points with the controllers")
    then = replace(work, report=lambda n, of: work.report((of + 1) // 2 + n * (of // 2) // of, of))
    after = modes_at(plan, values_of(plan.groups, settings), (), then)
    after = with_followed_names(plan.aim.names, before, after, setting)
    tell_doing("ranking")
    places = [place for group in plan.groups for place in group.places]
    known = None
    if len(places) == 1 and not best.reached:  # the least gain is not the best
        known = _KnownDesign(places[0], settings[0], after)
    ranking = _ranking(plan, rated, frequency, before, known, work)
    with one_thread():
        predicted = {
            point.number: worth_of_all(point.loops, setting, plan.aim, point.apart)
            for point in rated
        }
    where = [plan.read.of(item) for item in plan.read.items]
    points = judge_points(where, before, after, plan.aim, predicted, _apart(rated), setting=setting)
    return PointsDesign(
        plan,
        frequency,
        settings=settings,
        found=best.tried,
        points=tuple(points),
        ranking=ranking,
        evaluations=search.evaluations,
        compared=best.compared,
        thin=best.thin,
    )


@dataclass(frozen=True)
class _BestSettings:
    """The best settings on the linear models; ``compared`` and ``thin`` as `PointsDesign` has them."""

    tried: Tried
    compared: int
    reached: bool  # whether they give the damping that is wanted
    thin: float | None = None


def _search(search: SettingSearch, plan: PointsDesignPlan) -> _BestSettings:
    """Search for the best settings, and where they give more than is wanted, for the least gain that suffices."""
    wanted, tried, compared = plan.request.damping, search.best(), 0
    if wanted is None:
        return _BestSettings(search.without_idle(tried, None), compared, reached=False)
    enough = wanted + _SPARE
    if not (tried.worth.allowed and tried.worth.worst >= enough):
        tried, compared = search.over_grid(tried)
    tried = search.without_idle(tried, enough)
    if not (tried.worth.allowed and tried.worth.worst >= enough):
        return _BestSettings(tried, compared, reached=False)
    tried = search.with_least_gain(tried, enough)
    more = search.tried(tried.x * np.tile([1.0, 1.0, MORE], len(plan.groups))).worth
    thin = None if more.worst >= wanted and more.allowed else more.worst
    return _BestSettings(tried, compared, reached=True, thin=thin)


@dataclass(frozen=True)
class _KnownDesign:
    """The best setting of a controller alone where the design itself is one, with the modes that it gives."""

    place: PodPlace
    setting: PodSetting
    points: Sequence[PointModes]


def _ranking(
    plan: PointsDesignPlan,
    rated: Sequence[RatedPoint],
    frequency: float,
    before: Sequence[PointModes],
    known: _KnownDesign | None,
    work: Work,
) -> tuple[RankedConverter, ...]:
    """The converters by what a controller there alone would give, computed anew with the setting of each."""
    largest = plan.request.gain_bounds[1]
    every = dict.fromkeys(plan.candidates, largest)
    with one_thread():
        alike = [RatedPoint(point.number, point.loops, plan.aim, every) for point in rated]
        alone = ranked(
            plan.candidates,
            _stages(plan),
            points=alike,
            largest=largest,
            frequency=frequency,
            most=plan.request.ranked,
            known=None if known is None else (known.place, known.setting),
        )
    computed = {} if known is None else {known.place: known.points}
    apart, quietly = _apart(alike), replace(work, report=nobody)
    confirmed = []
    for one in alone:
        if one.setting is not None:
            tell_doing(f"ranking, operating points with {one.place.name} alone")
        confirmed.append(_confirmed(plan, one, before, computed.get(one.place), apart, quietly))
    return best_first(confirmed)


def _confirmed(
    plan: PointsDesignPlan,
    one: RankedConverter,
    before: Sequence[PointModes],
    known: Sequence[PointModes] | None,
    apart: Mapping[int, Sequence[complex]],
    work: Work,
) -> RankedConverter:
    """A ranked converter with the least damping that its setting gives where all modes are computed anew."""
    if one.setting is None:
        return one
    name, controller = one.place.component, one.place.controller
    neutral = neutral_time(plan.prepared.system.components[name], controller)
    group = PodGroup(controller, (name,), (name,), one.stages, neutral)
    values = {**plan.off, **values_of([group], [one.setting])}
    made = {one.place: one.setting}
    points = known or with_followed_names(
        plan.aim.names, before, modes_at(plan, values, (), work), made
    )
    all_modes = Aim((), plan.aim.least)
    return replace(one, worst=least_of(points, plan.aim, apart), least=least_of(points, all_modes))


def _apart(points: Sequence[RatedPoint]) -> dict[int, tuple[complex, ...]]:
    """The modes that no loop moves, by number of the point."""
    return {point.number: point.apart for point in points if point.apart}


def _stages(plan: PointsDesignPlan) -> dict[PodPlace, int]:
    own = {place: group.stages for group in plan.groups for place in group.places}
    others = [place for place in plan.candidates if place not in own]
    return own | {place: _stages_at(plan, place) for place in others}


def _stages_at(plan: PointsDesignPlan, place: PodPlace) -> int:
    component = plan.prepared.system.components[place.component]
    time = neutral_time(component, place.controller)
    if time == GAIN_ALONE:
        return 0
    if time is None:
        return int(component.number(f"{place.controller}.N_S"))
    return count_stages(plan.prepared, place.component, place.controller)


def _frequency(points: Sequence[PointModes]) -> float:
    found = [point.values[point.swinging[0]].imag for point in points if point.swinging]
    if not found:
        raise AnalysisError(
            "no operating point has a mode from 0.1 to 2 Hz, so there is nothing to damp"
        )
    return float(np.mean(found))


def values_of(groups: Sequence[PodGroup], settings: Sequence[PodSetting]) -> dict[str, Value]:
    """The settings by ``component.variable``, with eight significant digits, as a parameter file has them.

    A controller without gain is switched off, and has no other value."""
    values: dict[str, Value] = {}
    for group, setting in zip(groups, settings, strict=True):
        if not setting.gain:
            values |= {f"{name}.{group.controller}.enabled": False for name in group.key}
            continue
        values |= setting.parameters(group.key, group.controller, group.stages, group.neutral)
    return values


def modes_at(
    plan: PointsDesignPlan, values: Mapping[str, Value], places: Sequence[PodPlace], work: Work
) -> list[PointModes]:
    """The modes of all operating points and outages with some values, from the power flow on."""
    study = StudyCase.of(
        plan.prepared, (*plan.request.layers, OptionValues.of(values)), plan.request.step_size
    )
    parts = [plan.read.items[k : k + TOGETHER] for k in range(0, len(plan.read.items), TOGETHER)]
    tasks = [PointsTask(study, part, tuple(places)) for part in parts]
    return [
        point
        for record in work.all(compute_points, tasks, list(map(len, parts)))
        for point in record.points
    ]
