"""Validation of an FMU against the FMI standard, as FMPy's validator sees it."""

from pathlib import Path
from threading import Lock

from fmpy.validation import validate_fmu

_HARMLESS = (
    "not a legal variable name",
    'initial="calculated" but provides',
    "InitialUnknowns",
    "of the initial unknown",
    "display unit",
)
"""What breaks the standard without changing an answer."""

_one_at_a_time = Lock()
"""libxml2 makes its types of schemas at the first use, and calls a valid description invalid if two threads begin."""


def validation_problems(directory: Path) -> tuple[list[str], list[str]]:
    """Problems of an extracted FMU: those that matter to a master, and those that do not."""
    with _one_at_a_time:
        found = validate_fmu(str(directory))
    problems = [" ".join(str(p).split()) for p in found]
    harmless = [p for p in problems if any(text in p for text in _HARMLESS)]
    return [p for p in problems if p not in harmless], harmless
