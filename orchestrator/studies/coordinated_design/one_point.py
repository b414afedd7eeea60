"""The search over settings for a design at one operating point, whose system runs already."""

from functools import partial

from orchestrator.cases.case import Case
from orchestrator.cases.form.definition import CaseDefinition
from orchestrator.core.threads import one_thread
from orchestrator.studies.coordinated_design.objective import Aim, RatedPoint
from orchestrator.studies.coordinated_design.point import measure
from orchestrator.studies.coordinated_design.search import SettingSearch
from orchestrator.studies.coordinated_design.settings import PodGroup, SettingSpace
from orchestrator.studies.coordinated_design.study import naming_of
from orchestrator.studies.pod_design.closed_loop import PodLoop, PodSetting
from orchestrator.studies.pod_design.design import DesignRequest, StageReport, design_pod
from orchestrator.studies.pod_design.target import Target
from orchestrator.studies.pod_design.view import ControllerDesign
from orchestrator.studies.points.store import PointStore


def search_settings(
    case: CaseDefinition,
    request: DesignRequest,
    target: Target,
    mode: str,
    loop: PodLoop,
    frequency: float,
) -> list[tuple[str, PodSetting]]:
    """The best settings for one mode and, where none was named, for all modes from 0.1 to 2 Hz.

    The search is that of a design over operating points, and finds the same.

    ``frequency``: the mode's [rad/s], to which the centres of the lead/lag relate."""
    group = PodGroup(request.controller, target.components, target.key, target.stages)
    loops = measure(*loop.opened(), group.places)
    bounds = request.bounds(search=True)
    space, largest = (
        SettingSpace([group], bounds, frequency),
        dict.fromkeys(group.places, bounds[1]),
    )
    aims = {f"searched for {mode}": Aim((mode,), request.least_damping, partial(naming_of, case))}
    if request.mode is None:
        aims["searched for all modes"] = Aim((), request.least_damping)
    found = []
    for why, aim in aims.items():
        with one_thread():
            search = SettingSearch(space, [RatedPoint(0, loops, aim, largest)])
            best, _ = search.over_grid(search.best())
        found.append((why, space.group_settings(best.x)[0]))
    return found


def design_controller(
    case: Case,
    request: DesignRequest,
    report: StageReport = lambda text: None,
    store: PointStore | None = None,
) -> ControllerDesign:
    """A design for one operating point; ``store`` keeps figures on the way."""
    return ControllerDesign(design_pod(case, request, report, store, search_settings))
