"""The studies of a case, each as a method from its request."""

from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path
from typing import Any, Concatenate, cast

from orchestrator.cases.case import Case as CaseFile
from orchestrator.core.asked import path as path_of
from orchestrator.core.errors import InputError
from orchestrator.face.api.methods import Asks, Shown, method
from orchestrator.face.api.progress import shown_progress, shown_stages
from orchestrator.face.api.scenario import question
from orchestrator.output.results.lock import hold_folder
from orchestrator.studies.coordinated_design.command import STUDY as COORDINATED_DESIGN
from orchestrator.studies.coordinated_design.one_point import design_controller
from orchestrator.studies.interactions.command import STUDY as INTERACTIONS
from orchestrator.studies.pod_design.design import DesignRequest
from orchestrator.studies.pod_design.view import ControllerDesign
from orchestrator.studies.points.points import nobody
from orchestrator.studies.points.store import POINTS
from orchestrator.studies.points.study import PointStudy, Study, StudyAtOnce, choose_executor
from orchestrator.studies.screening.command import STUDY as SCREENING
from orchestrator.studies.siting.command import STUDY as SITING
from orchestrator.studies.sweep.command import STUDY as SWEEP


def _designed(file: CaseFile, request: DesignRequest) -> ControllerDesign:
    with shown_stages(shown=request.progress) as report:
        design = design_controller(file, request, report=report)
    question([design.result.prepared], above=2)
    return design


def of_study(name: str, study: Study[Asks, Shown]) -> Callable[Concatenate[Any, Asks], Shown]:
    """The method of a study."""
    return method(
        f"Case.{name}", study.request, lambda case, request: _computed(study, case.file, request)
    )


def _computed(study: Study[..., Shown], file: CaseFile, request: Any) -> Shown:
    """Plan a study and compute it; a folder that keeps its points is kept from other commands meanwhile."""
    if isinstance(study, StudyAtOnce):
        return cast("Shown", study.compute(file, request, nobody))
    assert isinstance(study, PointStudy)
    cluster = (getattr(request, "scheduler", None), getattr(request, "tls", None))
    executor = choose_executor(request.workers, cluster[0], study.imports, cluster[1])
    planned = study.plan(file, request)
    question(study.prepared(planned), above=2)
    kept = None if request.folder is None else _folder(request.folder)
    title = study.counted.capitalize()
    with (
        shown_progress(title, shown=request.progress) as report,
        nullcontext() if kept is None else hold_folder(kept),
    ):
        return cast("Shown", study.compute(planned, executor, kept, report))


def _folder(given: str | Path) -> Path:
    """The folder that keeps a study's points, made where missing."""
    place = path_of(given, "folder", "folder")
    try:
        (place / POINTS).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"folder = {str(place)!r}: points cannot be kept there: {error.strerror}; choose another"
        ) from error
    return place


sweep = of_study("sweep", SWEEP)
screen = of_study("screen", SCREENING)
site = of_study("site", SITING)
interactions = of_study("interactions", INTERACTIONS)
design = method("Case.design", DesignRequest, lambda case, request: _designed(case.file, request))
design_over_points = of_study("design_over_points", COORDINATED_DESIGN)
