"""Changes that a failed criterion would take: the row runs again with each parameter of the converter to either side.

Only rows that fail are run. What comes out is a slope at the present values; the change that a straight line asks for
is only told where it was run."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import TypeVar

from orchestrator.cases.case import load_case
from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.core.errors import InputError
from orchestrator.core.options import Option
from orchestrator.devices.fmi.description import VariableInfo
from orchestrator.studies.certification.certificate import Certificate
from orchestrator.studies.certification.codes import change_point
from orchestrator.studies.certification.codes.bench_point import DUPLICATE, PLANT, case_name
from orchestrator.studies.certification.codes.row_verdict import RowVerdict
from orchestrator.studies.certification.codes.sensitivity import MarginSensitivity, sensitivity_of
from orchestrator.studies.certification.request import GIVEN
from orchestrator.studies.points.executor import Executor
from orchestrator.studies.points.points import CountReport, Work, nobody
from orchestrator.studies.points.task import StudyCase
from orchestrator.studies.sensitivities.parameters import Parameter, parameters_in
from orchestrator.systems.coupling.step_awareness import INTERNAL_STEP, STEP_PARAMETER

# by which part of itself a parameter is changed to either side; of 1 of its unit where it is 0
CHANGE = 0.05


@dataclass(frozen=True)
class ConfirmedChange:
    parameter: Parameter
    change: float  # relative; of 1 unit where the parameter is 0
    straight_line: float
    margin: float | None
    met: bool | None
    failing: tuple[str, ...]
    reason: str = ""

    @property
    def value(self) -> float:
        return self.parameter.value + self.change * self.parameter.scale


@dataclass
class CriterionNeeds:
    row: str
    criterion: change_point.ChangedCriterion
    sensitivities: Sequence[MarginSensitivity]
    confirmed: ConfirmedChange | None = None


@dataclass(frozen=True)
class ChangePlan:
    certificate: Certificate
    folder: Path
    rows: Sequence[RowVerdict]
    parameters: Sequence[Parameter]
    left_out: Mapping[str, str]
    change: float
    tasks: Mapping[tuple[str, str, int], change_point.ChangeTask] = field(repr=False)

    @property
    def seconds(self) -> float:
        """Processor time of all tasks [s], as long as each takes what its row took."""
        return float(sum(self.certificate.results[row].seconds for row, *_ in self.tasks))


def plan_changes(
    certificate: Certificate,
    folder: Path,
    patterns: Sequence[str] = (),
    *,
    fixed: bool = False,
    change: float = CHANGE,
) -> ChangePlan:
    """Find what is to be run; nothing is run yet.

    ``patterns``: Names of the converter's parameters, also with ``*``; fixed ones that fit are taken too. Without
    patterns all tunable ones are taken."""
    rows = [v for v in certificate.verdicts if v.is_judged and not v.accepted]
    if not rows:
        return ChangePlan(
            certificate, folder, rows=(), parameters=(), left_out={}, change=change, tasks={}
        )
    plan = _prepared(folder, rows[0].row.name).system.components[PLANT]
    given = (*GIVEN, STEP_PARAMETER, INTERNAL_STEP)
    described = {PLANT: plan.description}

    # an FMU need not answer for all of its parameters: it is not asked
    def value_of(_: str, variable: str) -> float:
        return plan.number(variable)

    asked = parameters_in(
        described, value_of, [f"{PLANT}.{pattern}" for pattern in patterns], fixed=fixed
    )
    unknown = [p.variable for p in asked if plan.value(p.variable) is None]
    chosen = [p for p in asked if p.variable not in (*given, *unknown)]
    if not chosen:
        raise InputError(
            Option.SENSITIVITIES
            + f": {certificate.request.fmu} has no {'such' if patterns else 'tunable'} "
            "parameter that the rows do not give it themselves; name one by "
            + Option.PARAMETER
            + ", or take the fixed ones too by "
            + Option.FIXED
        )
    every = [info for info in plan.description.variables.values() if info.causality == "parameter"]
    names = {p.variable for p in chosen}
    left_out = {
        info.name: _why_not(info, unknown, bool(patterns))
        for info in every
        if info.name not in (*names, *given)
    }
    tasks = {
        (v.row.name, p.name, sign): _task(certificate, folder, v.row.name, p, sign * change)
        for v in rows
        for p in chosen
        for sign in (-1, 1)
        if p.allows(sign * change * p.scale)
    }
    return ChangePlan(
        certificate,
        folder,
        rows=rows,
        parameters=chosen,
        left_out=left_out,
        change=change,
        tasks=tasks,
    )


def _why_not(info: VariableInfo, unknown: Sequence[str], named: bool) -> str:
    if info.type != "Real":
        return f"of type {info.type}"
    if info.name in unknown:
        return "without a start value"
    return "not asked for" if named or info.variability == "tunable" else "fixed: --fixed takes it"


def run_changes(
    plan: ChangePlan, executor: Executor, report: CountReport = nobody
) -> list[CriterionNeeds]:
    results = _computed(plan, plan.tasks, executor, report)
    found = []
    for v in plan.rows:
        base = plan.certificate.results[v.row.name]
        mark = change_point.mark_of(base)
        for criterion in change_point.margins_with_time(v, base.findings, plan.certificate.f_n):
            if not criterion.accepted:
                rows = [
                    sensitivity_of(
                        p,
                        criterion,
                        mark,
                        {
                            s: results[k]
                            for s in (-1, 1)
                            if (k := (v.row.name, p.name, s)) in results
                        },
                        plan.change,
                    )
                    for p in plan.parameters
                ]
                rows.sort(key=lambda s: (-s.effect, s.parameter.name))
                found.append(CriterionNeeds(v.row.name, criterion, rows))
    return found


def confirm_changes(
    plan: ChangePlan,
    needs: Sequence[CriterionNeeds],
    executor: Executor,
    report: CountReport = nobody,
) -> None:
    """Run for each failed criterion the change of one parameter that the straight line asks for.

    Taken is the parameter whose line reaches the limit, or comes nearest to it, and of several the one that has to
    move least."""
    wanted: dict[int, tuple[MarginSensitivity, float]] = {}
    tasks: dict[int, change_point.ChangeTask] = {}
    for k, need in enumerate(needs):
        tried = [
            (s, change) for s in need.sensitivities if (change := s.change_to_meet()) is not None
        ]
        if tried:
            best = max(tried, key=lambda entry: (min(_expected(*entry), 0.0), -abs(entry[1])))
            wanted[k] = best
            tasks[k] = _task(plan.certificate, plan.folder, need.row, best[0].parameter, best[1])
    results = _computed(plan, tasks, executor, report)
    for k, (sensitivity, change) in wanted.items():
        needs[k].confirmed = _confirmed(needs[k], sensitivity, change, results[k])


def _expected(sensitivity: MarginSensitivity, change: float) -> float:
    return (sensitivity.margin or 0.0) + (sensitivity.slope or 0.0) * change


def _confirmed(
    need: CriterionNeeds,
    sensitivity: MarginSensitivity,
    change: float,
    result: change_point.ChangeResult,
) -> ConfirmedChange:
    again = next((c for c in result.criteria if c.criterion == need.criterion.criterion), None)
    reason = "" if again else "; ".join(c.text for c in result.criteria)
    reason = str(result.failure) if result.failure else reason
    failing = tuple(c.criterion for c in result.criteria if not c.accepted)
    return ConfirmedChange(
        sensitivity.parameter,
        change,
        straight_line=_expected(sensitivity, change),
        margin=again.margin if again else None,
        met=again.accepted if again else None,
        failing=failing,
        reason=reason,
    )


Place = TypeVar("Place")


def _computed(
    plan: ChangePlan,
    tasks: Mapping[Place, change_point.ChangeTask],
    executor: Executor,
    report: CountReport,
) -> dict[Place, change_point.ChangeResult]:
    work = Work.into(plan.folder, executor, report)
    return dict(
        zip(tasks, work.all(change_point.compute_change, list(tasks.values())), strict=True)
    )


def _task(
    certificate: Certificate, folder: Path, row: str, parameter: Parameter, change: float
) -> change_point.ChangeTask:
    prepared = _prepared(folder, row)
    value = parameter.value + change * parameter.scale
    places = [name for name in (PLANT, DUPLICATE) if name in prepared.system.components]
    changes = tuple((f"{name}.{parameter.variable}", value) for name in places)
    declared = tuple(sorted(certificate.code.declared.items()))
    code = certificate.code.key
    return change_point.ChangeTask(
        StudyCase.of(prepared), row, changes, code, certificate.f_n, declared
    )


@lru_cache(maxsize=32)
def _prepared_once(path: Path, mtime_ns: int) -> PreparedScenario:
    (prepared,) = load_case(path).prepare()
    return prepared


def _prepared(folder: Path, row: str) -> PreparedScenario:
    path = folder / case_name(row)
    return _prepared_once(path, path.stat().st_mtime_ns)
