"""The certificate of one converter under one code: what was judged, the verdict, and the sentence on it."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, ClassVar

from orchestrator.cases.form.schema import Value
from orchestrator.core.errors import CaseError, Problem
from orchestrator.core.options import Option
from orchestrator.devices.fmi.description import FmuDescription
from orchestrator.devices.fmi.values import as_text
from orchestrator.studies.certification.acceptance import Acceptance
from orchestrator.studies.certification.case_file import BINDING, FMU, WITH
from orchestrator.studies.certification.codes.row import GridCode
from orchestrator.studies.certification.damping_controllers import DampingControllers
from orchestrator.studies.certification.details import Details
from orchestrator.studies.certification.environment import environment
from orchestrator.studies.certification.judgement import PointVerdict, watched
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
    NOT_ACCEPTED,
    PASSES,
    REFUSED,
    incomplete_because,
    verdict_of,
)

_FLOW = ("Q_0", "theta_0")
"""Values of the converter that the power flow of the damping test's case gives."""

_INCOMPLETE_AS_WELL = "The test is incomplete as well"

_STUDY = ("S_n", "P_0", "v_0")
"""Values of the converter that the damping test's case sets."""


@dataclass
class Certificate:
    """A certificate by the rows of a code on the test bench; `DampingCertificate` is the other kind.

    ``part``: what a part of the test is called; ``is_by_rows``: whether `gfor certify --sensitivities` can tell what
    its rows need."""

    part: ClassVar[str] = "row"
    is_by_rows: ClassVar[bool] = True

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
        done = {v.name for v in self.verdicts if v.is_judged}
        rows = tuple(
            f"row {r.name}" for r in self.code.rows if r.name not in done and not r.shown_only
        )
        return (*rows, *self.code.left_out, *self.departures)

    @property
    def verdict(self) -> str:
        return verdict_of(
            [bool(row.accepted) for row in self.verdicts if row.is_judged], len(self.missing)
        )

    @property
    def passed(self) -> bool:
        return self.verdict == PASSES

    @property
    def refused(self) -> bool:
        return self.acceptance is not None and not self.acceptance.trusted

    @property
    def margins(self) -> list[CriterionMargin]:
        return [margin for row in self.verdicts if row.is_judged for margin in row.margins()]

    def sentence(self) -> str:
        """The verdict, with what failed or was not tested."""
        return self.with_refusal(self.test_in_words())

    def earlier_sentences(self) -> Iterator[str]:
        """Yield the same as earlier versions said it, whose certificates hold."""
        yield from ()

    def with_refusal(self, said: str) -> str:
        """Return a sentence on the test with the failed acceptance tests behind it."""
        if self.acceptance is None or not self.refused:
            return said
        faults = ", ".join(self.acceptance.faults)
        return f"{said}{REFUSED} {faults}; do not rely on the FMU as it is."

    @property
    def heading(self) -> str:
        """Return the name of the test in the title of the page."""
        return self.code.key.upper()

    @property
    def part_of_test(self) -> str:
        """How much of the test was judged, for the title; "" if that is all."""
        return ""

    @property
    def settings(self) -> Mapping[str, Value]:
        """Values of the converter that the test itself switches."""
        return {}

    def origin_of(self, name: str) -> str:
        """Return what gave a value of the converter."""
        if name in self.request.values:
            return "--set"
        return f"the bench, in row {self.verdicts[0].name}"

    def test_in_words(self) -> str:
        """Return the sentence on the test alone, without the acceptance tests."""
        judged = [v for v in self.verdicts if v.is_judged]
        bad = [v for v in judged if not v.accepted]
        subject, title = f"The converter {self.description.model_name!r}", self.code.title
        rows = f"{len(judged) - len(bad)} of {len(judged)} judged rows are accepted."
        if bad:
            names = "; ".join(f"{v.name}: {', '.join(f.criterion for f in v.failed)}" for v in bad)
            return f"{subject} {FAILS} {title}: {rows}{NOT_ACCEPTED} {names}."
        if self.verdict == INCOMPLETE:
            # as issued ones say, also of one part
            untested = f"{len(self.missing)} parts of {title} were not tested."
            return f"The test is {INCOMPLETE}: {untested} {subject}: {rows}"
        return f"{subject} {PASSES} {title}: {rows}"


