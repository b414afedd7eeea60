"""Files of a certificate: the page, the figures as JSON, the responses as NetCDF, and the hashes of all files."""

import hashlib
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import xarray as xr

from orchestrator.certification.acceptance import KEPT
from orchestrator.certification.case_file import BINDING, CASE, FMU
from orchestrator.certification.certificate import Certificate, Judged
from orchestrator.certification.codes.bench_point import case_name
from orchestrator.certification.codes.record import code_json, code_page, code_responses
from orchestrator.certification.figures import certification_json, responses_dataset
from orchestrator.certification.report import page
from orchestrator.certification.study import Certification
from orchestrator.report.pdf import print_pdf
from orchestrator.results.storage import save_netcdf
from orchestrator.safe_files import file_hash, write_text

HTML, JSON, RESPONSES, PDF = "certificate.html", "certificate.json", "responses.nc", "certificate.pdf"

_FIGURES = f"{JSON}, its figures"


@dataclass(frozen=True)
class _Form:
    figures: Callable[[Any], dict[str, Any]]
    responses: Callable[[Any], xr.Dataset]
    page: Callable[[Any, Mapping[str, str | None], datetime], str]
    cases: Callable[[Any], list[str]]


def _form_of(certificate: Certificate[Judged]) -> _Form:
    if isinstance(certificate, Certification):
        return _Form(certification_json, responses_dataset, page, lambda _: [CASE])
    return _Form(code_json, code_responses, lambda c, hashes, made: code_page(c, made, str(hashes[_FIGURES])),
                 lambda c: [case_name(row.name) for row in c.code.rows if row.name in c.results])  # fmt: skip


def figures_of(certificate: Certificate[Judged]) -> dict[str, Any]:
    return _form_of(certificate).figures(certificate)


def names_of(certificate: Certificate[Judged]) -> list[str]:
    names = [FMU, *([BINDING] if certificate.request.binding else []), *_form_of(certificate).cases(certificate)]
    return [*names, RESPONSES, *([KEPT] if certificate.acceptance else [])]


def save(certificate: Certificate[Judged], folder: Path, *, pdf: bool = False) -> list[Path]:
    html, target, form = folder / HTML, folder / JSON, _form_of(certificate)
    made = datetime.now(UTC).replace(microsecond=0)
    save_netcdf(form.responses(certificate), folder / RESPONSES)
    hashes = {name: file_hash(folder / name) for name in names_of(certificate)}
    content = {"made": made.isoformat(), **form.figures(certificate)}
    write_text(html, form.page(certificate, hashes | {_FIGURES: figures_hash(content)}, made))
    printed = [print_pdf(html, folder / PDF)] if pdf else []
    content["files"] = hashes | {file.name: file_hash(file) for file in (html, *printed)}
    write_sealed(content, target)
    return [html, target, folder / RESPONSES, *printed]


def write_sealed(content: Mapping[str, Any], path: Path) -> None:
    """Write JSON that contains a hash of all its other contents."""
    text = json.dumps({**content, "seal": seal_of(content)}, indent=1, ensure_ascii=False)
    write_text(path, text + "\n")


def read_record(file: Path) -> Any:
    def once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        content = dict(pairs)
        if len(content) < len(pairs):
            names = [name for name, _ in pairs]
            raise ValueError(f"{next(n for n in names if names.count(n) > 1)!r} stands twice in it")
        return content

    return json.loads(file.read_text(encoding="utf-8"), object_pairs_hook=once)


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
