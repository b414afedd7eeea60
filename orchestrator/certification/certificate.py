"""The certificate of one converter under one code: what was judged, the verdict, and the sentence on it."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Generic, Protocol, TypeVar

from orchestrator.certification.acceptance import Acceptance
from orchestrator.certification.details import Details
from orchestrator.certification.margins import CriterionMargin
from orchestrator.certification.request import CertificationRequest
from orchestrator.certification.verdict import PASSES, verdict_of
from orchestrator.fmi.description import FmuDescription


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
