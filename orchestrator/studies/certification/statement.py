"""The in-toto statement that is signed of a certificate: it says its files' hashes, figures and verdicts."""

import hashlib
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from orchestrator.core.file_hashes import sha256_of
from orchestrator.devices.fmi.archive import names_in, read_member
from orchestrator.studies.certification.case_file import FMU
from orchestrator.studies.certification.compared import Content
from orchestrator.studies.certification.environment import CODE
from orchestrator.studies.certification.files import JSON, is_own_file

STATEMENT = "https://in-toto.io/Statement/v1"
CERTIFICATE = "tag:gfor-cosim,2026:certificate/v1"
"""What the predicate is; with other entries it gets another version."""

_LIBRARIES = (".dll", ".so", ".dylib")
_ELSEWHERE = ("files", "seal", "acceptance")
"""Entries of a certificate that are no part of the predicate: hashes are subjects, the checks' report is a file."""


def statement_of(folder: Path, content: Content) -> dict[str, Any]:
    """Return the statement on a certificate as its folder has it."""
    acceptance = content["acceptance"]
    predicate = {key: value for key, value in content.items() if key not in _ELSEWHERE}
    predicate["acceptance"] = None if acceptance is None else _accepted(acceptance)
    return as_statement(_digests(folder, content), CERTIFICATE, predicate)


def as_statement(
    digests: Mapping[str, str | None], kind: str, predicate: Mapping[str, Any]
) -> dict[str, Any]:
    """Return an in-toto statement on files and what belongs to them, by name."""
    subjects = [{"name": name, "digest": {"sha256": of}} for name, of in digests.items()]
    return {
        "_type": STATEMENT,
        "subject": subjects,
        "predicateType": kind,
        "predicate": dict(predicate),
    }


def _accepted(acceptance: Mapping[str, Any]) -> dict[str, Any]:
    checks = [(one["check"], one["verdict"], one["fault"]) for one in acceptance["checks"]]
    named = [{"check": name, "verdict": said, "fault": fault} for name, said, fault in checks]
    return {"trusted": acceptance["trusted"], "checks": named}


def as_bytes(statement: Mapping[str, Any]) -> bytes:
    text = json.dumps(statement, sort_keys=True, separators=(",", ":"), ensure_ascii=False)
    return text.encode()


def _digests(folder: Path, content: Content) -> dict[str, str | None]:
    """Hashes of the record, of its files, of the libraries in the FMU, of the code and of the environment."""
    environment = dict(content.get("environment") or {})
    return {
        **{name: _digest(folder / name) for name in (JSON, *content["files"])},
        **dict(libraries_in(folder / FMU)),
        "environment": hashlib.sha256(as_bytes(environment)).hexdigest(),
        **({"code of gfor-cosim": environment[CODE]} if CODE in environment else {}),
    }


def _digest(path: Path) -> str | None:
    return sha256_of(path) if is_own_file(path) else None


def libraries_in(fmu: Path) -> Iterator[tuple[str, str]]:
    """The hash of each library in an FMU, as whoever made a DLL knows it."""
    if not is_own_file(fmu):
        return
    for name in sorted(set(names_in(fmu, with_backslashes=True))):
        content = read_member(fmu, name) if name.lower().endswith(_LIBRARIES) else None
        if content is not None:
            yield f"{fmu.name}!/{name}", hashlib.sha256(content).hexdigest()


def differences_of(signed: Mapping[str, Any], folder: Path, content: Content) -> list[str]:
    """Say what a signed statement says otherwise than the folder; nothing where they are the same."""
    here = statement_of(folder, content)
    if signed == here:
        return []
    of_signed, of_here = _subjects(signed), _subjects(here)
    if FMU not in of_signed:
        return [
            f"it is no signature of a certificate: it is one of {', '.join(of_signed) or 'nothing'}"
        ]
    if of_signed[FMU] != of_here[FMU]:
        return [
            f"it is the signature of another certificate: of an FMU with the SHA-256 {of_signed[FMU]}, and that "
            f"of {FMU} is {of_here[FMU]}"
        ]
    names = [name for name in {**of_here, **of_signed} if of_signed.get(name) != of_here.get(name)]
    if names:
        return [f"changed since it was signed: {', '.join(names)}"]
    return [
        "the signed statement says otherwise than the certificate, though every hash is the same"
    ]


def _subjects(statement: Mapping[str, Any]) -> dict[str, Any]:
    try:
        return {one["name"]: one["digest"]["sha256"] for one in statement["subject"]}
    except (KeyError, TypeError):
        return {}
