"""The certificate of one converter under one code: what was judged, the verdict, and the sentence on it."""

import re
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Generic, Protocol, TypeVar

from orchestrator.cases.schema import Value
from orchestrator.certification.acceptance import Acceptance
from orchestrator.certification.case_file import BINDING, FMU
from orchestrator.certification.details import Details
from orchestrator.certification.margins import CriterionMargin
from orchestrator.certification.point import CONVERTER
from orchestrator.certification.request import CertificationRequest
from orchestrator.certification.verdict import PASSES, verdict_of
from orchestrator.errors import CaseError, Problem
from orchestrator.fmi.description import FmuDescription
from orchestrator.fmi.values import as_text


class Judged(Protocol):
    """The verdict on one row of a code: a line reactance of NTS 631, or a row of the test bench."""

    @property
    def judged(self) -> bool: ...

    @property
    def accepted(self) -> bool | None: ...

    def margins(self) -> list[CriterionMargin]:
        """Every criterion that counts towards the verdict."""
        ...


Row_co = TypeVar("Row_co", bound=Judged, covariant=True)


@dataclass
class Certificate(ABC, Generic[Row_co]):
    request: CertificationRequest
    description: FmuDescription
    verdicts: Sequence[Row_co]
    stored: int = field(default=0, kw_only=True)  # number of rows that an earlier start had kept
    details: Details = field(default_factory=Details, kw_only=True)
    acceptance: Acceptance | None = field(default=None, kw_only=True)  # of the FMU; None where they were not run

    @property
    @abstractmethod
    def missing(self) -> tuple[object, ...]:
        """Parts of the code that were not judged."""

    @property
    def departures(self) -> tuple[str, ...]:
        """By what the test differs from the code's own."""
        return self.request.departures

    @abstractmethod
    def result(self) -> str:
        """The verdict as a sentence, before anything is said of acceptance tests."""

    @property
    def verdict(self) -> str:
        accepted = [bool(row.accepted) for row in self.verdicts if row.judged]
        return verdict_of(accepted, len(self.missing) + len(self.departures))

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
        said = self.result()
        if self.acceptance is not None and self.refused:
            said += f" Acceptance tests failed: {', '.join(self.acceptance.faults)}; do not rely on the FMU as it is."
        return said


_OWN = re.compile(rf'^(?:components\.{CONVERTER}\.parameters\.|--set {CONVERTER}\.)"?(?P<name>[^"]*)"?$')
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
            place = f"--set {value['name']}={_shown(request.values[value['name']])}"
        text = said(problem.text).replace(f"component {CONVERTER!r} has", "the FMU has")
        problems.append(Problem(place, text))
    if request.binding is None and any(p.place.startswith(f"components.{CONVERTER}") for p in problems):
        problems.append(
            Problem("", f"if its port has other names, give --binding; `gfor fmu bind {request.fmu}` drafts one")
        )
    return CaseError(f"{request.fmu}, {where}", tuple(dict.fromkeys(problems)))


def _shown(value: Value) -> str:
    return f"{value:.15g}" if isinstance(value, float) else as_text(value)
