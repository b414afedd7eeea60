"""Questions that a command has shown about a case file: of an unchanged file the next one says only how many."""

import hashlib
import json
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from fmus.toolchain.cache import CacheError, cache_directory, intact, keep
from orchestrator.core.errors import InputError
from orchestrator.core.foreign_files import read_bytes


def new_questions(file: Path, asked: Sequence[str]) -> list[str]:
    """Return the questions that no command has shown about a file as it is now, and keep that they are known.

    All of them if the file cannot be read, or the cache cannot be used."""
    try:
        path = file.resolve()
        changed, content = path.stat().st_mtime_ns, read_bytes(path)
    except (InputError, OSError):
        return [*asked]
    try:
        mark = cache_directory("questions") / f"{_hash(f'{path} {changed}', content)}.json"
        known = set(json.loads(read_bytes(mark))) if intact(mark) else set[str]()
    except (CacheError, OSError):
        return [*asked]
    found = [text for text in asked if _hash(text) not in known]
    if found:
        with suppress(CacheError):
            keep(mark, json.dumps(sorted(known | {_hash(text) for text in found})).encode())
    return found


def _hash(text: str, content: bytes = b"") -> str:
    return hashlib.sha256(text.encode() + b"\n" + content).hexdigest()[:32]
