"""A point that cannot be computed says why; the other points stand."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Protocol, Self

import numpy as np

from orchestrator.core.errors import CaseError, CosimError, ErrorKind
from orchestrator.core.spelling import as_options, joined


@dataclass(frozen=True)
class Failure:
    kind: ErrorKind
    text: str
    lasting: bool
    cause: str = ""  # the text without key and scenario; "" where it names none

    @classmethod
    def of(cls, error: BaseException) -> Self:
        if isinstance(error, CosimError):
            if not isinstance(error, CaseError):
                return cls(error.kind, error.message, error.kind.lasting)
            text = joined("; ", [problem.message for problem in error.problems])
            cause = joined("; ", [problem.cause or problem.text for problem in error.problems])
            return cls(error.kind, text, error.kind.lasting, cause)
        if isinstance(error, np.linalg.LinAlgError):
            return cls(ErrorKind.ANALYSIS, f"no eigenvalues: {error}", True)
        return cls(ErrorKind.OTHER, f"{type(error).__name__}: {error}", False)

    @classmethod
    def lost(cls, error: Exception) -> Self:
        return cls(ErrorKind.WORKER_LOST, str(error), False)

    def __str__(self) -> str:
        return str(self.text)


class Failing(Protocol):
    """The result of a point that may hold a failure in place of figures."""

    failure: Failure | None


@contextmanager
def failure_kept(result: Failing) -> Iterator[None]:
    """Inside, an error ends the computation of one point and becomes part of its result.

    An interrupt goes through: it is to end them all."""
    try:
        with as_options():
            yield
    except (
        Exception
    ) as error:  # an unexpected error of a foreign FMU or library must not end the other points
        result.failure = Failure.of(error)
