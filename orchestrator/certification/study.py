"""The norm's study of one converter: a case file of its own, all points, and the verdict on each."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory

from orchestrator.binding.binding import bound_fmu
from orchestrator.cases.prepare import PreparedScenario
from orchestrator.cases.schema import Value
from orchestrator.certification.acceptance import Acceptance
from orchestrator.certification.case_file import BASE, WITH, WITHOUT, write_case
from orchestrator.certification.damping_controllers import DampingControllers, damping_controllers
from orchestrator.certification.details import Details
from orchestrator.certification.judgement import PointVerdict, judge, watched
from orchestrator.certification.point import CONVERTER, CertificatePointTask, PointResult, compute_point
from orchestrator.certification.refusal import refused
from orchestrator.certification.request import REACTANCES, CertificationRequest, missing_reactances
from orchestrator.certification.verdict import FAILS, INCOMPLETE, PASSES, incomplete_because
from orchestrator.errors import CaseError
from orchestrator.fmi.description import FmuDescription
from orchestrator.points.executor import Executor
from orchestrator.points.key import fingerprint, key_of, reference_to, scenario_content
from orchestrator.points.points import CountReport, kept_or_computed
from orchestrator.points.store import POINTS, PointStore


@dataclass
class Certification:
    """The results of the study.

    Attributes
    ----------
    values
        Every value of the system with the converter at the first reactance, by ``component.variable``.
    points
        By scenario and X_L.
    stored
        Number of points that were stored by an earlier start.
    details
        Details of the test, such as client and laboratory.
    acceptance
        The result of the FMU's acceptance tests; None if they were not run.
    """

    request: CertificationRequest
    description: FmuDescription
    controllers: DampingControllers
    event_time: float
    case: Path
    values: Mapping[str, float | bool]
    points: dict[tuple[str, float], PointResult]
    verdicts: list[PointVerdict]
    stored: int = 0
    details: Details = field(default_factory=Details)
    acceptance: Acceptance | None = None

    @property
    def pod(self) -> str:
        """Active damping controllers, as one of `PODS`."""
        return self.controllers.pod

    @property
    def linearised(self) -> dict[str, str]:
        """How the linear model of every component was found at the points with the converter."""
        having = [point for (name, _), point in self.points.items() if name == WITH]
        return {component: how for point in having for component, how in point.linearised.items()}

    @property
    def fit_errors(self) -> dict[str, float]:
        """Largest fit error over all points, for each identified component."""
        found: dict[str, float] = {}
        for point in self.points.values():
            for component, error in point.fit_errors.items():
                found[component] = max(error, found.get(component, 0.0))
        return found

    @property
    def signal(self) -> str:
        """The signal that the time-domain criterion judges."""
        return watched(self.pod)

    @property
    def missing(self) -> tuple[float, ...]:
        """Reactances of the norm that were not judged [pu]."""
        return missing_reactances(v.X_L for v in self.verdicts if v.judged)

    @property
    def verdict(self) -> str:
        """In one word: ``passes``, ``fails`` or ``incomplete``."""
        if any(v.judged and not v.accepted for v in self.verdicts):
            return FAILS
        return INCOMPLETE if self.missing or self.request.departures else PASSES

    @property
    def passed(self) -> bool:
        return self.verdict == PASSES

    @property
    def refused(self) -> bool:
        """Whether an acceptance test failed."""
        return self.acceptance is not None and not self.acceptance.trusted

    def sentence(self) -> str:
        """The result as a sentence, with the reactances concerned."""
        subject = f"The converter {self.description.model_name!r} {self.controllers.in_words()}"
        said = {PASSES: self._passes, FAILS: self._fails, INCOMPLETE: self._incomplete}[self.verdict](subject)
        if self.acceptance is not None and self.refused:
            said += f" Acceptance tests failed: {', '.join(self.acceptance.faults)}; do not rely on the FMU as it is."
        return said

    def _passes(self, subject: str) -> str:
        return f"{subject} passes the damping test at all {len(REACTANCES)} line reactances, by both criteria."

    def _fails(self, subject: str) -> str:
        failed = [v for v in self.verdicts if v.judged and not v.accepted]
        places, first = ", ".join(f"{v.X_L:g}" for v in failed), failed[0]
        text = f"{subject} fails the damping test at X_L = {places} pu. At {first.X_L:g} pu: {'; '.join(first.faults)}."
        reasons = incomplete_because(self.missing, self.request.departures)
        return f"{text} The test is incomplete as well: {reasons}." if reasons else text

    def _incomplete(self, subject: str) -> str:
        reasons = incomplete_because(self.missing, self.request.departures)
        text = f"The damping test is incomplete: {reasons}. {subject} is accepted where it was judged"
        unknown = [v for v in self.verdicts if not v.judged]
        if not any(v.judged for v in self.verdicts):
            text = f"The damping test is incomplete: {reasons}. {subject} was judged nowhere"
        return f"{text}; at {unknown[0].X_L:g} pu, {unknown[0].unknown}." if unknown else f"{text}."


def certify(
    request: CertificationRequest,
    executor: Executor,
    folder: Path,
    report: CountReport = lambda done, total: None,
) -> Certification:
    """Compute all points and judge them."""
    request.check()
    controllers = damping_controllers(bound_fmu(request.fmu, request.binding), request)
    prepared = _laid_case(request, controllers, folder)
    description = prepared[WITH].system.components[CONVERTER].description
    tasks = tasks_of(prepared, request, controllers)
    points: dict[tuple[str, float], PointResult] = {}
    stored = 0
    store = PointStore(folder / POINTS)
    for index, point, was_stored in kept_or_computed(PointResult, compute_point, tasks, executor, store, report):
        points[tasks[index].scenario, tasks[index].X_L] = point
        stored += was_stored
    event = prepared[WITH].events[0].time
    verdicts = [judge(points[WITH, X], points[WITHOUT, X], controllers.pod, event) for X in request.reactances]
    values = prepared[WITH].values
    return Certification(
        request, description, controllers, event, prepared[WITH].case.path, values, points, verdicts, stored
    )


def _laid_case(
    request: CertificationRequest, controllers: DampingControllers, folder: Path
) -> dict[str, PreparedScenario]:
    """Write the study's case into the folder, and prepare its two scenarios.

    If the request is refused, existing files are kept.
    """
    first = {"grid.X_L": request.reactances[0]}

    def prepared(place: Path) -> dict[str, PreparedScenario]:
        case = write_case(request, controllers.settings, place)
        return {name: case.prepare([name], first)[0] for name in (WITHOUT, WITH)}

    folder.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory(dir=folder, prefix=".request_") as trial:
        try:
            prepared(Path(trial))
        except CaseError as error:
            raise refused(
                request, error, trial, "in the study's case that `gfor certify` makes from the request"
            ) from error
    return prepared(folder)


def tasks_of(
    prepared: Mapping[str, PreparedScenario],
    request: CertificationRequest,
    controllers: DampingControllers,
) -> list[CertificatePointTask]:
    """Both scenarios at all reactances, the one without the converter first."""
    own = {f"{CONVERTER}.{name}": value for name, value in {**request.values, **controllers.settings}.items()}
    settings: dict[str, dict[str, Value]] = {
        WITHOUT: dict(request.study_values),
        WITH: {**request.study_values, **own},
    }
    without = _tasks(prepared[WITHOUT], settings[WITHOUT], request.reactances, black_box=False)
    having = _tasks(prepared[WITH], settings[WITH], request.reactances, black_box=request.black_box)
    return [task for pair in zip(without, having, strict=True) for task in pair]


def _tasks(
    prepared: PreparedScenario, values: dict[str, Value], reactances: Sequence[float], *, black_box: bool
) -> list[CertificatePointTask]:
    # The case file names the binding, if there is one. The binding's effect is part of the scenario's content.
    content = {
        "case": BASE.read_text(encoding="utf-8"),
        **scenario_content(prepared),
        "overrides": sorted(values.items()),
        "black box": black_box,
    }
    place, mark = reference_to(prepared.case), fingerprint(prepared.case)
    return [
        CertificatePointTask(place, mark, prepared.name, X_L, key_of({**content, "X_L": X_L}), black_box)
        for X_L in reactances
    ]
