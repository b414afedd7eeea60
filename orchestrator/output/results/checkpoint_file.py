"""A checkpoint on disk: arrays and a header behind a checksum, whole or not there at all."""

import hashlib
import io
import json
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestrator.core.errors import CosimError
from orchestrator.core.safe_files import replacing

Arrays = Mapping[str, NDArray[Any]]

CHECKPOINTS = ".checkpoints"  # folder for them among the results of a run
CHECKPOINT = ".checkpoint"  # end of the newest one's name
PREVIOUS = ".previous"  # end of the name of the one before it
_MARK = b"gfor-cosim checkpoint 1\n"
_DIGEST = hashlib.sha256().digest_size
_HEADER = "header"


class DamagedCheckpointError(CosimError):
    """A file is no checkpoint, or not the one that was written."""


def write_checkpoint(path: Path, header: Mapping[str, Any], arrays: Arrays) -> None:
    """Write a checkpoint; the one that was there stays as ``.previous``, and a loss of power leaves one of both."""
    text = np.frombuffer(json.dumps(header).encode(), dtype=np.uint8)
    content = io.BytesIO()
    np.savez(content, allow_pickle=False, **{_HEADER: text}, **arrays)
    body = content.getbuffer()
    with replacing(path) as partial:
        with partial.open("wb") as file:
            file.write(_MARK + hashlib.sha256(body).digest())
            file.write(body)
        if path.exists():
            path.replace(previous(path))


def previous(path: Path) -> Path:
    return path.with_suffix(PREVIOUS)


def read_checkpoint(path: Path) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    content = path.read_bytes()
    body = content[len(_MARK) + _DIGEST :]
    if not content.startswith(_MARK):
        raise DamagedCheckpointError(f"{path}: it does not begin as a checkpoint does")
    if hashlib.sha256(body).digest() != content[len(_MARK) : len(_MARK) + _DIGEST]:
        raise DamagedCheckpointError(f"{path}: its checksum does not fit what it holds")
    try:
        with np.load(io.BytesIO(body), allow_pickle=False) as data:
            arrays = {name: data[name] for name in data}
        header = json.loads(arrays.pop(_HEADER).tobytes())
        if not isinstance(header, dict) or not isinstance(header.get("mark", {}), dict):
            raise ValueError("its header is no table of names and values")
        return header, arrays
    except (
        EOFError,
        ValueError,
        KeyError,
        RecursionError,
        zipfile.BadZipFile,
        zlib.error,
    ) as error:
        raise DamagedCheckpointError(f"{path}: {error}") from error
