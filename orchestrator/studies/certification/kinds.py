"""The two kinds of tests that codes have: NTS 631's points with a case of their own, and rows on the test bench."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import KW_ONLY, MISSING, dataclass
from pathlib import Path
from typing import Any

from orchestrator.cases.form.given import binding_path, plain
from orchestrator.cases.form.schema import Value
from orchestrator.core.asked import FILE, FLAG, FieldKind, number_in, one_of, path, request_field
from orchestrator.core.errors import InputError
from orchestrator.core.late import xr
from orchestrator.core.options import Option
from orchestrator.core.spelling import Spelling
from orchestrator.devices.fmi.device_or_controller import as_device
from orchestrator.studies.certification import points_again
from orchestrator.studies.certification.acceptance import KEPT, Acceptance
from orchestrator.studies.certification.certificate import Certificate
from orchestrator.studies.certification.codes import rows_again
from orchestrator.studies.certification.codes.bench_point import BenchTask, compute_row
from orchestrator.studies.certification.codes.certificate import certify_code
from orchestrator.studies.certification.codes.known import KNOWN, code_for, codes_by_declaration
from orchestrator.studies.certification.codes.nts631 import NTS631
from orchestrator.studies.certification.compared import Content, Verification
from orchestrator.studies.certification.files import RESPONSES
from orchestrator.studies.certification.form import NORM
from orchestrator.studies.certification.point import CertificatePointTask, compute_point
from orchestrator.studies.certification.request import (
    PODS,
    REACTANCES,
    STUDY,
    CertificationRequest,
    read_reactances,
)
from orchestrator.studies.certification.study import certify
from orchestrator.studies.points.executor import Executor
from orchestrator.studies.points.points import CountReport, Work, nobody
from orchestrator.studies.points.request import ANYTHING
from orchestrator.studies.points.task import Task


@dataclass
class Parts:
    """How a kind of test is made, kept, judged again and computed anew."""

    one: str  # what a part is called; the record has a list of them
    task: type[Task]
    option: Spelling  # with which `gfor verify` takes some of them, and in Python the function
    values: str  # of that option
    # the module that judges them again: ``rebuilt``, ``faults``, ``choose``, ``tasks`` and ``compare``
    again: Any
    compute: Callable[[Any], Any]
    # those that the version that issued a record had not
    later: Callable[[Content], tuple[str, ...]] = lambda _: ()

    def chosen(
        self, folder: Path, content: Content, wanted: Sequence[Any], *, every: bool
    ) -> list[Any]:
        """Line reactances, or names of rows; ``wanted``: those that were asked for."""
        named = any(isinstance(one, str) for one in wanted)
        if wanted and named != (self is ROWS):
            kind = "a grid code" if self is ROWS else "a damping test"
            given = ROWS if named else POINTS
            raise InputError(
                given.option
                + f": {folder} is the certificate of {kind}, which has {self.one}s; give "
                + self.option
                + f", with {self.values}"
            )
        return list(self.again.choose(content, wanted, every=every))

    def verify(
        self,
        folder: Path,
        content: Content,
        chosen: Sequence[Any],
        executor: Executor,
        report: CountReport = nobody,
    ) -> Verification:
        found = Verification()
        tasks = self.again.tasks(folder, content, chosen, found)
        with xr.open_dataset(folder / RESPONSES, engine="scipy") as data:
            for index, again in Work(executor, report=report).each(self.compute, tasks):
                for fault, said in self.again.compare(content, tasks[index], again, data):
                    (found.faults if fault else found.agreed).append(fault or said)
        return found


POINTS = Parts(
    "point",
    CertificatePointTask,
    Spelling("--points", "anew"),
    values="line reactances",
    again=points_again,
    compute=compute_point,
)
ROWS = Parts(
    "row",
    BenchTask,
    Spelling("--rows", "anew"),
    values="their names",
    again=rows_again,
    compute=compute_row,
    later=rows_again.later,
)


def parts_of(content: Content) -> Parts:
    return POINTS if content["format"] == NORM else ROWS


def rebuilt(folder: Path, content: dict[str, Any], responses: xr.Dataset) -> Certificate:
    """The certificate anew from what its folder keeps, by the judgement that made it: from the FMU, the case file, the
    responses and, of a damping test, the eigenvalues."""
    certificate: Certificate = parts_of(content).again.rebuilt(folder, content, responses)
    if content["acceptance"] is not None:
        report = json.loads((folder / KEPT).read_text(encoding="utf-8"))
        faults = tuple(
            dict.fromkeys(
                check["fault"] for check in report["checks"] if check["verdict"] == "fail"
            )
        )
        certificate.acceptance = Acceptance(not faults, faults, {**report, "trusted": not faults})
    return certificate


WITH_VERDICT = (NTS631, *KNOWN)  # codes that a converter passes or fails


def _reactances(given: Any, argument: str) -> tuple[float, ...]:
    rule = "line reactances in pu, such as (0.1, 0.2)"
    if isinstance(given, str) or not isinstance(given, Iterable):
        raise InputError(f"{argument} = {given!r}; give {rule}")
    found = tuple(number_in(x, "pu", argument, rule) for x in given)
    if not found:
        raise InputError(f"{argument} = {given!r}; give {rule}, or leave it out for the norm's")
    return found


@dataclass(frozen=True)
class CertifyRequest:
    """Test a converter's FMU under a grid code, and write its certificate.

    Raises
    ------
    InputError
        If there is no such code, or the FMU, the binding or a value cannot be used.

    Examples
    --------
    >>> import orchestrator as gfor
    >>> gfor.certify("vendor.fmu", "miso", folder="certificate").verdict  # doctest: +SKIP
    'passes'
    >>> gfor.certify("vendor.fmu", "misa")  # doctest: +ELLIPSIS
    Traceback (most recent call last):
        ...
    orchestrator.core.errors.InputError: code = 'misa'; give one of nts631, miso, ...
    """

    fmu: str | Path = request_field(FieldKind("", str, path), MISSING, "the converter", option=None)
    code: str = request_field(
        one_of(WITH_VERDICT),
        NTS631,
        f'``"{NTS631}"``, the damping test, or another that ``gfor certify '
        "--code`` names, with a verdict",
        option=None,
    )
    _: KW_ONLY
    binding: str | Path | None = request_field(
        FieldKind("", str, lambda given, _: binding_path(given)),
        None,
        "file that says what the FMU's variables mean at our port",
        option=None,
    )
    values: Mapping[str, Any] | None = request_field(
        FieldKind("", str, plain),
        None,
        'of the converter, such as ``{"pod_p.K": 150}``; or of the damping test\'s '
        "study, which makes it another test",
        option=None,
    )
    declared: Mapping[str, float] | None = request_field(
        FieldKind("", str, plain),
        None,
        "what the applicant declares, for codes that compare the converter with that",
        option=None,
    )
    pod: str | None = request_field(
        one_of(PODS),
        None,
        "of nts631: damping controllers that are to be active: set in the FMU where it has "
        "pod_p.enabled and pod_q.enabled, else declared by the applicant (default: as the FMU shows them)",
        f"{{{','.join(PODS)}}}",
        python=f"active damping controllers, one of {', '.join(PODS)}; as the FMU shows them by default",
    )
    reactances: Sequence[float] | None = request_field(
        FieldKind("X,X,…", read_reactances, _reactances),
        None,
        "of nts631: line reactances X_L [pu] (default: "
        "the norm's 13, 0.01 and 0.05 to 0.60; less is incomplete)",
        python="line reactances of the damping test [pu]; the norm's 13 by default, less is incomplete",
    )
    black_box: bool = request_field(
        FLAG, False, "of nts631: do not use the converter's states for the modes"
    )
    check: bool = request_field(
        FLAG, True, "whether the acceptance tests of the FMU are run", option=None
    )
    folder: str | Path | None = request_field(
        FILE,
        None,
        "for the certificate; ``results/certify_<file>[_<code>]`` by default. Points that are there are "
        "kept",
        option=None,
    )
    into: str | Path | None = request_field(
        FILE,
        None,
        "write the FMU with its certificate in it, and with experiments that any tool can repeat; "
        "certificates by other codes that OUT.fmu holds stay",
        "OUT.fmu",
        python="where the FMU is written with the "
        "certificate in it, and with experiments that any tool can repeat",
    )
    sign: str | Path | None = request_field(
        FILE,
        None,
        "sign it: a private key of OpenSSH, the public key of one that the agent or hardware has, or a PEM key",
        "KEY",
    )
    workers: int | None = request_field(
        ANYTHING, 1, "processes; one for each core where None", option=None
    )
    progress: bool = request_field(FLAG, False, "show a bar", option=None)

    def issue(self) -> Issue:
        """How it is computed."""
        binding = None if self.binding is None else Path(self.binding)
        fmu, values = Path(self.fmu), self.values or {}
        if self.code != NTS631:
            code, bench = (
                code_for(self.code, self.declared or {}),
                bench_request(fmu, binding, values),
            )
            return Issue(
                bench,
                ROWS,
                lambda work, folder, say: certify_code(bench, code, work, folder, report=say),
            )
        if self.declared:
            raise InputError(
                Option.DECLARE
                + f" {next(iter(self.declared))}: the damping test takes no declared value; "
                "leave it out, or choose " + Option.CODE + f" {', '.join(codes_by_declaration())}"
            )
        study = {name: value for name, value in values.items() if name.split(".")[0] in STUDY}
        own = {name: value for name, value in values.items() if name not in study}
        reactances = self.reactances or REACTANCES
        norm = CertificationRequest(
            as_device(fmu, binding),
            binding,
            values=own,
            pod=self.pod,
            reactances=reactances,
            study_values=study,
            black_box=self.black_box,
        )
        norm.check()
        return Issue(
            norm, POINTS, lambda executor, folder, report: certify(norm, executor, folder, report)
        )


def usual_folder(name: str, code: str) -> Path:
    return Path("results") / f"certify_{name}{'' if code == NTS631 else f'_{code}'}"


@dataclass(frozen=True)
class Issue:
    request: CertificationRequest
    parts: Parts
    compute: Callable[[Executor, Path, CountReport], Certificate]


def bench_request(
    fmu: Path, binding: Path | None, values: Mapping[str, Value]
) -> CertificationRequest:
    request = CertificationRequest(as_device(fmu, binding), binding, values)
    request.check()
    return request
