"""How a certificate is computed under each code: what is asked of the converter, and which rows."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from orchestrator.cases.schema import Value
from orchestrator.certification.certificate import Certificate, Judged
from orchestrator.certification.codes.all_codes import BY_DECLARATION, CODES, code_for
from orchestrator.certification.codes.bench_point import BenchTask
from orchestrator.certification.codes.certificate import certify_code
from orchestrator.certification.point import CertificatePointTask
from orchestrator.certification.request import REACTANCES, STUDY, CertificationRequest
from orchestrator.certification.study import certify
from orchestrator.errors import InputError
from orchestrator.fmi.devices import as_device
from orchestrator.points.executor import Executor
from orchestrator.points.points import CountReport

NTS631 = "nts631"
WITH_VERDICT = (NTS631, *CODES, *BY_DECLARATION)  # codes that a converter passes or fails


@dataclass(frozen=True)
class Issue:
    request: CertificationRequest
    worker: str  # module that a process imports
    rows: str  # what its rows are called
    compute: Callable[[Executor, Path, CountReport], Certificate[Judged]]


def issue_of(
    key: str, fmu: Path, binding: Path | None, values: Mapping[str, Value], *, declared: Mapping[str, object],
    pod: str | None = None, reactances: Sequence[float] = REACTANCES, black_box: bool = False,
) -> Issue:  # fmt: skip
    if key != NTS631:
        code, bench = code_for(key, declared), bench_request(fmu, binding, values)
        return Issue(
            bench, BenchTask.__module__, "rows",
            lambda executor, folder, report: certify_code(bench, code, executor, folder, report=report),
        )  # fmt: skip
    if declared:
        raise InputError(f"--declare {next(iter(declared))}: the damping test takes no declared value; leave it out, "
                         f"or choose --code {', '.join(BY_DECLARATION)}")  # fmt: skip
    study = {name: value for name, value in values.items() if name.split(".")[0] in STUDY}
    own = {name: value for name, value in values.items() if name not in study}
    norm = CertificationRequest(as_device(fmu, binding), binding, own, pod, reactances, study, black_box)
    norm.check()
    return Issue(norm, CertificatePointTask.__module__, "points",
                 lambda executor, folder, report: certify(norm, executor, folder, report))  # fmt: skip


def bench_request(fmu: Path, binding: Path | None, values: Mapping[str, Value]) -> CertificationRequest:
    request = CertificationRequest(as_device(fmu, binding), binding, values)
    request.check()
    return request
