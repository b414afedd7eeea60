"""The signature of one file: an FMU or a DLL without a certificate, or a report."""

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from orchestrator.core.errors import FmuFileError
from orchestrator.core.foreign_files import read_bytes
from orchestrator.output.signatures.beside import Beside
from orchestrator.output.signatures.checking import SignatureSeen
from orchestrator.output.signatures.signing import Made
from orchestrator.studies.certification.files import JSON
from orchestrator.studies.certification.inside import holds_certificates
from orchestrator.studies.certification.signed import Asked, look_beside
from orchestrator.studies.certification.statement import as_bytes, as_statement, libraries_in

_FILE = "tag:gfor-cosim,2026:file/v1"
"""What the predicate is; with other entries it gets another version."""

_VERDICTS = ("tool", "trusted", "verdict", "passed", "sentence", "stable")
"""Entries of a report in JSON that the statement repeats, so that a reader of it alone sees them."""


def signatures_of_file(file: Path) -> Beside:
    """Where the signatures of a file lie."""
    return Beside(file.parent, file.name)


def is_signed_alone(path: Path) -> bool:
    """Return whether a signature of this very file lies beside it, and no certificate in it."""
    if path.name == JSON or not path.is_file() or not signatures_of_file(path).names():
        return False
    return path.suffix.lower() != ".fmu" or not holds_certificates(path)


def sign_file(file: Path, key: Path) -> Made:
    """Sign a file.

    Raises
    ------
    InputError
        If it or the key cannot be read, or what others have signed is another content."""
    return signatures_of_file(file).add(as_bytes(_statement_of(file)), key)


def look_at_file(file: Path, asked: Asked) -> SignatureSeen:
    """Say whether a file is signed, by whom, and whether it is what was signed."""

    def differences(signed: Mapping[str, Any]) -> Sequence[str]:
        if signed == _statement_of(file):
            return []
        return [f"{file.name}: it is not what was signed: it was changed since, or is another file"]

    return look_beside(signatures_of_file(file), differences, asked)


def _statement_of(file: Path) -> dict[str, Any]:
    content = read_bytes(file)
    report = _report_in(content)
    subjects = {file.name: hashlib.sha256(content).hexdigest(), **dict(_subjects(file, report))}
    predicate = {name: report[name] for name in _VERDICTS if name in report}
    return as_statement(subjects, _FILE, predicate)


def _report_in(content: bytes) -> Mapping[str, Any]:
    try:
        found = json.loads(content)
    except (ValueError, RecursionError):
        return {}
    return found if isinstance(found, dict) else {}


def _subjects(file: Path, report: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Name what the file is about: the libraries of an FMU, or the files whose hashes a report states."""
    stated = report.get("sha256")
    if isinstance(stated, dict):
        yield from ((f"{name} of the report", str(of)) for name, of in stated.items() if of)
    if file.suffix.lower() == ".fmu":
        try:
            yield from libraries_in(file)
        except FmuFileError:
            return  # its own hash is signed all the same
