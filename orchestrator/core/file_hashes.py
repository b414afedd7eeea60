"""Hashes of files."""

import hashlib
from functools import lru_cache
from pathlib import Path

from orchestrator.core.foreign_files import check_regular


def sha256_of(path: Path) -> str:
    """SHA-256 of a regular file as it is now."""
    check_regular(path)
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def remembered_sha256(path: Path) -> str:
    """SHA-256 of a file that others are not suspected to change: read once as long as its time and size stay."""
    check_regular(path)
    status = path.stat()
    return _hash_at(path, status.st_mtime_ns, status.st_size)


@lru_cache(maxsize=1024)
def _hash_at(path: Path, mtime_ns: int, size: int) -> str:
    """SHA-256 of a file; the time of its last change keeps the cache from giving an older file's hash."""
    return sha256_of(path)
