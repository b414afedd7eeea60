"""Answers of a process in which a foreign FMU's code runs: each is of the form that was asked for, or refused.

The FMU can write whatever it wants into the memory from which they are read."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestrator.core.errors import ComponentError, InputError, UnsupportedFmuError
from orchestrator.devices.sandbox.protections_in_force import Protection

_MOST_TEXT = 4000  # characters of a text that are passed on


class NotAnAnswerError(ValueError):
    """Something else stands where an answer should be."""


def content_of(answer: Any, component: str) -> Any:
    if not isinstance(answer, dict) or len(answer) != 1:
        raise _not("an answer", answer)
    ((kind, content),) = answer.items()
    if kind == "component_error":
        at, how, log = _texts(content, 3)
        raise ComponentError(component, at, how, log)
    if kind == "unsupported":
        raise UnsupportedFmuError(*_texts(content, 3))
    if kind == "input_error":
        raise InputError(*_texts([content], 1))
    if kind not in ("result", "done"):
        raise _not("an answer", kind)
    return content


def _texts(content: Any, count: int) -> list[str]:
    texts = names(content)
    if len(texts) != count:
        raise _not(f"{count} texts", content)
    return [text[:_MOST_TEXT] for text in texts]


def _not(wanted: str, seen: Any) -> NotAnAnswerError:
    return NotAnAnswerError(f"{repr(seen)[:50]} in place of {wanted}")


def number(answer: Any) -> int:
    if type(answer) is not int or not 0 <= answer < 2**63:
        raise _not("a number", answer)
    return answer


def table(answer: Any) -> dict[str, float | bool]:
    if not isinstance(answer, dict) or not all(_is_number(value) for value in answer.values()):
        raise _not("a table of numbers", answer)
    return answer


def table_of(answer: Any, wanted: list[str]) -> dict[str, float | bool]:
    found = table(answer)
    if set(found) != set(wanted):
        raise _not(f"values of {', '.join(wanted)[:100]}", answer)
    return found


def progress(answer: Any) -> tuple[bool, float | None]:
    """Return whether an FMU ended by itself, and when [s]."""
    if isinstance(answer, list) and len(answer) == 2:
        ended, reached = answer
        if isinstance(ended, bool) and (reached is None or _is_number(reached)):
            return ended, reached
    raise _not("whether it ended, and when", answer)


def names(answer: Any) -> list[str]:
    if not isinstance(answer, list) or not all(isinstance(text, str) for text in answer):
        raise _not("a list of texts", answer)
    return answer


def hexadecimal(answer: Any) -> bytes:
    try:
        return bytes.fromhex(answer)
    except (TypeError, ValueError):
        raise _not("bytes", answer) from None


def matrix(answer: Any, rows: int, columns: int) -> NDArray[np.float64]:
    try:
        found = np.array(answer, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise _not("a matrix", answer) from None
    if found.shape != (rows, columns) and found.size + rows * columns:
        raise _not(f"a matrix of shape ({rows}, {columns})", answer)
    return found.reshape(rows, columns)


def protections(answer: Any) -> tuple[Protection, ...]:
    """Return what keeps the process from the rest of the machine; asked for before the FMU is loaded."""
    try:
        return tuple(
            Protection(str(name), bool(in_force), str(how)) for name, in_force, how in answer
        )
    except (TypeError, ValueError):
        raise _not("a list of protections", answer) from None


def _is_number(value: Any) -> bool:
    return isinstance(value, float) or (isinstance(value, int) and abs(value) < 2**1000)
