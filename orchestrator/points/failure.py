"""A point that cannot be computed says why; the other points stand."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol

from orchestrator.errors import AnalysisError, CaseError, ComponentError, CosimError


class Failing(Protocol):
    """The result of a point that may hold a failure in place of figures."""

    failure: str | None


@contextmanager
def failure_kept(result: Failing) -> Iterator[None]:
    """Inside, an error ends the computation of one point and becomes part of its result.

    An interrupt goes through: it is to end them all.

    Parameters
    ----------
    result
        Takes the reason; what was computed before the error stays in it.
    """
    try:
        yield
    except CosimError as error:
        result.failure = str(error)
    except Exception as error:  # an unexpected error of a foreign FMU or library must not end the other points
        result.failure = f"{type(error).__name__}: {error}"


def why_failed(error: Exception) -> tuple[str, bool]:
    """What ended the computation of a point, and whether the same would come out again.

    Parameters
    ----------
    error
        An FMU may start another time; what is wrong in a case or in its equations stays so.
    """
    if isinstance(error, CaseError):
        return "; ".join(str(problem) for problem in error.problems), not isinstance(error.__cause__, ComponentError)
    if isinstance(error, CosimError):
        return str(error), isinstance(error, AnalysisError)
    return f"{type(error).__name__}: {error}", False
