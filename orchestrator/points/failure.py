"""A point that cannot be computed says why; the other points stand."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol

from orchestrator.errors import CosimError


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
