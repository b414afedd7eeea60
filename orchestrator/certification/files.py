"""Files of a damping test: the page, the figures as JSON, the responses as NetCDF, and the hashes of all files."""

import hashlib
import json
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from orchestrator.certification.acceptance import KEPT
from orchestrator.certification.case_file import BINDING, CASE, FMU, WITH, WITHOUT
from orchestrator.certification.figures import certification_json
from orchestrator.certification.report import page
from orchestrator.certification.study import Certification
from orchestrator.report.pdf import print_pdf
from orchestrator.results.storage import save_netcdf
from orchestrator.safe_files import file_hash, write_text

HTML, JSON, RESPONSES, PDF = "certificate.html", "certificate.json", "responses.nc", "certificate.pdf"


def save(certification: Certification, folder: Path, *, pdf: bool = False) -> list[Path]:
    """Write ``certificate.html``, ``certificate.json`` and ``responses.nc``, on request ``certificate.pdf``."""
    html, target = folder / HTML, folder / JSON
    made = datetime.now(UTC).replace(microsecond=0)
    save_netcdf(responses_dataset(certification), folder / RESPONSES)
    hashes = _hashes(certification, folder)
    content = {"made": made.isoformat(), **certification_json(certification)}
    stated = hashes | {f"{JSON}, its figures": figures_hash(content)}
    write_text(html, page(certification, stated, made))
    printed = [print_pdf(html, folder / PDF)] if pdf else []
    content["files"] = hashes | {file.name: file_hash(file) for file in (html, *printed)}
    write_sealed(content, target)
    return [html, target, folder / RESPONSES, *printed]


def _hashes(c: Certification, folder: Path) -> dict[str, str | None]:
    names = [FMU, *([BINDING] if c.request.binding else []), CASE, RESPONSES, *([KEPT] if c.acceptance else [])]
    return {name: file_hash(folder / name) for name in names}


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
    it.
    """
    return _hash_without(content, "seal")


def figures_hash(content: Mapping[str, Any]) -> str:
    """SHA-256 of the contents without the hashes of files. The page states this hash, which ties the page to these
    figures.
    """
    return _hash_without(content, "seal", "files")


def _hash_without(content: Mapping[str, Any], *names: str) -> str:
    rest = {key: value for key, value in content.items() if key not in names}
    return hashlib.sha256(json.dumps(rest, sort_keys=True, ensure_ascii=False).encode()).hexdigest()


def responses_dataset(c: Certification) -> xr.Dataset:
    """Recorded signals over scenario, X_L and time; NaN where a run ended early."""
    whole = max(c.points.values(), key=lambda p: len(p.times))
    names = dict.fromkeys(name for point in c.points.values() for name in point.signals)
    reactances, scenarios = list(c.request.reactances), [WITHOUT, WITH]
    data = {}
    for name in names:
        values = np.full((2, len(reactances), len(whole.times)), np.nan)
        for i, scenario in enumerate(scenarios):
            for k, X_L in enumerate(reactances):
                signal = c.points[scenario, X_L].signals.get(name, np.empty(0))
                values[i, k, : len(signal)] = signal
        unit = next(p.units[name] for p in c.points.values() if name in p.units)
        data[name] = (
            ("scenario", "X_L", "time"),
            values.astype(np.float32 if name != c.signal else float),
            {"units": unit},
        )
    coordinates = {"scenario": scenarios, "X_L": ("X_L", reactances, {"units": "pu"}),
                   "time": ("time", whole.times, {"units": "s"})}  # fmt: skip
    return xr.Dataset(data, coords=coordinates, attrs={"source": "gfor certify"})
