"""A converter on the test bench: all rows of a code, and the verdict."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from orchestrator.binding.binding import bound_fmu
from orchestrator.cases.case import load_case
from orchestrator.certification.case_file import lay_files
from orchestrator.certification.certificate import Certificate, refusing
from orchestrator.certification.codes.bench_point import BenchResult, BenchTask, compute_row, write_row
from orchestrator.certification.codes.row import CodeRow, GridCode
from orchestrator.certification.codes.row_verdict import RowVerdict, judge_row
from orchestrator.certification.request import CertificationRequest, rated_frequency
from orchestrator.certification.verdict import FAILS, INCOMPLETE, PASSES
from orchestrator.points.executor import Executor
from orchestrator.points.points import CountReport, Work, nobody
from orchestrator.points.task import StudyCase


@dataclass
class CodeCertificate(Certificate[RowVerdict]):
    code: GridCode
    f_n: float
    results: Mapping[str, BenchResult]

    @property
    def departures(self) -> tuple[str, ...]:
        if self.f_n == self.code.f_n:
            return super().departures
        return (*super().departures, f"the rated frequency, {self.f_n:g} Hz in place of {self.code.f_n:g} Hz")

    @property
    def missing(self) -> tuple[str, ...]:
        """Why a test that nothing fails is not passed, its departures included."""
        done = {v.row.name for v in self.verdicts if v.judged}
        rows = tuple(f"row {r.name}" for r in self.code.rows if r.name not in done and not r.shown_only)
        return (*rows, *self.code.left_out, *self.departures)

    def result(self) -> str:
        judged = [v for v in self.verdicts if v.judged]
        bad = [v for v in judged if not v.accepted]
        subject, title = f"The converter {self.description.model_name!r}", self.code.title
        rows = f"{len(judged) - len(bad)} of {len(judged)} judged rows are accepted."
        if bad:
            names = "; ".join(f"{v.row.name}: {', '.join(f.criterion for f in v.failed)}" for v in bad)
            return f"{subject} {FAILS} {title}: {rows} Not accepted: {names}."
        if self.verdict == INCOMPLETE:
            untested = f"{len(self.missing)} parts of {title} were not tested."
            return f"The test is {INCOMPLETE}: {untested} {subject}: {rows}"
        return f"{subject} {PASSES} {title}: {rows}"


def certify_code(
    request: CertificationRequest, code: GridCode, executor: Executor, folder: Path, rows: Sequence[str] = (),
    report: CountReport = nobody,
) -> CodeCertificate:  # fmt: skip
    request.check()
    f_n = rated_frequency(request, code.f_n)
    chosen = [row for row in code.rows if not rows or row.name in rows]
    with refusing(request, folder, "on the test bench of `gfor certify --code`") as trial:
        _tasks(request, chosen[:1], f_n, trial)
    report(0, len(chosen))
    tasks = _tasks(request, chosen, f_n, folder)
    work = Work.into(folder, executor, report)
    found = work.all(compute_row, tasks)
    results = {row.name: result for row, result in zip(chosen, found, strict=True)}
    verdicts = [judge_row(row, results[row.name], f_n) for row in chosen]
    description = bound_fmu(request.fmu, request.binding)
    return CodeCertificate(request, description, verdicts, code, f_n, results, stored=work.stored)


def _tasks(request: CertificationRequest, rows: Sequence[CodeRow], f_n: float, folder: Path) -> list[BenchTask]:
    lay_files(request, folder)
    tasks = []
    for row in rows:
        path = write_row(request, row.name, row.title, row.programme(f_n), f_n, folder)
        (prepared,) = load_case(path).prepare()
        tasks.append(BenchTask(StudyCase.of(prepared), row.name))
    return tasks
