"""Where built kernels and FMUs are kept between runs, and how a kept file is checked before it is used again.

Beside every kept file lies a list of SHA-256: one line for each content that gfor wrote there. A file that is not on
its list, because a disk, a crash or a person changed it, is built again; it is never run. A writer adds its line before
it puts the file in place, so a reader finds a listed content at any moment, whoever else writes."""

import hashlib
import logging
import os
import sys
import uuid
from pathlib import Path

from fmus.toolchain.extras import SetupError

_LOG = logging.getLogger("gfor")
_HASH = ".sha256"
_LONGEST_LIST = 4096
"""Bytes of a list of SHA-256, about 60 lines; a longer one, of a file written again and again, begins anew."""
_checked: dict[Path, tuple[int, int, int]] = {}
"""Files found intact in this process: inode, size and time of the last change."""


_KEY_DIGITS = 32  # of a SHA-256: 128 bits, so that no two contents meet


class CacheError(SetupError):
    """The cache cannot be written."""


def cache_directory(kind: str) -> Path:
    """Folder for one kind of built file; ``GFOR_COSIM_CACHE`` overrides its parent.

    Contents are named by a hash of what they were made from (`key_of`, `key_of_digest`): deleting the folder is always
    safe."""
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


def key_of(*texts: str) -> str:
    """Name of what is made of these texts, such as a library of its source, its target and the compiler."""
    return key_of_digest(hashlib.sha256("\0".join(texts).encode()).hexdigest())


def key_of_digest(digest: str) -> str:
    """Name of what has a hash already, such as an FMU, by all that it is made from (`exporter.Recipe.digest`)."""
    return digest[:_KEY_DIGITS]


def intact(path: Path) -> bool:
    """Return whether a kept file is there, byte for byte as it was written.

    A file that is there and differs is named in one line of the log, which goes to standard error."""
    try:
        seen = path.stat()
        mark = (seen.st_ino, seen.st_size, seen.st_mtime_ns)
        if _checked.get(path) == mark:
            return True
        found = hashlib.sha256(path.read_bytes()).hexdigest()
        listed = _hash_file(path).read_bytes().split() if _hash_file(path).exists() else None
    except (FileNotFoundError, NotADirectoryError):
        return False
    except OSError as error:
        _LOG.warning("cache: %s cannot be read (%s); it is built again", path, error)
        return False
    if listed is None or found.encode() not in listed:
        why = (
            "has no SHA-256 beside it"
            if listed is None
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
        _put_in_place(path, content)
    except OSError as error:
        raise CacheError(
            f"the cache cannot be written: {path}: {error.strerror or error}; FMUs and libraries are built there once "
            "and used again, so make it writable, free space, or set GFOR_COSIM_CACHE to another folder"
        ) from error
    _checked.pop(path, None)
    return path


def _hash_file(path: Path) -> Path:
    return path.with_name(path.name + _HASH)


def _put_in_place(path: Path, content: bytes) -> None:
    partial = path.with_name(f"{path.name}.{uuid.uuid4().hex}.part")
    try:
        partial.write_bytes(content)
        partial.chmod(0o755)
        _list_hash(_hash_file(path), hashlib.sha256(content).hexdigest())
        partial.replace(path)
    except OSError:
        partial.unlink(missing_ok=True)
        raise


def _list_hash(path: Path, digest: str) -> None:
    """Add a SHA-256 to the list beside a file; the list is appended to, so that no writer loses another's line."""
    line = f"\n{digest}\n".encode()  # the first line break ends a line that a crash cut
    if path.exists() and path.stat().st_size > _LONGEST_LIST:
        shorter = path.with_name(f"{path.name}.{uuid.uuid4().hex}.part")
        shorter.write_bytes(path.read_bytes()[-len(line) :] + line)  # the last one is in place now
        shorter.replace(path)
        return
    with path.open("ab") as hashes:
        hashes.write(line)


def _home() -> Path:
    try:
        return Path.home()
    except RuntimeError as error:
        raise CacheError(
            f"there is no home folder for the cache ({error}); set GFOR_COSIM_CACHE to a folder"
        ) from error
