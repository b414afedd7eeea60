"""Questions about the syntax trees of all files: one worker reads them and answers every question, for all workers.

The trees take seconds to read, and longer to hand to another process than to read anew: the answers are small.
"""

import os
from collections.abc import Callable
from functools import cache, wraps
from inspect import unwrap
from pkgutil import resolve_name
from typing import TypeVar

from orchestrator.core.uncollected import uncollected
from tests.support.once import computed_once
from tests.support.source_files import forget_sources

Answer = TypeVar("Answer")

QUESTIONS = (
    "tests.studies.points.test_failure_kinds:searches_by_file",
    "tests.test_architecture:modules",
    "tests.test_docstrings:empty_docstrings",
    "tests.test_foreign_files:calls_that_run_code",
    "tests.test_foreign_files:reads_by_module",
    "tests.test_form:places_by_rule",
)
"""Functions that look at all files, each marked by `asked_of_all_code`."""


def asked_of_all_code(ask: Callable[[], Answer]) -> Callable[[], Answer]:
    """The function, whose answer can be pickled; with workers all `QUESTIONS` are answered as the first is asked."""
    question = f"{ask.__module__}:{ask.__qualname__}"
    if question not in QUESTIONS:
        raise ValueError(f"{question} is not among the questions of {__name__}")

    @cache
    @wraps(ask)
    def answer() -> Answer:
        if "PYTEST_XDIST_WORKER" in os.environ:
            return _answers()[question]
        with uncollected():
            return ask()

    return answer


@computed_once
def _answers() -> dict[str, object]:
    with uncollected():
        answers = {question: unwrap(resolve_name(question))() for question in QUESTIONS}
        forget_sources()  # else every search for garbage goes through a million nodes
    return answers
