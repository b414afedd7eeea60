"""Files that a case, an option or a caller names: they may be anybody's, so they are looked at before they are read.

A named pipe has no end to wait for and a device no end to read; a text is expected to have a size that can be read;
and some characters of a text steer the terminal that shows it."""

import os
import re
import stat
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from orchestrator.core.errors import InputError

MOST_TEXT = 256 * 1024**2  # bytes of a text: a RAW file of 100,000 buses has 50 MB
MOST_BYTES = 8 * 1024**3  # of any other file: recordings and archives

_KINDS = (
    (stat.S_ISFIFO, "a named pipe"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
    (stat.S_ISSOCK, "a socket"),
)

_NOT_UTF_8 = re.compile("[\udc80-\udcff]")
"""What Python makes of a byte of a name that is no UTF-8."""

_STEERING = re.compile("[\x01-\x08\x0e-\x19\x1b\x7f-\x84\x86-\x9f\u202a-\u202e\u2066-\u2069]")
"""Begin a command to a terminal, or turn the direction of writing; tabs, ends of lines and DOS's end of file do not."""


_BREAKING = re.compile("[\t-\r\x1a\x1c-\x1e\x85\u2028\u2029]")
"""End a line or move in it; a name needs none of them."""


def check_regular(path: Path | str, label: str = "") -> None:
    """Raise an `InputError` if something is there that is neither a file nor a folder; what is absent passes.

    ``label``: the option or key that names it."""
    try:
        mode = os.stat(path).st_mode
    except (OSError, ValueError):
        return
    kind = next((word for is_one, word in _KINDS if is_one(mode)), "")
    if kind:
        raise InputError.at(
            _labelled(label, path),
            f"it is {kind}, and no file; write its content into a file, and give that",
        )


def _labelled(label: str, path: Path | str) -> str:
    return label + f" {path}" if label else str(path)


def check_name(path: Path | str, label: str = "") -> None:
    """Raise an `InputError` if a name has bytes that are no UTF-8: neither XML nor JSON can hold it."""
    text = str(path)
    found = _NOT_UTF_8.search(text)
    if found:
        byte = ord(found.group()) - 0xDC00
        shown = text.encode("utf-8", "surrogateescape").decode("utf-8", "backslashreplace")
        raise InputError.at(
            _labelled(label, shown),
            f"its name has the byte {byte:#04x}, which is no UTF-8, and neither manifests nor FMUs "
            "can name it; rename the file or the folder",
        )


def read_bytes(path: Path, most: int = MOST_BYTES) -> bytes:
    """All of a regular file.

    Raises an `InputError` if it is none, or has more than ``most`` bytes; an `OSError` as `Path.read_bytes` does."""
    check_regular(path)
    size = path.stat().st_size
    if size > most:
        raise InputError.at(
            f"{path}", f"it has {size} bytes; at most {most} are read, so cut it into parts"
        )
    with path.open("rb") as file:
        content = file.read(most + 1)
    if len(content) > most:
        raise InputError.at(
            f"{path}", f"it gave more than the {size} bytes that it has; at most {most} are read"
        )
    return content


def read_text(
    path: Path, most: int = MOST_TEXT, encoding: str = "utf-8", errors: str = "strict"
) -> str:
    r"""The text of a regular file, with the ends of its lines as "\n"; see `read_bytes`."""
    text = read_bytes(path, most).decode(encoding, errors)
    return text.replace("\r\n", "\n").replace("\r", "\n")


def visible(text: str) -> str:
    r"""A text in which characters that steer a terminal are written out, such as ``\x1b``."""
    return _STEERING.sub(lambda found: repr(found.group())[1:-1], text)


def one_line(text: str) -> str:
    r"""A name or a title in which also tabs and ends of lines are written out, such as ``\n``: no line is forged."""
    return _BREAKING.sub(lambda found: repr(found.group())[1:-1], visible(text))


def steering_in(value: Any, *place: Any) -> Iterator[tuple[tuple[Any, ...], str]]:
    """Where a table of texts holds characters that steer a terminal, and the first of each text."""
    if isinstance(value, str):
        found = _STEERING.search(value)
        if found:
            yield place, found.group()
    elif isinstance(value, dict):
        for key, inner in value.items():
            found = _STEERING.search(key)
            if found:
                yield (*place, key), found.group()
            yield from steering_in(inner, *place, key)
    elif isinstance(value, list):
        for number, inner in enumerate(value):
            yield from steering_in(inner, *place, number)


def cleaned(value: Any) -> Any:
    """The same table without characters that steer a terminal."""
    if isinstance(value, str):
        return _STEERING.sub("", value)
    if isinstance(value, dict):
        return {cleaned(key): cleaned(inner) for key, inner in value.items()}
    return [cleaned(inner) for inner in value] if isinstance(value, list) else value


def why_refused(character: str) -> str:
    return (
        f"the text holds the character {character!r}, which steers the terminal or browser that shows it; "
        "write the text without it"
    )


def may_steer(text: str) -> bool:
    """Return whether a text in TOML has such a character, or an escape that may give one."""
    return bool(_STEERING.search(text)) or "\\" in text
