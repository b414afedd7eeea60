"""What the result of a point depends on, as a hash: it names the point's file, and tells workers of one kind."""

import hashlib
import json
from collections.abc import Mapping
from functools import cache, lru_cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

from orchestrator.cases.case import BUILT_IN, Case, load_case
from orchestrator.cases.definition import CaseDefinition
from orchestrator.cases.prepare import PreparedScenario
from orchestrator.errors import InputError
from orchestrator.fmi.description import FmuDescription
from orchestrator.fmi.port import BoundDescription

_ROOT = Path(__file__).parents[1]
_SHOWING = ("acceptance", "api", "cli", "interop", "report")
"""Rooms whose code no point's result depends on; a test holds that no code of a point imports them."""


def key_of(content: Mapping[str, Any]) -> str:
    """Name of a point whose result depends on the content [JSON's types], and on this package's code."""
    return hashlib.sha256(json.dumps({**content, "code": _code()}, sort_keys=True).encode()).hexdigest()[:32]


def scenario_content(prepared: PreparedScenario) -> dict[str, Any]:
    """What a key is to hold of a scenario: its FMUs with their bindings, and all values."""
    fmus = {name: component_content(plan.description) for name, plan in prepared.system.components.items()}
    return {"scenario": prepared.name, "fmus": fmus, "values": prepared.values}


def component_content(description: FmuDescription) -> list[str]:
    """What a key is to hold of an FMU: its file, whose guid a vendor may have kept, and what a binding makes of it."""
    status = description.path.stat()
    port = repr(description.port) if isinstance(description, BoundDescription) else ""
    return [_file_hash(description.path, status.st_mtime_ns, status.st_size), port]


def fingerprint(case: CaseDefinition) -> str:
    """Hash of a case file's text and of this package's code."""
    return hashlib.sha256(f"{_code()}\0{case.text}".encode()).hexdigest()[:32]


def reference_to(case: CaseDefinition) -> str:
    """Name by which any worker finds a case: of a built-in one, or the path of a file that all can read."""
    path = case.path.resolve()
    return path.parent.name if path.parent.parent == BUILT_IN.resolve() else str(path)


@lru_cache(maxsize=8)
def same_case(reference: str, wanted: str) -> Case:
    """The case of a task, as a worker sees it.

    Raises
    ------
    InputError
        If its fingerprint is not the wanted one.
    """
    case = load_case(reference)
    if fingerprint(case) != wanted:
        raise InputError(
            f"{case.path}: a worker sees another text of this file, or has other code of gfor-cosim, than the study "
            "was started with; give all machines the same file and version, and restart the workers"
        )
    return case


@lru_cache(maxsize=1024)
def _file_hash(path: Path, mtime_ns: int, size: int) -> str:
    """Of a file as it is at that time."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


@cache
def _code() -> str:
    """Hash of the version and of the code, C included, that a point's result depends on."""
    hasher = hashlib.sha256(version("gfor-cosim").encode())
    for file in code_files():
        hasher.update(file.relative_to(_ROOT).as_posix().encode() + b"\0" + file.read_bytes())
    return hasher.hexdigest()


def code_files() -> list[Path]:
    """Files of this package whose change makes all kept points worthless, sorted."""
    rooms = [path for path in _ROOT.iterdir() if path.is_dir() and path.name not in _SHOWING]
    files = [file for room in rooms for ending in ("py", "c", "h") for file in room.rglob(f"*.{ending}")]
    return sorted([*files, *_ROOT.glob("*.py")])


_code()  # now, so that it is the hash of what is loaded
