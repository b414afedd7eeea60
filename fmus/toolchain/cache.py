"""Where built kernels and FMUs are kept between runs, and how a kept file is checked before it is used again.

Beside every kept file lies its SHA-256. A file that differs from it, because a disk, a crash or a person changed it, is
built again; it is never run."""

import hashlib
import logging
import os
import sys
import uuid
from pathlib import Path

from fmus.toolchain.extras import SetupError

_LOG = logging.getLogger("gfor")
_HASH = ".sha256"
_checked: dict[Path, tuple[int, int, int]] = {}
"""Files found intact in this process: inode, size and time of the last change."""


class CacheError(SetupError):
    """The cache cannot be written."""


def cache_directory(kind: str) -> Path:
    """Folder for one kind of built file; ``GFOR_COSIM_CACHE`` overrides its parent.

    Contents are named by a hash of what they were made from: deleting the folder is always safe."""
    root = os.environ.get("GFOR_COSIM_CACHE")
    if root:
        return Path(root) / kind
    if sys.platform == "win32":
        base = Path(os.environ.get("LOCALAPPDATA") or _home() / "AppData" / "Local")
    elif sys.platform == "darwin":
        base = _home() / "Library" / "Caches"
    else:
        base = Path(os.environ.get("XDG_CACHE_HOME") or _home() / ".cache")
    return base / "gfor-cosim" / kind


def intact(path: Path) -> bool:
    """Return whether a kept file is there, byte for byte as it was written.

    A file that is there and differs is named in one line of the log, which goes to standard error."""
    try:
        seen = path.stat()
        mark = (seen.st_ino, seen.st_size, seen.st_mtime_ns)
        if _checked.get(path) == mark:
            return True
        kept = (
            _hash_file(path).read_text(encoding="ascii").strip()
            if _hash_file(path).exists()
            else "missing"
        )
        found = hashlib.sha256(path.read_bytes()).hexdigest()
    except (FileNotFoundError, NotADirectoryError):
        return False
    except (OSError, UnicodeDecodeError) as error:
        _LOG.warning("cache: %s cannot be read (%s); it is built again", path, error)
        return False
    if found != kept:
        why = (
            "has no SHA-256 beside it"
            if kept == "missing"
            else "differs from the SHA-256 kept beside it"
        )
        _LOG.warning("cache: %s %s, so it may be damaged or altered; it is built again", path, why)
        return False
    _checked[path] = mark
    return True


def keep(path: Path, content: bytes) -> Path:
    """Write a file and its SHA-256 into the cache; others may be writing the same at the same time.

    ``path``: Below a `cache_directory`; its folder is created where missing."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        _write_whole(_hash_file(path), (hashlib.sha256(content).hexdigest() + "\n").encode())
        _write_whole(path, content)
    except OSError as error:
        raise CacheError(
            f"the cache cannot be written: {path}: {error.strerror or error}; FMUs and libraries are built there once "
            "and used again, so make it writable, free space, or set GFOR_COSIM_CACHE to another folder"
        ) from error
    _checked.pop(path, None)
    return path


def _hash_file(path: Path) -> Path:
    return path.with_name(path.name + _HASH)


def _write_whole(path: Path, content: bytes) -> None:
    partial = path.with_name(f"{path.name}.{uuid.uuid4().hex}.part")
    try:
        partial.write_bytes(content)
        partial.chmod(0o755)
        partial.replace(path)
    except OSError:
        partial.unlink(missing_ok=True)
        raise


def _home() -> Path:
    try:
        return Path.home()
    except RuntimeError as error:
        raise CacheError(
            f"there is no home folder for the cache ({error}); set GFOR_COSIM_CACHE to a folder"
        ) from error
