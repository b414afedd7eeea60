"""What the command line says of itself in the manifests of results."""

import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

WRITTEN = ("out", "into", "html", "save", "scan", "junit")  # options that name what is written
# endings of what is written beside a file
_BESIDE = {".toml": (".csv", ".json"), ".cfg": (".dat",)}

said: list[Callable[[], dict[str, Any]]] = []
"""The ``command`` in force, its ``directory``, hashes of ``code`` and ``inputs``; from Python without a command."""


def as_typed() -> str:
    return str(said[-1]()["command"])


def written(options: Mapping[str, Any]) -> Iterator[Path]:
    """Files that options name to be written, with those that are put beside them."""
    for path in (options[name] for name in WRITTEN if isinstance(options.get(name), Path)):
        yield from (path, *(path.with_suffix(end) for end in _BESIDE.get(path.suffix, ())))


def files_read(options: Mapping[str, Any]) -> dict[str, Path]:
    """Files that options name to be read, and those that the TOML files among them name."""
    found = {}
    given = (value for name, value in options.items() if name not in WRITTEN)
    for text in (
        str(one) for value in given for one in (value if isinstance(value, list) else [value])
    ):
        for path in (Path(text), Path(text.rpartition("=")[2])):
            with suppress(OSError, ValueError):
                if path.is_file():
                    found[str(path)] = path
                    if path.suffix == ".toml":
                        found |= files_named(
                            path.read_text(encoding="utf-8", errors="replace"), path.parent
                        )
    return found


def files_named(text: str, home: Path) -> dict[str, Path]:
    """Files that a text names in quotes, as a case does."""
    found = {}
    for name in re.findall(r"""["']([^"'\n]{1,200})["']""", text):
        with suppress(OSError, ValueError):
            if (path := home / name).is_file():
                found[name] = path
    return found
