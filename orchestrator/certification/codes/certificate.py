"""A converter on the test bench: all rows of a code, and the verdict."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory

from orchestrator.binding.binding import bound_fmu
from orchestrator.cases.case import load_case
from orchestrator.cases.schema import Value
from orchestrator.certification.acceptance import Acceptance
from orchestrator.certification.codes.bench_case import lay_files, rated_frequency, write_row
from orchestrator.certification.codes.bench_point import BenchResult, BenchTask, compute_row
from orchestrator.certification.codes.row import CodeRow, GridCode
from orchestrator.certification.codes.row_verdict import RowVerdict, judge_row
from orchestrator.certification.details import Details
from orchestrator.certification.refusal import refused
from orchestrator.certification.request import GIVEN, CertificationRequest, shown
from orchestrator.certification.verdict import FAILS, INCOMPLETE, PASSES
from orchestrator.errors import CaseError
from orchestrator.fmi.description import FmuDescription
from orchestrator.points.executor import Executor
from orchestrator.points.key import fingerprint, key_of, reference_to, scenario_content
from orchestrator.points.points import CountReport, kept_or_computed
from orchestrator.points.store import POINTS, PointStore


@dataclass
class CodeCertificate:
    """A code's rows for one converter.

    Attributes
    ----------
    f_n
        Rated frequency of the bench [Hz].
    verdicts
        In the order of the rows.
    chosen
        Names of the rows that were asked for; all of them where it is a whole certificate.
    stored
        Number of rows that were there already.
    """

    request: CertificationRequest
    code: GridCode
    description: FmuDescription
    f_n: float
    results: Mapping[str, BenchResult]
    verdicts: Sequence[RowVerdict]
    stored: int = 0
    details: Details = field(default_factory=Details)
    acceptance: Acceptance | None = None

    @property
    def departures(self) -> tuple[str, ...]:
        return departures_of(self.request.values, self.f_n, self.code)

    @property
    def missing(self) -> tuple[str, ...]:
        """What keeps a test that nothing fails from being passed."""
        return missing_of(self.code, self.verdicts, self.departures)

    @property
    def verdict(self) -> str:
        """In one word: ``passes``, ``fails`` or ``incomplete``."""
        return verdict_of([bool(v.accepted) for v in self.verdicts if v.judged], len(self.missing))

    @property
    def refused(self) -> bool:
        """Whether an acceptance test failed."""
        return self.acceptance is not None and not self.acceptance.trusted

    def sentence(self) -> str:
        return sentence_of(self.code, self.description.model_name, self.verdicts, self.missing, self.acceptance)


def missing_of(code: GridCode, verdicts: Sequence[RowVerdict], departures: Sequence[str]) -> tuple[str, ...]:
    """What keeps a test that nothing fails from being passed.

    Parameters
    ----------
    departures
        From `departures_of`.
    """
    done = {v.row.name for v in verdicts if v.judged}
    rows = tuple(f"row {r.name}" for r in code.rows if r.name not in done and not r.shown_only)
    return (*rows, *code.left_out, *departures)


def sentence_of(
    code: GridCode,
    model: str,
    verdicts: Sequence[RowVerdict],
    missing: Sequence[str],
    acceptance: Acceptance | None,
) -> str:
    """The result as a sentence.

    Parameters
    ----------
    model
        Name of the converter's model.
    missing
        From `missing_of`.
    """
    judged = [v for v in verdicts if v.judged]
    bad = [v for v in judged if not v.accepted]
    verdict = verdict_of([bool(v.accepted) for v in judged], len(missing))
    subject = f"The converter {model!r}"
    rows = f"{len(judged) - len(bad)} of {len(judged)} judged rows are accepted."
    if bad:
        names = "; ".join(f"{v.row.name}: {', '.join(f.criterion for f in v.failed)}" for v in bad)
        said = f"{subject} {FAILS} {code.title}: {rows} Not accepted: {names}."
    elif verdict == INCOMPLETE:
        said = f"The test is {INCOMPLETE}: {len(missing)} parts of {code.title} were not tested. "
        said += f"{subject}: {rows}"
    else:
        said = f"{subject} {PASSES} {code.title}: {rows}"
    if acceptance is not None and not acceptance.trusted:
        said += f" Acceptance tests failed: {', '.join(acceptance.faults)}; do not rely on the FMU as it is."
    return said


def departures_of(values: Mapping[str, Value], f_n: float, code: GridCode) -> tuple[str, ...]:
    """By what a test departs from a code's.

    Parameters
    ----------
    f_n
        Rated frequency of the bench [Hz].
    """
    set_too = tuple(f"converter.{name} = {shown(values[name])}" for name in GIVEN if name in values)
    if f_n != code.f_n:
        set_too += (f"the rated frequency, {f_n:g} Hz in place of {code.f_n:g} Hz",)
    return set_too


def verdict_of(accepted: Sequence[bool], missing: int) -> str:
    """The verdict from the judged rows and the number of parts that are missing."""
    if not all(accepted):
        return FAILS
    return INCOMPLETE if missing or not accepted else PASSES


def certify_code(
    request: CertificationRequest,
    code: GridCode,
    executor: Executor,
    folder: Path,
    rows: Sequence[str] = (),
    report: CountReport = lambda done, total: None,
) -> CodeCertificate:
    """Run a code's rows and judge them."""
    request.check()
    f_n = rated_frequency(request, code.f_n)
    chosen = [row for row in code.rows if not rows or row.name in rows]
    with TemporaryDirectory(dir=folder, prefix=".request_") as trial:
        try:  # a request that is refused leaves existing files as they are
            _tasks(request, chosen[:1], f_n, Path(trial))
        except CaseError as error:
            raise refused(request, error, trial, "on the test bench of `gfor certify --code`") from error
    report(0, len(chosen))
    tasks = _tasks(request, chosen, f_n, folder)
    results: dict[str, BenchResult] = {}
    stored, store = 0, PointStore(folder / POINTS)
    for index, result, was_stored in kept_or_computed(BenchResult, compute_row, tasks, executor, store, report):
        results[tasks[index].row] = result
        stored += was_stored
    verdicts = [judge_row(row, results[row.name], f_n) for row in chosen]
    description = bound_fmu(request.fmu, request.binding)
    return CodeCertificate(request, code, description, f_n, results, verdicts, stored)


def _tasks(request: CertificationRequest, rows: Sequence[CodeRow], f_n: float, folder: Path) -> list[BenchTask]:
    lay_files(request, folder)
    tasks = []
    for row in rows:
        path = write_row(request, row.name, row.title, row.programme(f_n), f_n, folder)
        case = load_case(path)
        (prepared,) = case.prepare()
        content = {"bench": row.name, "text": case.text, **scenario_content(prepared)}
        tasks.append(BenchTask(row.name, reference_to(case), fingerprint(case), key_of(content)))
    return tasks
