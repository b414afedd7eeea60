"""Notes in the cache: what was found by building a model, so that the next run need not build it to know the same.

The name of a note is a hash of all that the finding follows from: what was asked, this machine, the versions of
`_LIBRARIES`, and the code of the packages of `_OWN`, which import nothing else of ours. A note whose SHA-256 is not
right is found anew."""

import hashlib
import json
import os
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
_COMPILED = "__pycache__"
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
        if _is_as_loaded():
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
    return {name: Path(place) for name, place in sorted(_places().items())}


def _places() -> dict[str, str]:
    """Where the files of `code_files` are; texts, since hundreds of paths take longer than to look at the files."""
    specs = [find_spec(name) for name in _OWN]
    roots = [
        os.path.normpath(place)
        for spec in specs
        if spec is not None
        for place in spec.submodule_search_locations or ()
    ]
    found: dict[str, str] = {}
    for root in roots:
        for folder, inside, names in os.walk(root):
            if _COMPILED in inside:
                inside.remove(_COMPILED)
            package = os.path.relpath(folder, os.path.dirname(root)).replace(os.sep, "/")
            counted = [name for name in names if os.path.splitext(name)[1] in _ENDINGS]
            found |= {f"{package}/{name}": f"{folder}{os.sep}{name}" for name in counted}
    return found


def _code_now() -> str:
    hasher = hashlib.sha256()
    for name, file in code_files().items():
        hasher.update(name.encode() + b"\0" + hashlib.sha256(file.read_bytes()).digest())
    return hasher.hexdigest()


@cache
def _code_loaded() -> str:
    return _code_now()


def _touched() -> dict[str, tuple[int, int, int, int]]:
    """Inode, size and times of the last changes of each file: a fifth of the time of reading them all."""
    seen = {name: os.stat(place) for name, place in _places().items()}
    return {name: (x.st_ino, x.st_size, x.st_mtime_ns, x.st_ctime_ns) for name, x in seen.items()}


def _is_as_loaded() -> bool:
    """Tell if the code was not changed between its import and now."""
    return _touched() == _touched_at_import or _code_now() == _code_loaded()


_touched_at_import = _touched()  # before the code is read, so that a later change differs
_code_loaded()
