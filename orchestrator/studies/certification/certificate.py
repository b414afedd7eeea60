"""The certificate of one converter under one code: what was judged, the verdict, and the sentence on it."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from orchestrator.cases.form.schema import Value
from orchestrator.core.errors import CaseError, Problem
from orchestrator.devices.fmi.description import FmuDescription
from orchestrator.devices.fmi.values import as_text
from orchestrator.studies.certification.acceptance import Acceptance
from orchestrator.studies.certification.case_file import BINDING, FMU
from orchestrator.studies.certification.codes.row import GridCode
from orchestrator.studies.certification.damping_controllers import DampingControllers
from orchestrator.studies.certification.details import Details
from orchestrator.studies.certification.environment import environment
from orchestrator.studies.certification.judgement import watched
from orchestrator.studies.certification.margins import CriterionMargin
from orchestrator.studies.certification.point import CONVERTER
from orchestrator.studies.certification.request import (
    REACTANCES,
    CertificationRequest,
    same_reactance,
)
from orchestrator.studies.certification.verdict import (
    FAILS,
    INCOMPLETE,
    PASSES,
    incomplete_because,
    verdict_of,
)


@dataclass
class Certificate:
    request: CertificationRequest
    description: FmuDescription
    code: GridCode[Any]
    f_n: float
    # each with ``name``, ``judged``, ``accepted``, ``unknown``, and its ``margins()``
    verdicts: Sequence[Any]
    results: Mapping[Any, Any]  # what was computed: by row, or by scenario and line reactance
    case: Path  # the case file of the damping test, or of the first row
    # every value of the system with the converter at the first row, by ``component.variable``
    values: Mapping[str, float | bool] = field(default_factory=dict, kw_only=True)
    # what the damping test has beside
    damping: DampingTest | None = field(default=None, kw_only=True)
    stored: int = field(default=0, kw_only=True)  # number of rows that an earlier start had kept
    details: Details = field(default_factory=Details, kw_only=True)
    # of a record that is read again: names of the FMU and the binding as they were given, and where it was computed
    names: Mapping[str, str] = field(default_factory=dict, kw_only=True)
    computed_on: Mapping[str, str] = field(default_factory=environment, kw_only=True)
    # of the FMU; None where they were not run
    acceptance: Acceptance | None = field(default=None, kw_only=True)

    @property
    def fmu_name(self) -> str:
        return self.names.get(FMU, self.request.fmu.name)

    @property
    def binding_name(self) -> str | None:
        return self.names.get(BINDING, self.request.binding.name) if self.request.binding else None

    @property
    def departures(self) -> tuple[str, ...]:
        """By what the test differs from the code's own."""
        own = self.request.departures
        if self.f_n == self.code.f_n:
            return own
        return (*own, f"the rated frequency, {self.f_n:g} Hz in place of {self.code.f_n:g} Hz")

    @property
    def missing(self) -> tuple[str, ...]:
        """Why a test that nothing fails is not passed, its departures included."""
        done = {v.name for v in self.verdicts if v.judged}
        rows = tuple(
            f"row {r.name}" for r in self.code.rows if r.name not in done and not r.shown_only
        )
        return (*rows, *self.code.left_out, *self.departures)

    @property
    def verdict(self) -> str:
        return verdict_of(
            [bool(row.accepted) for row in self.verdicts if row.judged], len(self.missing)
        )

    @property
    def passed(self) -> bool:
        return self.verdict == PASSES

    @property
    def refused(self) -> bool:
        return self.acceptance is not None and not self.acceptance.trusted

    @property
    def margins(self) -> list[CriterionMargin]:
        return [margin for row in self.verdicts if row.judged for margin in row.margins()]

    def sentence(self) -> str:
        """The verdict, with what failed or was not tested."""
        said = rows_in_words(self) if self.damping is None else self.damping.in_words(self)
        if self.acceptance is not None and self.refused:
            said += f" Acceptance tests failed: {', '.join(self.acceptance.faults)}; do not rely on the FMU as it is."
        return said


