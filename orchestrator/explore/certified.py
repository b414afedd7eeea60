"""Certificates in the browser: rows against devices, and each row's response in its limits."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import xarray as xr

from orchestrator.analysis.modes import ELECTROMECHANICAL_HZ
from orchestrator.certification.case_file import CASE
from orchestrator.certification.certificate import Certificate
from orchestrator.certification.codes.bench_case import case_name
from orchestrator.certification.codes.certificate import CodeCertificate
from orchestrator.certification.codes.row_pictures import pictures_of
from orchestrator.certification.files import JSON, RESPONSES, read_record
from orchestrator.certification.margins import margin_text
from orchestrator.certification.matrix_record import MATRIX_JSON
from orchestrator.certification.rebuilt import rebuilt
from orchestrator.certification.report_criteria import response_curves
from orchestrator.certification.study import Certification
from orchestrator.certification.verification import read_certificate, verify_files
from orchestrator.errors import InputError
from orchestrator.report.html.charts import ChartCurve, thinned

CERTIFICATES = (MATRIX_JSON, JSON)
"""Names of files that `certified` opens."""


def certified(file: Path) -> tuple[str, dict[str, Any]]:
    """Of a certificate or a matrix of them: a word for its first bench, and its cells with their pictures.

    What does not hold any more is refused."""
    places, whole, said, word = [("", file)], dict[str, dict[str, Any]](), [], ""
    if file.name == MATRIX_JSON:
        try:
            cells = [cell for cell in read_record(file)["cells"] if cell["certificate"]]
            places = [(f"{cell['code']}: ", file.parent / cell["certificate"]) for cell in cells]
            devices = [str(cell["device"]) for cell in cells]
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise InputError(f"{file}: it cannot be read as a matrix of certificates: {error!r}; give one of the "
                             "certificates in its folder, or make it anew") from error  # fmt: skip
    for k, (code, place) in enumerate(places):
        folder, content = read_certificate(place)
        if faults := verify_files(folder, content).faults:
            raise InputError(f"{folder}: the certificate does not hold: {faults[0]}; `gfor verify` says all")
        with xr.open_dataset(folder / RESPONSES, engine="scipy") as data:
            certificate = rebuilt(folder, content, data)
        device = devices[k] if code else certificate.description.model_name
        said.append(f"{device}, {code}{content['verdict']}" if code else content["sentence"])
        for name, bench, cell in _rows(certificate):
            word = word or str(folder / bench)
            whole.setdefault(f"{code}{name}", {})[device] = cell
    if not whole:
        raise InputError(f"{file}: no certificate is in it, as none of its devices could be tested")
    names = list(dict.fromkeys(device for row in whole.values() for device in row))
    return word, {
        "title": "; ".join(said), "kind": "certificate", "range": ELECTROMECHANICAL_HZ, "followed": False,
        "rows": [{"name": name} for name in whole], "columns": [{"name": name} for name in names],
        "cells": [[row.get(name) for name in names] for row in whole.values()],
    }  # fmt: skip


def _rows(certificate: Certificate[Any]) -> Iterator[tuple[str, str, dict[str, Any]]]:
    """Of each row its name, its case file, and its cell."""
    for verdict in certificate.verdicts:
        pictures: list[tuple[str, list[ChartCurve], str]] = []
        if isinstance(certificate, CodeCertificate):
            name, bench, said = verdict.row.name, case_name(verdict.row.name), [verdict.row.title]
            said += [f"{f.criterion}: {verdict.word(f)}, {f.text} (margin {margin_text(f.margin)})"
                     for f in verdict.findings]  # fmt: skip
            drawn = pictures_of(verdict, certificate.results[name], certificate.f_n)
            pictures = [(label, curves, caption) for _, label, curves, caption in drawn]
        else:
            name, bench, said = f"X_L = {verdict.X_L:g} pu", CASE, list(verdict.faults)
            said += [f"{m.criterion}: {m.text} (margin {margin_text(m.margin)})" for m in verdict.margins()]
            if isinstance(certificate, Certification) and verdict.time is not None:
                pictures = [(*response_curves(certificate, verdict, verdict.time), verdict.time.swings.reason)]
        said += [f"not judged: {verdict.unknown}"] if verdict.unknown else []
        yield name, bench, {
            "text": "\n".join(said), "stable": verdict.accepted if verdict.judged else None,
            "pictures": [{"label": label, "caption": caption, "curves": list(map(_drawn, curves))}
                         for label, curves, caption in pictures],
        }  # fmt: skip


def _drawn(curve: ChartCurve) -> dict[str, Any]:
    x, y = thinned(curve.x, curve.y)
    return {"text": curve.label, "colour": curve.colour, "dashed": curve.dashed, "data": [x.tolist(), y.tolist()]}
