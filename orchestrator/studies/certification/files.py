"""Files of a certificate: the page, the figures as JSON, the responses as NetCDF, and the hashes of all files."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from orchestrator.core.errors import InputError
from orchestrator.core.file_hashes import sha256_of
from orchestrator.core.foreign_files import read_text
from orchestrator.core.options import Option
from orchestrator.core.safe_files import write_text
from orchestrator.output.report.pdf import print_pdf
from orchestrator.output.results.file_writers import save_netcdf
from orchestrator.output.results.staging import check_free
from orchestrator.output.signatures.beside import Beside
from orchestrator.studies.certification.acceptance import KEPT
from orchestrator.studies.certification.case_file import BINDING, CASE, FMU
from orchestrator.studies.certification.certificate import Certificate, DampingCertificate
from orchestrator.studies.certification.codes.bench_point import case_name
from orchestrator.studies.certification.codes.nts631 import NTS631
from orchestrator.studies.certification.codes.record import code_json, code_responses
from orchestrator.studies.certification.figures import damping_json, damping_responses
from orchestrator.studies.certification.form import NORM, case_files
from orchestrator.studies.certification.report import page
from orchestrator.studies.points.store import POINTS, holds_points_alone

if TYPE_CHECKING:
    import xarray as xr

# names of files in a certificate's folder
HTML = "certificate.html"
JSON = "certificate.json"
RESPONSES = "responses.nc"
PDF = "certificate.pdf"


def figures_of(c: Certificate) -> dict[str, Any]:
    """Return the verdict, what it rests on, and the data that a verification needs."""
    return damping_json(c) if isinstance(c, DampingCertificate) else code_json(c)


def _responses_of(c: Certificate) -> xr.Dataset:
    return damping_responses(c) if isinstance(c, DampingCertificate) else code_responses(c)


def save(c: Certificate, folder: Path, *, pdf: bool = False) -> list[Path]:
    html, target, made = folder / HTML, folder / JSON, datetime.now(UTC).replace(microsecond=0)
    save_netcdf(_responses_of(c), folder / RESPONSES)
    content = {"made": made.isoformat(), **figures_of(c)}
    names = [FMU, *([BINDING] if c.request.binding else []), *case_files(content), RESPONSES]
    hashes = {
        name: sha256_of(folder / name) for name in [*names, *([KEPT] if c.acceptance else [])]
    }
    write_text(html, page(c, hashes | {f"{JSON}, its figures": figures_hash(content)}, made))
    printed = [print_pdf(html, folder / PDF)] if pdf else []
    content["files"] = hashes | {file.name: sha256_of(file) for file in (html, *printed)}
    signatures_of(folder).remove()
    write_sealed(content, target)
    return [html, target, folder / RESPONSES, *printed]


def signatures_of(folder: Path) -> Beside:
    """Where the signatures of a certificate lie."""
    return Beside(folder, "certificate")


def spare_another(folder: Path, code: str, fmu: Path, binding: Path | None) -> None:
    """Refuse a folder with a certificate by another code, or with files of others, which this one would replace."""
    try:
        record = read_record(folder / JSON)
        there = record.get("code") or {record["format"]: NTS631}[NORM]
    except (OSError, ValueError, AttributeError, LookupError):
        if not holds_points_alone(folder / POINTS):  # no certificate was begun there
            written = {
                FMU: fmu.read_bytes(),
                **({BINDING: binding.read_bytes()} if binding else {}),
            }
            cases = folder.glob(CASE if code == NTS631 else case_name("*"))
            others = [
                path.name
                for path in cases
                if path.is_dir() or b"gfor certify" not in path.read_bytes()
            ]
            check_free(folder, dict.fromkeys([JSON, HTML, RESPONSES, *others]) | written)
        return
    if there != code:
        raise InputError(
            f"{folder}: it holds a certificate by {there}, which one by {code} would "
            "replace; give another " + Option.OUT + ", or leave it out"
        )


def is_own_file(path: Path) -> bool:
    """Return whether a file lies there itself; a link is none, wherever it leads."""
    return path.is_file() and not path.is_symlink()


def write_sealed(content: Mapping[str, Any], path: Path) -> None:
    text = json.dumps({**content, "seal": seal_of(content)}, indent=1, ensure_ascii=False)
    write_text(path, text + "\n")


def read_record(file: Path) -> Any:
    def once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        content = dict(pairs)
        if len(content) < len(pairs):
            names = [name for name, _ in pairs]
            raise ValueError(f"{next(n for n in names if names.count(n) > 1)!r} stands twice in it")
        return content

    return json.loads(read_text(file), object_pairs_hook=once)


def seal_of(content: Mapping[str, Any]) -> str:
    """SHA-256 of the contents of a certificate's JSON. It shows accidental changes only, because anybody can compute
    it."""
    return _hash_without(content, "seal")


def figures_hash(content: Mapping[str, Any]) -> str:
    """SHA-256 of the contents without the hashes of files. The page states this hash, which ties the page to these
    figures."""
    return _hash_without(content, "seal", "files")


def _hash_without(content: Mapping[str, Any], *names: str) -> str:
    rest = {key: value for key, value in content.items() if key not in names}
    return hashlib.sha256(json.dumps(rest, sort_keys=True, ensure_ascii=False).encode()).hexdigest()