def rows_in_words(c: Certificate) -> str:
    judged = [v for v in c.verdicts if v.judged]
    bad = [v for v in judged if not v.accepted]
    subject, title = f"The converter {c.description.model_name!r}", c.code.title
    rows = f"{len(judged) - len(bad)} of {len(judged)} judged rows are accepted."
    if bad:
        names = "; ".join(f"{v.name}: {', '.join(f.criterion for f in v.failed)}" for v in bad)
        return f"{subject} {FAILS} {title}: {rows} Not accepted: {names}."
    if c.verdict == INCOMPLETE:
        # as issued ones say, also of one part
        untested = f"{len(c.missing)} parts of {title} were not tested."
        return f"The test is {INCOMPLETE}: {untested} {subject}: {rows}"
    return f"{subject} {PASSES} {title}: {rows}"


@dataclass(frozen=True)
class DampingTest:
    """Test that NTS 631 has beside the rows of other codes: rows are line reactances, of a case of its own."""

    controllers: DampingControllers
    event_time: float

    @property
    def pod(self) -> str:
        return self.controllers.pod

    @property
    def signal(self) -> str:
        return watched(self.pod)

    def in_words(self, c: Certificate) -> str:
        subject = f"The converter {c.description.model_name!r} {self.controllers.in_words()}"
        reasons = incomplete_because(missing_of(c), c.departures)
        if c.verdict == PASSES:
            return f"{subject} passes the damping test at all {len(REACTANCES)} line reactances, by both criteria."
        if c.verdict == FAILS:
            failed = [v for v in c.verdicts if v.judged and not v.accepted]
            places, first = ", ".join(f"{v.X_L:g}" for v in failed), failed[0]
            text = f"{subject} fails the damping test at X_L = {places} pu. At {first.X_L:g} pu: "
            text += f"{'; '.join(first.faults)}."
            return f"{text} The test is incomplete as well: {reasons}." if reasons else text
        where = (
            "is accepted where it was judged"
            if any(v.judged for v in c.verdicts)
            else "was judged nowhere"
        )
        unknown = [v for v in c.verdicts if not v.judged]
        text = f"The damping test is incomplete: {reasons}. {subject} {where}"
        return f"{text}; at {unknown[0].X_L:g} pu, {unknown[0].unknown}." if unknown else f"{text}."


def missing_of(c: Certificate) -> tuple[float, ...]:
    """Reactances of the norm that were not judged [pu]."""
    done = [v.X_L for v in c.verdicts if v.judged]
    return tuple(X for X in REACTANCES if not any(same_reactance(X, value) for value in done))


_OWN = re.compile(
    rf'^(?:components\.{CONVERTER}\.parameters\.|--set {CONVERTER}\.)"?(?P<name>[^"]*)"?$'
)
"""Place of a value of the converter, in a case file or among changes."""


@contextmanager
def refusing(request: CertificationRequest, folder: Path, where: str) -> Iterator[Path]:
    """A folder for a trial, so that a request that is refused leaves the files of a certificate as they are."""
    folder.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory(dir=folder, prefix=".request_") as trial:
        try:
            yield Path(trial)
        except CaseError as error:
            raise _refused(request, error, trial, where) from error


def _refused(request: CertificationRequest, error: CaseError, trial: str, where: str) -> CaseError:
    """The same problems, each at the option or in the file of the user that it comes from."""
    own = {f"{trial}/{FMU}": str(request.fmu), f"{trial}/{BINDING}": str(request.binding)}

    def said(text: str) -> str:
        for laid, given in own.items():
            text = text.replace(laid, given)
        return text

    problems = []
    for problem in error.problems:
        place = re.sub(r"^line \d+, ", "", problem.place)
        value = _OWN.match(place)
        if value and value["name"] in request.values:
            place = f"--set {value['name']}={_value_text(request.values[value['name']])}"
        text = said(problem.text).replace(f"component {CONVERTER!r} has", "the FMU has")
        problems.append(Problem(place, text))
    if request.binding is None and any(
        p.place.startswith(f"components.{CONVERTER}") for p in problems
    ):
        problems.append(
            Problem(
                "",
                f"if its port has other names, give --binding; `gfor fmu bind {request.fmu}` drafts one",
            )
        )
    return CaseError(f"{request.fmu}, {where}", tuple(dict.fromkeys(problems)))


def _value_text(value: Value) -> str:
    return f"{value:.15g}" if isinstance(value, float) else as_text(value)
