"""Validation of an FMU against the FMI standard, as FMPy's validator sees it."""

import re
from pathlib import Path
from threading import Lock
from types import SimpleNamespace
from typing import Any

from fmpy import validation

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

_judge_names = validation._validate_variable_names
_legal: set[str] = set()
"""Forms of structured names that FMPy found legal."""


def validation_problems(directory: Path) -> tuple[list[str], list[str]]:
    """Problems of an extracted FMU: those that matter to a master, and those that do not."""
    problems = fmpys_problems(directory)
    harmless = [p for p in problems if any(text in p for text in _HARMLESS)]
    return [p for p in problems if p not in harmless], harmless


def fmpys_problems(fmu: Path) -> list[str]:
    """All that FMPy's validator finds in an FMU, a file or extracted, each on one line."""
    with _one_at_a_time:
        validation._validate_variable_names = _names_by_forms
        try:
            found = validation.validate_fmu(str(fmu))
        finally:
            validation._validate_variable_names = _judge_names
    return [" ".join(str(problem).split()) for problem in found]


def _names_by_forms(description: Any) -> Any:
    """FMPy's judgement of variables' names, asked once for each form of a structured one.

    FMPy parses each name in some milliseconds, with a time that grows with the cube of its length."""
    if description.variableNamingConvention != "structured":
        return _judge_names(description)
    new = {form_of_name(v.name): v for v in description.modelVariables}
    new = {form: variable for form, variable in new.items() if form not in _legal}
    some = SimpleNamespace(variableNamingConvention="structured", modelVariables=[*new.values()])
    if new and _judge_names(some):
        return _judge_names(description)
    _legal.update(new)
    return []


def form_of_name(name: str) -> str:
    """A name with "a" in the place of each word and "0" in that of each number: both are legal, or neither.

    In quotes letters and digits are not words; such a name stands for itself."""
    if "'" in name or "\\" in name:
        return name
    head = "der(" if name.startswith("der(") else ""
    form = re.sub(r"[A-Za-z_][A-Za-z_0-9]*", "a", name[len(head) :])
    return head + re.sub(r"[0-9]+", "0", form)
