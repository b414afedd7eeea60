"""A hash over everything that the result of a point depends on. It names the point's file, and a worker compares it to
refuse a changed case or changed code.
"""

import hashlib
import json
from collections.abc import Mapping
from functools import cache, lru_cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

from fmus.toolchain.extras import installed_version
from orchestrator.cases.case import BUILT_IN, Case, load_case
from orchestrator.cases.definition import CaseDefinition
from orchestrator.cases.prepare import PreparedScenario
from orchestrator.coupling.imperfections import described
from orchestrator.errors import InputError
from orchestrator.fmi.description import FmuDescription
from orchestrator.fmi.port import BoundDescription

_ROOT = Path(__file__).parents[1]
_SHOWING = ("acceptance", "api", "cli", "explore", "interop", "report")
"""Packages whose code does not change the result of any point; a test checks that the code of a point never imports
them."""


LIBRARIES = ("numpy", "scipy", "casadi")
"""What computes the figures beside this package's own code; another version may give others."""


def key_of(content: Mapping[str, Any]) -> str:
    """Name of a point whose result depends on the content [JSON's types], on this package's code and on `LIBRARIES`."""
    return hashlib.sha256(json.dumps({**content, "code": code_hash()}, sort_keys=True).encode()).hexdigest()[:32]


def scenario_content(prepared: PreparedScenario) -> dict[str, Any]:
    fmus = {name: component_content(plan.description) for name, plan in prepared.system.components.items()}
    wires = described(prepared.system.wires)
    return {"scenario": prepared.name, "fmus": fmus, "values": prepared.values} | ({"wires": wires} if wires else {})


def component_content(description: FmuDescription) -> list[str]:
    """What a key contains for an FMU: a hash of its file, because a vendor may keep the guid of an older file, and the
    effect of its binding.
    """
    status = description.path.stat()
    port = repr(description.port) if isinstance(description, BoundDescription) else ""
    return [_file_hash(description.path, status.st_mtime_ns, status.st_size), port]


def fingerprint(case: CaseDefinition) -> str:
    """Two hashes: of this package's code and the libraries' versions, and of the texts of the case and its parameter
    files.
    """
    files = [f"{name}\0{file if isinstance(file, str) else file.text}" for name, file in case.parameter_files.items()]
    texts = "\0".join([case.text, *files])
    return f"{code_hash()[:32]}-{hashlib.sha256(texts.encode()).hexdigest()[:32]}"


def reference_to(case: CaseDefinition) -> str:
    """Name by which any worker finds a case: of a built-in one, or the path of a file that all can read."""
    path = (case.home / case.path.name).resolve()
    return path.parent.name if path.parent.parent == BUILT_IN.resolve() else str(path)


@lru_cache(maxsize=8)
def same_case(reference: str, wanted: str, trust_fmus: bool = False) -> Case:
    """The case of a task, as a worker sees it.

    ``reference`` and ``wanted``: name or path of the case, and its fingerprint.
    """
    case = load_case(reference, trust_fmus=trust_fmus)
    here = fingerprint(case)
    if here.partition("-")[0] != wanted.partition("-")[0]:
        raise InputError(
            f"{case.path}: a worker has other code of gfor-cosim or of its libraries than the study was started with; "
            "give all machines the same versions, and restart the workers"
        )
    if here != wanted:
        own = [str(file.path) for file in case.parameter_files.values() if not isinstance(file, str)]
        which = f", or one of its parameter files ({', '.join(own)})" if own else ""
        raise InputError(
            f"{case.path}: this file{which} has another text now than when the study loaded it; load the case again, "
            "and on a cluster give all machines the same files"
        )
    return case


@lru_cache(maxsize=1024)
def _file_hash(path: Path, mtime_ns: int, size: int) -> str:
    """SHA-256 of a file as it is now; the time of its last change keeps the cache from giving an older file's hash."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


@cache
def library_versions() -> dict[str, str]:
    """Versions of `LIBRARIES`; empty text for one that is not installed."""
    return {library: installed_version(library) for library in LIBRARIES}


@cache
def code_hash() -> str:
    """Hash of the versions and of the code, C included, that a point's result depends on."""
    hasher = hashlib.sha256(f"{version('gfor-cosim')}\0{json.dumps(library_versions())}".encode())
    for file in code_files():
        hasher.update(file.relative_to(_ROOT).as_posix().encode() + b"\0" + file.read_bytes())
    return hasher.hexdigest()


def code_files() -> list[Path]:
    """Files of this package whose change makes all kept points worthless, sorted."""
    rooms = [path for path in _ROOT.iterdir() if path.is_dir() and path.name not in _SHOWING]
    files = [file for room in rooms for ending in ("py", "c", "h") for file in room.rglob(f"*.{ending}")]
    return sorted([*files, *_ROOT.glob("*.py")])


code_hash()  # now, so that it is the hash of what is loaded
