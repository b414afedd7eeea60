"""The norm's study of one converter: a case file of its own, all points, and the verdict on each."""

from collections.abc import Mapping
from pathlib import Path

from orchestrator.cases.form.schema import Value
from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.core.errors import InputError
from orchestrator.core.options import Option
from orchestrator.devices.binding.binding import bound_fmu
from orchestrator.studies.certification.case_file import BASE, WITH, WITHOUT, write_case
from orchestrator.studies.certification.certificate import Certificate, DampingCertificate, refusing
from orchestrator.studies.certification.codes.known import tables
from orchestrator.studies.certification.codes.nts631 import NTS
from orchestrator.studies.certification.damping_controllers import (
    DampingControllers,
    damping_controllers,
)
from orchestrator.studies.certification.judgement import judge
from orchestrator.studies.certification.pod_effect import off_values, with_pod
from orchestrator.studies.certification.point import CONVERTER, CertificatePointTask, compute_point
from orchestrator.studies.certification.request import (
    CertificationRequest,
    rated_frequency,
    refuse_phasors,
    refuse_what_follows_at_once,
)
from orchestrator.studies.points.executor import Executor
from orchestrator.studies.points.points import CountReport, Work, nobody
from orchestrator.studies.points.task import StudyCase
from orchestrator.studies.points.under_way import tell_doing


def certify(
    request: CertificationRequest, executor: Executor, folder: Path, report: CountReport = nobody
) -> Certificate:
    request.check()
    refuse_phasors(request)
    description = bound_fmu(request.fmu, request.binding)
    controllers = damping_controllers(description, request)
    first = {"grid.X_L": request.reactances[0]}

    def laid(place: Path, before: int) -> dict[str, PreparedScenario]:
        case = write_case(request, controllers.settings, place)
        found: dict[str, PreparedScenario] = {}
        for k, name in enumerate((WITHOUT, WITH), start=before + 1):
            tell_doing(f"scenario {name} of the code's case, {k} of 4; the first use builds models")
            found[name] = case.prepare([name], first)[0]
        tell_doing()
        return found

    own = rated_frequency(request, NTS.f_n)
    if own != NTS.f_n:
        others = (
            ", ".join(
                (Option.CODE + f" {key}") for key, code in tables().items() if code.f_n == own
            )
            or "none"
        )
        raise InputError(
            f"{request.fmu}: it is rated at {own:g} Hz, and NTS 631 is a code of {NTS.f_n:g} Hz; of {own:g} Hz are "
            f"{others}; f_n of the FMU and rating.f_n of a binding say what it is"
        )
    with refusing(
        request, folder, "in the study's case that `gfor certify` makes from the request"
    ) as trial:
        laid(trial, before=0)
    refuse_what_follows_at_once(request)
    prepared = laid(folder, before=2)
    tasks = tasks_of(prepared, request, controllers)
    work = Work.into(folder, executor, report)
    found = work.all(compute_point, tasks)
    points = {(task.scenario, task.X_L): point for task, point in zip(tasks, found, strict=True)}
    event, having = prepared[WITH].events[0].time, prepared[WITH]
    verdicts = [
        judge(points[WITH, X], points[WITHOUT, X], controllers.pod, event)
        for X in request.reactances
    ]
    verdicts = with_pod(verdicts, points, controllers, event)
    description = having.system.components[CONVERTER].description
    return DampingCertificate(
        request,
        description,
        code=NTS,
        f_n=NTS.f_n,
        verdicts=verdicts,
        results=points,
        case=having.case.path,
        values=having.values,
        controllers=controllers,
        event_time=event,
        stored=work.stored,
    )


def tasks_of(
    prepared: Mapping[str, PreparedScenario],
    request: CertificationRequest,
    controllers: DampingControllers,
) -> list[CertificatePointTask]:
    own = {
        f"{CONVERTER}.{name}": value
        for name, value in {**request.values, **controllers.settings}.items()
    }
    settings: dict[str, dict[str, Value]] = {
        WITHOUT: dict(request.study_values),
        WITH: {**request.study_values, **own},
    }
    # The case file names the binding, if there is one. The binding's effect is part of the scenario's content.
    text = BASE.read_text(encoding="utf-8")
    study = {
        k: StudyCase.of(prepared[k], text=text, overrides=sorted(v.items()))
        for k, v in settings.items()
    }
    off = off_values(controllers.pod) if controllers.can_be_off else ()
    return [
        task
        for X_L in request.reactances
        for task in (
            CertificatePointTask(study[WITHOUT], X_L),
            CertificatePointTask(study[WITH], X_L, request.black_box, off),
        )
    ]
