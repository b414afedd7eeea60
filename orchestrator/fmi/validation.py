"""Whether an FMU keeps to the FMI standard, as FMPy's validator sees it."""

from pathlib import Path

from fmpy.validation import validate_fmu

_HARMLESS = ("illegal combination of causality", "not a legal variable name", "initial=\"calculated\" but provides",
             "InitialUnknowns", "display unit")  # fmt: skip
"""What breaks the standard without changing an answer."""


def validation_problems(directory: Path) -> tuple[list[str], list[str]]:
    """Problems of an extracted FMU: those that matter to a master, and those that do not."""
    problems = [" ".join(str(p).split()) for p in validate_fmu(str(directory))]
    harmless = [p for p in problems if any(text in p for text in _HARMLESS)]
    return [p for p in problems if p not in harmless], harmless
