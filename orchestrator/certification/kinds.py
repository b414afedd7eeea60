"""The two kinds of tests that codes have: NTS 631's points with a case of their own, and rows on the test bench."""

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import xarray as xr

from orchestrator.cases.schema import Value
from orchestrator.certification.acceptance import KEPT, Acceptance
from orchestrator.certification.certificate import Certificate
from orchestrator.certification.codes.all_codes import BY_DECLARATION, CODES, NTS631, code_for
from orchestrator.certification.codes.bench_point import BenchTask, compute_row
from orchestrator.certification.codes.certificate import certify_code
from orchestrator.certification.codes.rows_again import chosen_rows, compare_row, rebuilt_rows, row_faults, row_tasks
from orchestrator.certification.compared import Compared, Content, Verification
from orchestrator.certification.files import RESPONSES
from orchestrator.certification.form import NORM
from orchestrator.certification.point import CertificatePointTask, compute_point
from orchestrator.certification.points_again import (
    chosen_points,
    compare_point,
    point_faults,
    point_tasks,
    rebuilt_points,
)
from orchestrator.certification.request import REACTANCES, STUDY, CertificationRequest
from orchestrator.certification.study import certify
from orchestrator.errors import InputError
from orchestrator.fmi.devices import as_device
from orchestrator.points.executor import Executor
from orchestrator.points.points import CountReport, Work, nobody
from orchestrator.points.task import Task


@dataclass
class Parts:
    """How a kind of test is made, kept, judged again and computed anew."""

    one: str  # what a part is called; the record has a list of them
    task: type[Task]
    option: str  # with which `gfor verify` takes some of them
    rebuilt: Callable[[Path, dict[str, Any], xr.Dataset], Certificate]
    faults: Callable[[Path, dict[str, Any], xr.Dataset], Iterable[str]]  # what speaks against it beside the judgement
    choose: Callable[..., list[Any]]  # from content, wishes and ``every``: the parts that are computed anew
    # tasks of the chosen parts of a folder; a verification takes what speaks against one before
    tasks: Callable[[Path, Content, Sequence[Any], Verification], Sequence[Any]]
    compute: Callable[[Any], Any]
    compare: Callable[[Content, Any, Any, xr.Dataset], Compared]  # with content, task, what was computed, responses

    def chosen(self, folder: Path, content: Content, wanted: Sequence[Any], *, every: bool) -> list[Any]:
        """Line reactances, or names of rows; ``wanted``: those that were asked for."""
        named = any(isinstance(one, str) for one in wanted)
        if wanted and named != (self is ROWS):
            kind = "a grid code" if self is ROWS else "a damping test"
            given = "--rows" if named else "--points"
            raise InputError(
                f"{given}: {folder} is the certificate of {kind}, which has {self.one}s; give {self.option}"
            )
        return self.choose(content, wanted, every=every)

    def verify(
        self, folder: Path, content: Content, chosen: Sequence[Any], executor: Executor, report: CountReport = nobody
    ) -> Verification:
        found = Verification()
        tasks = self.tasks(folder, content, chosen, found)
        with xr.open_dataset(folder / RESPONSES, engine="scipy") as data:
            for index, again in Work(executor, report=report).each(self.compute, tasks):
                for fault, said in self.compare(content, tasks[index], again, data):
                    (found.faults if fault else found.agreed).append(fault or said)
        return found


POINTS = Parts("point", CertificatePointTask, "--points, with line reactances", rebuilt_points, point_faults,
               chosen_points, point_tasks, compute_point, compare_point)  # fmt: skip
ROWS = Parts("row", BenchTask, "--rows, with their names", rebuilt_rows, row_faults, chosen_rows, row_tasks,
             compute_row, compare_row)  # fmt: skip


def parts_of(content: Content) -> Parts:
    return POINTS if content["format"] == NORM else ROWS


def rebuilt(folder: Path, content: dict[str, Any], responses: xr.Dataset) -> Certificate:
    """The certificate anew from what its folder keeps, by the judgement that made it: from the FMU, the case file, the
    responses and, of a damping test, the eigenvalues."""
    certificate = parts_of(content).rebuilt(folder, content, responses)
    if content["acceptance"] is not None:
        report = json.loads((folder / KEPT).read_text(encoding="utf-8"))
        faults = tuple(dict.fromkeys(check["fault"] for check in report["checks"] if check["verdict"] == "fail"))
        certificate.acceptance = Acceptance(not faults, faults, {**report, "trusted": not faults})
    return certificate


WITH_VERDICT = (NTS631, *CODES, *BY_DECLARATION)  # codes that a converter passes or fails


@dataclass(frozen=True)
class Issue:
    request: CertificationRequest
    parts: Parts
    compute: Callable[[Executor, Path, CountReport], Certificate]


def issue_of(
    key: str, fmu: Path, binding: Path | None, values: Mapping[str, Value], *, declared: Mapping[str, object],
    pod: str | None = None, reactances: Sequence[float] = REACTANCES, black_box: bool = False,
) -> Issue:  # fmt: skip
    if key != NTS631:
        code, bench = code_for(key, declared), bench_request(fmu, binding, values)
        return Issue(
            bench, ROWS,
            lambda executor, folder, report: certify_code(bench, code, executor, folder, report=report),
        )  # fmt: skip
    if declared:
        raise InputError(f"--declare {next(iter(declared))}: the damping test takes no declared value; leave it out, "
                         f"or choose --code {', '.join(BY_DECLARATION)}")  # fmt: skip
    study = {name: value for name, value in values.items() if name.split(".")[0] in STUDY}
    own = {name: value for name, value in values.items() if name not in study}
    norm = CertificationRequest(as_device(fmu, binding), binding, own, pod, reactances, study, black_box)
    norm.check()
    return Issue(norm, POINTS,
                 lambda executor, folder, report: certify(norm, executor, folder, report))  # fmt: skip


def bench_request(fmu: Path, binding: Path | None, values: Mapping[str, Value]) -> CertificationRequest:
    request = CertificationRequest(as_device(fmu, binding), binding, values)
    request.check()
    return request
