"""Origin of results, as the command line gives it for the manifests of results."""

import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from orchestrator.core.foreign_files import check_name, check_regular, read_text

WRITTEN = ("out", "into", "html", "save", "scan", "junit")  # options that name what is written
_SECRET = ("sign",)  # options that name a private key, of which no record is kept
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


def check_named(options: Mapping[str, Any]) -> None:
    """Raise an `InputError` if an option names what is neither a file nor a folder, as a named pipe, or a name that no
    file of ours could hold."""
    check_name(Path.cwd(), "the folder")
    for value in options.values():
        for text in value if isinstance(value, list | tuple) else [value]:
            check_name(str(text))
    for text in _texts(options):
        for name in dict.fromkeys((text, text.rpartition("=")[2])):
            check_regular(name)


def _texts(options: Mapping[str, Any]) -> Iterator[str]:
    """Values of the options that are read, as texts."""
    for name, value in options.items():
        if name not in WRITTEN:
            yield from map(str, value if isinstance(value, list | tuple) else [value])


def files_read(options: Mapping[str, Any]) -> dict[str, Path]:
    """Files that options name to be read, and those that the TOML files among them name."""
    found = {}
    for text in _texts({k: value for k, value in options.items() if k not in _SECRET}):
        for path in (Path(text), Path(text.rpartition("=")[2])):
            with suppress(OSError, ValueError):
                if path.is_file():
                    found[str(path)] = path
                    if path.suffix == ".toml":
                        found |= files_named(read_text(path, errors="replace"), path.parent)
    return found


def files_named(text: str, home: Path) -> dict[str, Path]:
    """Files that a text names in quotes, as a case does."""
    found = {}
    for name in re.findall(r"""["']([^"'\n]{1,200})["']""", text):
        with suppress(OSError, ValueError):
            path = home / name
            if path.is_file():
                found[name] = path
    return found
