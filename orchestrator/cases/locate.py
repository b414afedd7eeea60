"""Where in a TOML file a key stands, so that an error can name the line."""

import re
from collections.abc import Sequence
from functools import lru_cache

_HEADER = re.compile(r"^\s*(\[\[?)\s*([^\]]+?)\s*\]\]?\s*(#.*)?$")
_KEY = re.compile(r"^\s*((?:[A-Za-z0-9_-]+|\"[^\"]*\"|'[^']*')(?:\s*\.\s*(?:[A-Za-z0-9_-]+|\"[^\"]*\"|'[^']*'))*)\s*=")
_PART = re.compile(r"\"([^\"]*)\"|'([^']*)'|([A-Za-z0-9_-]+)")


def line_of(text: str, path: Sequence[str | int]) -> int | None:
    """Line number of the longest part of a key path that has a line of its own; None if none has."""
    wanted = tuple(str(p) for p in path)
    best, best_length = None, 0
    for number, key in _keys(text):
        if len(key) > best_length and wanted[: len(key)] == key:
            best, best_length = number, len(key)
    return best


@lru_cache(maxsize=8)
def _keys(text: str) -> tuple[tuple[int, tuple[str, ...]], ...]:
    found: list[tuple[int, tuple[str, ...]]] = []
    table: tuple[str, ...] = ()
    counts: dict[tuple[str, ...], int] = {}
    for number, line in enumerate(text.splitlines(), start=1):
        if header := _HEADER.match(line):
            table = _parts(header.group(2))
            if header.group(1) == "[[":
                index = counts.get(table, 0)
                counts[table] = index + 1
                table = (*table, str(index))
            found.append((number, table))
        elif key := _KEY.match(line):
            found.append((number, (*table, *_parts(key.group(1)))))
    return tuple(found)


def _parts(key: str) -> tuple[str, ...]:
    return tuple(next(part for part in match if part) for match in _PART.findall(key) if any(match))


def place_in(text: str, path: Sequence[str | int]) -> str:
    """A key path as text, with its line in the file."""
    label = ".".join(f'"{p}"' if "." in str(p) else str(p) for p in path)
    line = line_of(text, path)
    return f"line {line}, {label}" if line and label else label
