"""Certificates in the browser: rows against devices, and each row's response in its limits."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import xarray as xr

from orchestrator.analysis.modes import ELECTROMECHANICAL_HZ
from orchestrator.certification.case_file import CASE
from orchestrator.certification.certificate import Certificate, Judged
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

Drawn = list[dict[str, Any]]
Pictures = list[list[Drawn]]  # of the cells, by row


def certified(file: Path) -> tuple[str, dict[str, Any], Pictures]:
    """Of a certificate or a matrix of them: a word for its first bench, its cells, and the pictures of each cell.

    What does not hold any more is refused."""
    folders = {"": {"": file}}
    title = ""
    if file.name == MATRIX_JSON:
        try:
            matrix = read_record(file)
            title, folders = matrix["sentence"], {code: {} for code in matrix["codes"]}
            for cell in matrix["cells"]:
                if cell["certificate"]:
                    folders[cell["code"]][cell["device"]] = file.parent / cell["certificate"]
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise InputError(f"{file}: it cannot be read as a matrix of certificates: {error!r}; give one of the "
                             "certificates in its folder, or make it anew") from error  # fmt: skip
    found: dict[str, dict[str, tuple[dict[str, Any], Drawn]]] = {}
    word = ""
    for code, devices in folders.items():
        for device, place in devices.items():
            folder, content = read_certificate(place)
            if faults := verify_files(folder, content).faults:
                raise InputError(f"{folder}: the certificate does not hold: {faults[0]}; `gfor verify` says all")
            with xr.open_dataset(folder / RESPONSES, engine="scipy") as data:
                certificate = rebuilt(folder, content, data)
            title = title or content["sentence"]
            word = word or str(folder / _case_of(certificate))
            for name, cell, drawn in _rows(certificate):
                label = f"{code}: {name}" if code else name
                found.setdefault(label, {})[device or certificate.description.model_name] = cell, drawn
    if not found:
        raise InputError(f"{file}: no certificate is in it, as none of its devices could be tested")
    names = list(dict.fromkeys(device for row in found.values() for device in row))
    side = {"values": None, "scenario": "", "out": []}
    study = {
        "title": title, "kind": "certificate", "range": list(ELECTROMECHANICAL_HZ), "followed": False, "values": {},
        "rows": [{"name": label, **side} for label in found], "columns": [{"name": name, **side} for name in names],
        "cells": [[row[name][0] if name in row else None for name in names] for row in found.values()],
    }  # fmt: skip
    return word, study, [[row[name][1] if name in row else [] for name in names] for row in found.values()]


def _case_of(certificate: Certificate[Judged]) -> str:
    if isinstance(certificate, CodeCertificate):
        return next(case_name(v.row.name) for v in certificate.verdicts)
    return CASE


def _rows(certificate: Certificate[Any]) -> Iterator[tuple[str, dict[str, Any], Drawn]]:
    for verdict in certificate.verdicts:
        if isinstance(certificate, CodeCertificate):
            name, said = verdict.row.name, [verdict.row.title]
            said += [f"{f.criterion}: {verdict.word(f)}, {f.text} (margin {margin_text(f.margin)})"
                     for f in verdict.findings]  # fmt: skip
        else:
            name, said = f"X_L = {verdict.X_L:g} pu", list(verdict.faults)
            said += [f"{m.criterion}: {m.text} (margin {margin_text(m.margin)})" for m in verdict.margins()]
        text = "\n".join([*said, *([f"not judged: {verdict.unknown}"] if verdict.unknown else [])])
        stable = verdict.accepted if verdict.judged else None
        yield name, {"text": text, "stable": stable}, list(_pictures(certificate, verdict))


def _pictures(certificate: Certificate[Any], verdict: Any) -> Iterator[dict[str, Any]]:
    if isinstance(certificate, CodeCertificate):
        for one in pictures_of(verdict, certificate.results[verdict.row.name], certificate.f_n):
            yield _drawn(one.label, one.caption, one.curves)
    elif isinstance(certificate, Certification) and verdict.time is not None:
        label, curves = response_curves(certificate, verdict, verdict.time)
        yield _drawn(label, verdict.time.swings.reason, curves)


def _drawn(label: str, caption: str, curves: Sequence[ChartCurve]) -> dict[str, Any]:
    lines = [{"text": c.label, "limit": c.dashed, "data": [part.tolist() for part in thinned(c.x, c.y)]}
             for c in curves if len(c.x)]  # fmt: skip
    return {"label": label, "caption": caption, "curves": lines}
