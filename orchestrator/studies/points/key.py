"""A hash over everything that the result of a point depends on, which names the point's file; and the hash by which a
worker refuses a changed case or changed code."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache
from typing import Any

from orchestrator.cases.case import BUILT_IN, Case, load_case
from orchestrator.cases.form.definition import CaseDefinition
from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.core.errors import InputError
from orchestrator.core.file_hashes import remembered_sha256
from orchestrator.devices.fmi.converted_component import ConvertedDescription, native
from orchestrator.devices.fmi.description import FmuDescription
from orchestrator.devices.fmi.port_mapping import BoundDescription
from orchestrator.studies.points.code import code_hash, numbers_hash
from orchestrator.systems.coupling.imperfections import described


def digest(content: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:32]


def key_of(content: Mapping[str, Any], *modules: str) -> str:
    """Name of a point whose result depends on the content [JSON's types], and on what modules compute."""
    return digest({**content, "code": numbers_hash(*modules)})


def scenario_content(prepared: PreparedScenario) -> dict[str, Any]:
    fmus = {
        name: component_content(plan.description)
        for name, plan in prepared.system.components.items()
    }
    wires = described(prepared.system.wires)
    return {"scenario": prepared.name, "fmus": fmus, "values": prepared.values} | (
        {"wires": wires} if wires else {}
    )


def component_content(description: FmuDescription) -> list[str]:
    """Return the part of a key for an FMU: a hash of its file, because a vendor may keep the guid of an older file, and
    the effect of its binding and of its connections' conversions."""
    own = native(description)
    port = repr(own.port) if isinstance(own, BoundDescription) else ""
    ways = repr(description.conversions) if isinstance(description, ConvertedDescription) else ""
    return [remembered_sha256(description.path), port + ways]


def fingerprint(case: CaseDefinition) -> str:
    """Two hashes: of this package's code and the libraries' versions, and of the texts of the case and its parameter
    files."""
    files = [
        f"{name}\0{file if isinstance(file, str) else file.text}"
        for name, file in case.parameter_files.items()
    ]
    texts = "\0".join([case.text, *files])
    return f"{code_hash()[:32]}-{hashlib.sha256(texts.encode()).hexdigest()[:32]}"


def reference_to(case: CaseDefinition) -> str:
    """Name by which any worker finds a case: of a built-in one, or the path of a file that all can read."""
    path = (case.home / case.path.name).resolve()
    return path.parent.name if path.parent.parent == BUILT_IN.resolve() else str(path)


@lru_cache(maxsize=8)
def same_case(
    reference: str,
    wanted: str,
    trust_fmus: bool = False,
    varied: frozenset[str] = frozenset(),
    line_ends: frozenset[str] = frozenset(),
) -> Case:
    """The case of a task, as a worker sees it."""
    case = load_case(reference, trust_fmus=trust_fmus)
    here = fingerprint(case)
    if here.partition("-")[0] != wanted.partition("-")[0]:
        raise InputError(
            f"{case.source}: a worker has other code of gfor-cosim or of its libraries than the study was "
            "started with; give all machines the same versions, and restart the workers"
        )
    if here != wanted:
        own = [
            str(file.path) for file in case.parameter_files.values() if not isinstance(file, str)
        ]
        which = f", or one of its parameter files ({', '.join(own)})" if own else ""
        raise InputError(
            f"{case.source}: this file{which} has another text now than when the study loaded it; load the case again, "
            "and on a cluster give all machines the same files"
        )
    return replace(case, varied=varied, line_ends=line_ends) if varied | line_ends else case