@dataclass
class DampingCertificate(Certificate):
    """A certificate by NTS 631's damping test, whose parts are line reactances of a case of its own."""

    part: ClassVar[str] = "point"
    is_by_rows: ClassVar[bool] = False

    controllers: DampingControllers = field(kw_only=True)
    event_time: float = field(kw_only=True)  # [s]

    @property
    def pod(self) -> str:
        return self.controllers.pod

    @property
    def signal(self) -> str:
        return watched(self.pod)

    @property
    def heading(self) -> str:
        return "Damping test"

    @property
    def part_of_test(self) -> str:
        left, rows = missing_of(self), len(self.code.rows)
        return f" ({rows - len(left)} of {rows})" if left else ""

    @property
    def settings(self) -> Mapping[str, Value]:
        return self.controllers.settings

    def origin_of(self, name: str) -> str:
        if name in self.request.values:
            return "--set"
        if name in self.settings:
            return "--pod"
        if name in _FLOW:
            return f"the power flow at X_L = {self.request.reactances[0]:g} pu"
        return "the study" if name in _STUDY else "the step size of the study"

    def test_in_words(self) -> str:
        subject = f"The converter {self.description.model_name!r} {self.controllers.in_words()}"
        reasons = incomplete_because(missing_of(self), self.departures)
        if self.verdict == PASSES:
            return f"{subject} passes the damping test at all {len(REACTANCES)} line reactances, by both criteria."
        judged = [v for v in self.verdicts if v.is_judged]
        if self.verdict == FAILS:
            failed = [v for v in judged if not v.accepted]
            worst = min(failed, key=self._standing)
            at = f"X_L = {worst.X_L:g} pu: {'; '.join(worst.faults)}."
            several = f"{len(failed)} of {len(judged)} line reactances, worst at "
            text = f"{subject} fails the damping test at {several * (len(failed) > 1)}{at}"
            return f"{text} {_INCOMPLETE_AS_WELL}: {reasons}." if reasons else text
        where = "is accepted where it was judged" if judged else "was judged nowhere"
        unknown = [v for v in self.verdicts if not v.is_judged]
        text = f"The damping test is incomplete: {reasons}. {subject} {where}"
        return f"{text}; at {unknown[0].X_L:g} pu, {unknown[0].unknown}." if unknown else f"{text}."

    def earlier_sentences(self) -> Iterator[str]:
        failed = [v for v in self.verdicts if v.is_judged and not v.accepted]
        if self.verdict != FAILS:
            return
        places, first = ", ".join(f"{v.X_L:g}" for v in failed), failed[0]
        text = f"The converter {self.description.model_name!r} {self.controllers.in_words()} fails the damping test "
        text += f"at X_L = {places} pu. At {first.X_L:g} pu: {'; '.join(first.faults)}."
        reasons = incomplete_because(missing_of(self), self.departures)
        yield self.with_refusal(f"{text} {_INCOMPLETE_AS_WELL}: {reasons}." if reasons else text)

    def _standing(self, point: PointVerdict) -> tuple[float, float]:
        """The least margin of what a point is not accepted for, -∞ where that has no figure, and its growth turned."""
        margins = [one.margin for one in point.margins() if not one.accepted]
        least = min((-math.inf if one is None else one for one in margins), default=-math.inf)
        return least, -self.results[WITH, point.X_L].growth


def missing_of(c: Certificate) -> tuple[float, ...]:
    """Reactances of the norm that were not judged [pu]."""
    done = [v.X_L for v in c.verdicts if v.is_judged]
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

    def with_own_paths(text: str) -> str:
        for laid, given in own.items():
            text = text.replace(laid, given)
        return text

    problems = []
    for problem in error.problems:
        place = re.sub(r"^line \d+, ", "", problem.place)
        value = _OWN.match(place)
        if value and value["name"] in request.values:
            place = Option.SET + f" {value['name']}={_value_text(request.values[value['name']])}"
        text = with_own_paths(problem.text).replace(f"component {CONVERTER!r} has", "the FMU has")
        problems.append(Problem(place, text))
    if request.binding is None and any(
        p.place.startswith(f"components.{CONVERTER}") for p in problems
    ):
        problems.append(
            Problem(
                "",
                "if its port has other names, give "
                + Option.BINDING
                + f"; `gfor fmu bind {request.fmu}` drafts one",
            )
        )
    return CaseError(f"{request.fmu}, {where}", tuple(dict.fromkeys(problems)))


def _value_text(value: Value) -> str:
    return f"{value:.15g}" if isinstance(value, float) else as_text(value)
