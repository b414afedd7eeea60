"""Notes in the cache: what was found by building a model, so that the next run need not build it to know the same.

The name of a note is a hash of all that the finding follows from: what was asked, this machine, the versions of
`_LIBRARIES`, and the code of the packages of `_OWN`, which import nothing else of ours. A note whose SHA-256 is not
right is found anew."""

import hashlib
import json
import platform
import sys
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from importlib.metadata import EntryPoint
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from fmus.toolchain.cache import CacheError, cache_directory, intact, keep, key_of
from fmus.toolchain.extras import installed_version

_OWN = ("fmus", "gfor_fmu")
_ENDINGS = {".py", ".c", ".h", ".toml"}
_LIBRARIES = ("gfor-cosim", "numpy", "pythonfmu", "scipy", "ziglang")


def noted(entry: EntryPoint, asked: str, find: Callable[[], Any]) -> Any:
    """The cached note; computed and cached if missing.

    ``entry``: The catalogue's entry of the model. Of a model from another distribution nothing is noted, since nobody
    knows what its code imports.
    ``find``: Finds it [JSON's types]."""
    path = note_of(entry, asked)
    if path is None:
        return find()
    if intact(path):
        return json.loads(path.read_bytes())
    found = find()
    with suppress(CacheError):  # as slow as before, but right
        if (
            _code_now() == _code_loaded()
        ):  # else the code may have been changed between its import and now
            keep(path, json.dumps(found).encode())
    return found


def known(entry: EntryPoint, asked: str) -> Any | None:
    """The cached note; None without one."""
    path = note_of(entry, asked)
    return json.loads(path.read_bytes()) if path is not None and intact(path) else None


def note_of(entry: EntryPoint, asked: str) -> Path | None:
    """Path of a note, whether it is there or not; None for a model of another distribution."""
    if entry.module.partition(".")[0] not in _OWN:
        return None
    parts = [
        entry.value,
        asked,
        _code_loaded(),
        *machine(),
        *(f"{name} {installed_version(name)}" for name in _LIBRARIES),
    ]
    return cache_directory("notes") / f"{key_of(json.dumps(parts))}.json"


def machine() -> tuple[str, ...]:
    return (sys.platform, platform.machine(), sys.version)


def code_files() -> dict[str, Path]:
    """Files of the models and of the toolchain, C included, by their names from the package on, sorted."""
    specs = [find_spec(name) for name in _OWN]
    roots = [
        Path(place)
        for spec in specs
        if spec is not None
        for place in spec.submodule_search_locations or ()
    ]
    files = [(root, file) for root in roots for file in root.rglob("*") if file.suffix in _ENDINGS]
    return dict(sorted((file.relative_to(root.parent).as_posix(), file) for root, file in files))


def _code_now() -> str:
    hasher = hashlib.sha256()
    for name, file in code_files().items():
        hasher.update(name.encode() + b"\0" + hashlib.sha256(file.read_bytes()).digest())
    return hasher.hexdigest()


@cache
def _code_loaded() -> str:
    return _code_now()


_code_loaded()
