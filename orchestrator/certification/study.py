"""The norm's study of one converter: a case file of its own, all points, and the verdict on each."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from orchestrator.binding.binding import bound_fmu
from orchestrator.cases.prepare import PreparedScenario
from orchestrator.cases.schema import Value
from orchestrator.certification.case_file import BASE, WITH, WITHOUT, write_case
from orchestrator.certification.certificate import Certificate, refusing
from orchestrator.certification.damping_controllers import DampingControllers, damping_controllers
from orchestrator.certification.judgement import PointVerdict, judge, watched
from orchestrator.certification.pod_effect import off_values, with_pod
from orchestrator.certification.point import CONVERTER, CertificatePointTask, PointResult, compute_point
from orchestrator.certification.request import REACTANCES, CertificationRequest, missing_reactances, rated_frequency
from orchestrator.certification.verdict import FAILS, INCOMPLETE, PASSES, incomplete_because
from orchestrator.errors import InputError
from orchestrator.points.executor import Executor
from orchestrator.points.points import CountReport, Work, nobody
from orchestrator.points.task import StudyCase

NORM_HZ = 50.0


@dataclass
class Certification(Certificate[PointVerdict]):
    controllers: DampingControllers
    event_time: float
    case: Path
    # every value of the system with the converter at the first reactance, by ``component.variable``.
    values: Mapping[str, float | bool]
    points: Mapping[tuple[str, float], PointResult]

    @property
    def pod(self) -> str:
        return self.controllers.pod

    @property
    def linearised(self) -> dict[str, str]:
        having = [point for (name, _), point in self.points.items() if name == WITH]
        return {component: how for point in having for component, how in point.linearised.items()}

    @property
    def fit_errors(self) -> dict[str, float]:
        found: dict[str, float] = {}
        for point in self.points.values():
            for component, error in point.fit_errors.items():
                found[component] = max(error, found.get(component, 0.0))
        return found

    @property
    def signal(self) -> str:
        return watched(self.pod)

    @property
    def missing(self) -> tuple[float, ...]:
        """Reactances of the norm that were not judged [pu]."""
        return missing_reactances(v.X_L for v in self.verdicts if v.judged)

    def result(self) -> str:
        subject = f"The converter {self.description.model_name!r} {self.controllers.in_words()}"
        return {PASSES: self._passes, FAILS: self._fails, INCOMPLETE: self._incomplete}[self.verdict](subject)

    def _passes(self, subject: str) -> str:
        return f"{subject} passes the damping test at all {len(REACTANCES)} line reactances, by both criteria."

    def _fails(self, subject: str) -> str:
        failed = [v for v in self.verdicts if v.judged and not v.accepted]
        places, first = ", ".join(f"{v.X_L:g}" for v in failed), failed[0]
        text = f"{subject} fails the damping test at X_L = {places} pu. At {first.X_L:g} pu: {'; '.join(first.faults)}."
        reasons = incomplete_because(self.missing, self.departures)
        return f"{text} The test is incomplete as well: {reasons}." if reasons else text

    def _incomplete(self, subject: str) -> str:
        reasons = incomplete_because(self.missing, self.departures)
        text = f"The damping test is incomplete: {reasons}. {subject} is accepted where it was judged"
        unknown = [v for v in self.verdicts if not v.judged]
        if not any(v.judged for v in self.verdicts):
            text = f"The damping test is incomplete: {reasons}. {subject} was judged nowhere"
        return f"{text}; at {unknown[0].X_L:g} pu, {unknown[0].unknown}." if unknown else f"{text}."


def certify(
    request: CertificationRequest, executor: Executor, folder: Path, report: CountReport = nobody
) -> Certification:
    request.check()
    description = bound_fmu(request.fmu, request.binding)
    controllers = damping_controllers(description, request)
    first = {"grid.X_L": request.reactances[0]}

    def laid(place: Path) -> dict[str, PreparedScenario]:
        case = write_case(request, controllers.settings, place)
        return {name: case.prepare([name], first)[0] for name in (WITHOUT, WITH)}

    if (own := rated_frequency(request, NORM_HZ)) != NORM_HZ:
        from orchestrator.certification.codes.all_codes import CODES  # noqa: PLC0415 - only for this error

        others = ", ".join(f"--code {key}" for key, code in CODES.items() if code.f_n == own) or "none"
        raise InputError(
            f"{request.fmu}: it is rated at {own:g} Hz, and NTS 631 is a code of {NORM_HZ:g} Hz; of {own:g} Hz are "
            f"{others}; f_n of the FMU and rating.f_n of a binding say what it is"
        )
    with refusing(request, folder, "in the study's case that `gfor certify` makes from the request") as trial:
        laid(trial)
    prepared = laid(folder)
    tasks = tasks_of(prepared, request, controllers)
    work = Work.into(folder, executor, report)
    found = work.all(compute_point, tasks)
    points = {(task.scenario, task.X_L): point for task, point in zip(tasks, found, strict=True)}
    event, having = prepared[WITH].events[0].time, prepared[WITH]
    verdicts = [judge(points[WITH, X], points[WITHOUT, X], controllers.pod, event) for X in request.reactances]
    verdicts = with_pod(verdicts, {X: points[WITH, X] for X in request.reactances}, controllers, event)
    description = having.system.components[CONVERTER].description
    return Certification(
        request, description, verdicts, controllers, event, having.case.path, having.values, points, stored=work.stored
    )


def tasks_of(
    prepared: Mapping[str, PreparedScenario], request: CertificationRequest, controllers: DampingControllers
) -> list[CertificatePointTask]:
    """Both scenarios at all reactances, the one without the converter first."""
    own = {f"{CONVERTER}.{name}": value for name, value in {**request.values, **controllers.settings}.items()}
    settings: dict[str, dict[str, Value]] = {WITHOUT: dict(request.study_values), WITH: {**request.study_values, **own}}
    without = _tasks(prepared[WITHOUT], settings[WITHOUT], request.reactances, black_box=False)
    off = off_values(controllers.pod) if controllers.can_be_off else ()
    having = _tasks(prepared[WITH], settings[WITH], request.reactances, black_box=request.black_box, off=off)
    return [task for pair in zip(without, having, strict=True) for task in pair]


def _tasks(
    prepared: PreparedScenario,
    values: dict[str, Value],
    reactances: Sequence[float],
    *,
    black_box: bool,
    off: tuple[tuple[str, Value], ...] = (),
) -> list[CertificatePointTask]:
    # The case file names the binding, if there is one. The binding's effect is part of the scenario's content.
    study = StudyCase.of(prepared, text=BASE.read_text(encoding="utf-8"), overrides=sorted(values.items()))
    return [CertificatePointTask(study, X_L, black_box, off) for X_L in reactances]
