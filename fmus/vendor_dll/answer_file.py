"""The file in which the process that reads a DLL answers.

The DLL's code runs in that process and can write the file as well. So it is taken for what the DLL says of itself: read
as a plain file of bounded size, of the form that was asked for, with no character that XML or a terminal takes for more
than text. An answer of the DLL's own making that has this form says no more than its Model_GetInfo could have said; and
how it keeps its state is tried again by `gfor fmu check`."""

import json
import os
import re
import stat
from collections.abc import Callable
from pathlib import Path
from typing import Any

MOST_TEXT = 100_000  # characters of one text
_MOST_BYTES = 32 * 1024**2  # of the file: 100,000 parameters have about 20 MB
_NO_TEXT = "[^\t\n\r\x20-\x7e\xa0-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]"
"""Controls, escapes and what is no character; compiled where a text is read, since that takes 16 ms."""

_STATES = ("arrays", "library", "hidden", "not tried")


class ForeignAnswerError(ValueError):
    """The answer is not of the form in which the process that reads a DLL answers."""


def read_plain_file(path: Path, most: int = _MOST_BYTES) -> bytes:
    """The content of a file that foreign code may have put there."""
    try:
        number = os.open(
            path, os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)
        )
    except OSError as error:
        raise ForeignAnswerError(f"it cannot be opened: {error.strerror}") from error
    found = os.fstat(number)
    if not stat.S_ISREG(found.st_mode) or found.st_size > most:
        os.close(number)
        raise ForeignAnswerError(f"it is no plain file of at most {most} bytes")
    with open(number, "rb") as file:
        return file.read(most)


def read_answer(path: Path) -> dict[str, Any]:
    """The process's answer: ``error``, or ``interface`` and ``trial``."""
    try:
        content = json.loads(read_plain_file(path))
    except (ValueError, RecursionError) as error:
        if isinstance(error, ForeignAnswerError):
            raise
        raise ForeignAnswerError("it is not JSON") from error
    form = _ERROR if isinstance(content, dict) and "error" in content else _ANSWER
    found: dict[str, Any] = _require_form(content, form, "the answer")
    return found


def _whole(value: Any, where: str) -> int:
    if not isinstance(value, int) or isinstance(value, bool) or abs(value) >= 2**63:
        raise ForeignAnswerError(f"{where} is no whole number")
    return value


def _place(value: Any, where: str) -> int:
    if _whole(value, where) < 0:
        raise ForeignAnswerError(f"{where} is below zero")
    return int(value)


def _number(value: Any, where: str) -> float:
    return value if isinstance(value, float) else _whole(value, where)


def _flag(value: Any, where: str) -> bool:
    if not isinstance(value, bool):
        raise ForeignAnswerError(f"{where} is neither true nor false")
    return value


def _text(value: Any, where: str) -> str:
    if not isinstance(value, str) or len(value) > MOST_TEXT:
        raise ForeignAnswerError(f"{where} is no text of at most {MOST_TEXT} characters")
    return re.sub(_NO_TEXT, "\ufffd", value)


def _name(value: Any, where: str) -> str:
    """The name unchanged: `DllInterface.faults` refuses those that cannot be written."""
    _text(value, where)
    return str(value)


def _state(value: Any, where: str) -> str:
    if value not in _STATES:
        raise ForeignAnswerError(f"{where} is none of {', '.join(_STATES)}")
    return str(value)


def _default(value: Any, where: str) -> float | str:
    return _text(value, where) if isinstance(value, str) else _number(value, where)


def _bound(value: Any, where: str) -> float | None:
    return None if value is None else _number(value, where)


def _require_form(value: Any, form: Any, where: str) -> Any:
    """The value, where it has the form: a dict of forms by key, a list of one form, a tuple of forms, or a function."""
    if isinstance(form, dict):
        if not isinstance(value, dict) or value.keys() != form.keys():
            raise ForeignAnswerError(f"{where} has other entries than {', '.join(form)}")
        return {
            key: _require_form(value[key], inner, f"{where}: {key}") for key, inner in form.items()
        }
    if isinstance(form, list | tuple):
        if not isinstance(value, list) or (isinstance(form, tuple) and len(value) != len(form)):
            raise ForeignAnswerError(f"{where} is no list of its length")
        forms = form if isinstance(form, tuple) else form * len(value)
        return [
            _require_form(inner, kind, f"{where}[{n}]")
            for n, (inner, kind) in enumerate(zip(value, forms, strict=True))
        ]
    checked: Callable[[Any, str], Any] = form
    return checked(value, where)


TEXTS = (
    *(
        "ModelName",
        "ModelVersion",
        "ModelDescription",
        "GeneralInformation",
        "ModelCreated",
        "ModelCreator",
    ),
    *(
        "ModelLastModifiedDate",
        "ModelLastModifiedBy",
        "ModelModifiedComment",
        "ModelModifiedHistory",
    ),
)
"""Names of the texts that every DLL has."""

_SIGNAL = {"name": _name, "description": _text, "unit": _text, "data_type": _whole, "width": _whole}
_PARAMETER = {
    **{"name": _name, "group": _text, "description": _text, "unit": _text},
    **{
        "data_type": _whole,
        "fixed": _flag,
        "default": _default,
        "minimum": _bound,
        "maximum": _bound,
    },
}
_ANSWER = {
    "interface": {
        "texts": dict.fromkeys(TEXTS, _text),
        "interface_version": (_place,) * 4,
        **{"sample_time": _number, "mode": _whole},
        **{"inputs": [_SIGNAL], "outputs": [_SIGNAL], "parameters": [_PARAMETER]},
        **{"states": (_whole,) * 3, "calls": [_text]},
    },
    "trial": {
        **{"state": _state, "doubles": [_place], "floats": [_place], "regions": [(_place, _place)]},
        **{"why": _text, "passing": _flag},
    },
}
_ERROR = {"error": _text}


def checked_interface(value: Any) -> dict[str, Any]:
    """A DLL's declarations as JSON, where they have the form in which the process that reads a DLL gives them."""
    found: dict[str, Any] = _require_form(value, _ANSWER["interface"], "the answer")
    return found
