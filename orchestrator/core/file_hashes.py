"""Hashes of files, each read once as long as it does not change."""

import hashlib
from functools import lru_cache
from pathlib import Path

from orchestrator.core.foreign_files import check_regular


def sha256_of(path: Path) -> str:
    """SHA-256 of a regular file, read once as long as its time and size stay."""
    check_regular(path)
    status = path.stat()
    return _file_hash(path, status.st_mtime_ns, status.st_size)


@lru_cache(maxsize=1024)
def _file_hash(path: Path, mtime_ns: int, size: int) -> str:
    """SHA-256 of a file as it is now; the time of its last change keeps the cache from giving an older file's hash."""
    return hashlib.sha256(path.read_bytes()).hexdigest()
