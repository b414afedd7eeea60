"""Names in a case file: those of a signal, and those that somebody may have meant."""

import difflib
import re
from collections.abc import Iterable

from orchestrator.errors import InputError


def close_names(wanted: str, known: Iterable[str], otherwise: str = "") -> str:
    """A hint at names of the same parts (``line_5_4`` for ``line_4_5``), else at ones that look alike."""
    names = list(known)
    close = [name for name in names if _parts(name) == _parts(wanted)]
    close = close or difflib.get_close_matches(wanted, names, n=3, cutoff=0.5)
    return f"did you mean {' or '.join(close)}?" if close else otherwise


def _parts(name: str) -> list[str]:
    return sorted(re.split(r"[_.]", name))


def variables_of(expression: str) -> list[str]:
    """Names of the variables in a signal's expression.

    Raises
    ------
    InputError
        If the expression is neither a variable nor the difference of two.
    """
    names = [part.strip() for part in expression.split(" - ")]
    if not 1 <= len(names) <= 2 or not all(names):
        raise InputError(
            f"signal {expression!r}: write 'component.variable' or 'component.variable - component.variable'"
        )
    return names
