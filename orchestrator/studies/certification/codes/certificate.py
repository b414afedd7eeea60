"""A converter on the test bench: all rows of a code, and their certificate."""

from collections.abc import Sequence
from pathlib import Path

from orchestrator.cases.case import load_case
from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.devices.binding.binding import bound_fmu
from orchestrator.studies.certification.case_file import lay_files
from orchestrator.studies.certification.certificate import Certificate, refusing
from orchestrator.studies.certification.codes.bench_point import BenchTask, compute_row, write_row
from orchestrator.studies.certification.codes.row import CodeRow, GridCode
from orchestrator.studies.certification.codes.row_verdict import judge_row, try_criteria
from orchestrator.studies.certification.request import (
    CertificationRequest,
    rated_frequency,
    refuse_phasors,
    refuse_what_follows_at_once,
)
from orchestrator.studies.points.executor import Executor
from orchestrator.studies.points.points import CountReport, Work, nobody
from orchestrator.studies.points.task import StudyCase


def certify_code(
    request: CertificationRequest,
    code: GridCode[CodeRow],
    executor: Executor,
    folder: Path,
    rows: Sequence[str] = (),
    report: CountReport = nobody,
) -> Certificate:
    """Run a code's rows with the converter on the test bench, and judge each of them.

    ``rows``: names of the only rows that run; all where empty.

    Raises an `InputError` if a criterion cannot judge its row, before anything runs."""
    request.check()
    refuse_phasors(request)
    f_n = rated_frequency(request, code.f_n)
    try_criteria(code, f_n)
    chosen = [row for row in code.rows if not rows or row.name in rows]
    with refusing(request, folder, "on the test bench of `gfor certify --code`") as trial:
        _prepare_rows(request, chosen[:1], f_n, trial)
    refuse_what_follows_at_once(request)
    report(0, len(chosen))
    prepared = _prepare_rows(request, chosen, f_n, folder)
    tasks = [
        BenchTask(StudyCase.of(one), row.name) for one, row in zip(prepared, chosen, strict=True)
    ]
    work = Work.into(folder, executor, report)
    found = work.all(compute_row, tasks)
    results = {row.name: result for row, result in zip(chosen, found, strict=True)}
    verdicts = [judge_row(row, results[row.name], f_n) for row in chosen]
    return Certificate(
        request,
        bound_fmu(request.fmu, request.binding),
        code=code,
        f_n=f_n,
        verdicts=verdicts,
        results=results,
        case=prepared[0].case.path,
        values=prepared[0].values,
        stored=work.stored,
    )


def _prepare_rows(
    request: CertificationRequest, rows: Sequence[CodeRow], f_n: float, folder: Path
) -> list[PreparedScenario]:
    """Write a case file for each row, with what it needs beside it, and prepare its scenario."""
    lay_files(request, folder)
    written = [
        write_row(request, row.name, row.title, row.programme(f_n), f_n, folder) for row in rows
    ]
    return [load_case(path).prepare()[0] for path in written]
