"""The things that `gfor explore` opens: a case, a folder of results with the case behind it, or certificates."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from orchestrator.core.errors import InputError
from orchestrator.core.late import import_xarray_alone, xr
from orchestrator.face.api.case import Case, load
from orchestrator.linear.spectra.modes import ELECTROMECHANICAL_HZ
from orchestrator.output.report.explorer_cells import CELLS, check_case, found_from, read_cells
from orchestrator.output.report.html.charts import ChartCurve, thinned
from orchestrator.output.report.html.folder import SUMMARY
from orchestrator.output.results.readers import has_reader
from orchestrator.output.results.recording_writer import TRAJECTORY
from orchestrator.studies.certification.case_file import CASE
from orchestrator.studies.certification.certificate import Certificate, DampingCertificate
from orchestrator.studies.certification.codes.bench_point import case_name
from orchestrator.studies.certification.codes.record import pictures_of
from orchestrator.studies.certification.files import JSON, RESPONSES, read_record
from orchestrator.studies.certification.kinds import rebuilt
from orchestrator.studies.certification.margins import margin_text
from orchestrator.studies.certification.matrix import MATRIX_JSON
from orchestrator.studies.certification.report_criteria import response_curves
from orchestrator.studies.certification.verification import read_certificate, verify_files

CERTIFICATES = (MATRIX_JSON, JSON)  # names of files that `certified` opens


def certified(file: Path) -> tuple[str, dict[str, Any]]:
    """Return of a certificate or a matrix of them: a word for its first bench, and its cells with their pictures.

    What does not hold any more is refused."""
    places, whole, said, word = [("", file)], dict[str, dict[str, Any]](), [], ""
    if file.name == MATRIX_JSON:
        try:
            cells = [cell for cell in read_record(file)["cells"] if cell["certificate"]]
            places = [(f"{cell['code']}: ", file.parent / cell["certificate"]) for cell in cells]
            devices = [str(cell["device"]) for cell in cells]
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise InputError(
                f"{file}: it cannot be read as a matrix of certificates: {error!r}; give one of the "
                "certificates in its folder, or make it anew"
            ) from error
    import_xarray_alone()
    for k, (code, place) in enumerate(places):
        folder, content = read_certificate(place)
        faults = verify_files(folder, content).faults
        if faults:
            raise InputError(
                f"{folder}: the certificate does not hold: {faults[0]}; `gfor verify` says all"
            )
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
    grid = [[row.get(name) for name in names] for row in whole.values()]
    return word, {
        "title": "; ".join(said),
        "kind": "certificate",
        "range": ELECTROMECHANICAL_HZ,
        "followed": False,
        "rows": [{"name": name} for name in whole],
        "columns": [{"name": name} for name in names],
        "cells": grid,
    }


def _rows(certificate: Certificate) -> Iterator[tuple[str, str, dict[str, Any]]]:
    """Yield of each row its name, its case file, and its cell."""
    for verdict in certificate.verdicts:
        pictures: list[tuple[str, list[ChartCurve], str]] = []
        if isinstance(certificate, DampingCertificate):
            name, bench, said = f"X_L = {verdict.X_L:g} pu", CASE, list(verdict.faults)
            unknown = verdict.unknown
            said += [
                f"{m.criterion}: {m.text} (margin {margin_text(m.margin)})"
                for m in verdict.margins()
            ]
            if verdict.time is not None:
                event_time = certificate.event_time
                pictures = [
                    (*response_curves(certificate, verdict, event_time), verdict.time.swings.reason)
                ]
        else:
            name, bench, said = verdict.row.name, case_name(verdict.row.name), [verdict.row.title]
            said += [
                f"{f.criterion}: {verdict.word(f)}, {f.text} (margin {margin_text(f.margin)})"
                for f in verdict.findings
            ]
            drawn = pictures_of(verdict, certificate.results[name], certificate.f_n)
            pictures = [(label, curves, caption) for _, label, curves, caption in drawn]
            unknown = verdict.not_judged
        said += [f"not judged: {unknown}"] if unknown else []
        yield (
            name,
            bench,
            {
                "text": "\n".join(said),
                "stable": verdict.accepted if verdict.is_judged else None,
                "pictures": [
                    {"label": label, "caption": caption, "curves": list(map(_drawn, curves))}
                    for label, curves, caption in pictures
                ],
            },
        )


def _drawn(curve: ChartCurve) -> dict[str, Any]:
    x, y = thinned(curve.x, curve.y)
    return {
        "text": curve.label,
        "colour": curve.colour,
        "dashed": curve.dashed,
        "data": [x.tolist(), y.tolist()],
    }


Opened = tuple[str, Case, dict[str, Any]]
"""A word that opens the case, the case, and what the page begins with where that is not as always: ``recorded`` in it
is a file or folder by scenario, "" for each that has none of its own."""


def opened(given: str, *, trust_fmus: bool = False) -> Opened:
    path = Path(given)
    if path.name == TRAJECTORY or (path / TRAJECTORY).is_file():
        scenario = path.parent if path.name == TRAJECTORY else path
        return _of_run(scenario.parent, trust_fmus, scenario.name)
    if (path / SUMMARY).is_file():
        return _of_run(path, trust_fmus)
    file = (
        path
        if path.name in CERTIFICATES
        else next((path / n for n in CERTIFICATES if (path / n).is_file()), None)
    )
    if file is not None and not (path / CELLS).is_file():
        word, study = certified(file)
        return word, load(word, trust_fmus=trust_fmus), {"study": study}
    if path.is_dir():
        study = read_cells(path)
        case = load(study["case"], trust_fmus=trust_fmus)
        check_case(study, case.file, path)
        kept = {key: study.get(key) for key in ("scenario", "step", "values", "range")}
        return study["case"], case, {"study": study, **kept}
    if has_reader(path):
        raise InputError(
            f"{given}: a recording is shown beside a simulation: gfor explore CASE --beside {given}"
        )
    return given, load(given, trust_fmus=trust_fmus), {}


def _of_run(folder: Path, trust_fmus: bool, scenario: str = "") -> Opened:
    """The case of a run as it is now, with the values that the run was given, and beside it what was recorded."""
    try:
        summary = json.loads((folder / SUMMARY).read_text(encoding="utf-8"))
        word, given = str(found_from(summary["case_file"], folder)), summary["given"]
        recorded = {
            name: str(folder / name) for name in given if (folder / name / TRAJECTORY).is_file()
        }
        name = scenario or next(reversed(recorded))
        wanted, text = dict(given[name]), (folder / "case.toml").read_text(encoding="utf-8")
        (step,) = (one["step_size_s"] for one in summary["scenarios"] if one["name"] == name)
    except (OSError, ValueError, KeyError, TypeError, StopIteration) as error:
        raise InputError(
            f"{folder / SUMMARY}: it does not tell which case was run, and how ({error!r}); run it again "
            "with `gfor run`, or give the case and --beside FOLDER/SCENARIO"
        ) from error
    case = load(word, trust_fmus=trust_fmus)
    if text != case.file.text:
        raise InputError(
            f"{word} is not as it was when {folder} was made; run it again, or give the case and --beside "
            f"{folder / name}"
        )
    own = case.scenario(name).prepared
    values = {key: value for key, value in wanted.items() if own.given.get(key) != value}
    beginning = {"scenario": name, "values": values, "recorded": recorded}
    return word, case, beginning if step == own.step_size else beginning | {"step": step}
