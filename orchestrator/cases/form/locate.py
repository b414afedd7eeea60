"""The line of a key in a TOML file, for errors."""

import re
import tomllib
from collections.abc import Sequence
from functools import lru_cache

_HEADER = re.compile(r"^\s*(\[\[?)\s*([^\]]+?)\s*\]\]?\s*(#.*)?$")
_KEY = re.compile(
    r"^\s*((?:[A-Za-z0-9_-]+|\"[^\"]*\"|'[^']*')(?:\s*\.\s*(?:[A-Za-z0-9_-]+|\"[^\"]*\"|'[^']*'))*)\s*="
)
_PART = re.compile(r"(\"(?:[^\"\\]|\\.)*\")|'([^']*)'|([A-Za-z0-9_-]+)")

FROM_TABLES = "# From tables of a program: none of these lines is anybody's\n"
FROM_TEXT = "# The folder, then the text as it was given\n"


def line_of(text: str, path: Sequence[str | int]) -> int | None:
    """Line number of the longest part of a key path that has a line of its own; None if none has."""
    if text.startswith(FROM_TABLES):
        return None
    wanted, lines = tuple(str(p) for p in path), _lines(text)
    return next((lines[wanted[:n]] for n in range(len(wanted), 0, -1) if wanted[:n] in lines), None)


@lru_cache(maxsize=8)
def _lines(text: str) -> dict[tuple[str, ...], int]:
    """Key path → line on which it first stands."""
    lines: dict[tuple[str, ...], int] = {}
    table: tuple[str, ...] = ()
    counts: dict[tuple[str, ...], int] = {}
    for number, line in enumerate(text.splitlines(), start=-1 if text.startswith(FROM_TEXT) else 1):
        header = _HEADER.match(line)
        if header:
            table = _parts(header.group(2))
            if header.group(1) == "[[":
                index = counts.get(table, 0)
                counts[table] = index + 1
                table = (*table, str(index))
            lines.setdefault(table, number)
        elif key := _KEY.match(line):
            lines.setdefault((*table, *_parts(key.group(1))), number)
    return lines


def _parts(key: str) -> tuple[str, ...]:
    return tuple(
        _unquoted(quoted) or literal or bare for quoted, literal, bare in _PART.findall(key)
    )


def _unquoted(text: str) -> str:
    """A key in double quotes without them, its escapes resolved; the text itself where that cannot be done."""
    try:
        return str(tomllib.loads(f"key = {text}")["key"]) if text else ""
    except ValueError:
        return text


def place_in(text: str, path: Sequence[str | int]) -> str:
    label = ".".join(_quoted(str(part)) for part in path)
    line = line_of(text, path)
    return f"line {line}, {label}" if line and label else label


def _quoted(part: str) -> str:
    """A part of a key path that can be printed and told from the others."""
    if not part.isprintable():
        return repr(part)
    return f'"{part}"' if "." in part else part
