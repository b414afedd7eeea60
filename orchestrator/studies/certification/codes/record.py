"""Records of the rows on the test bench in the files of a certificate: figures, responses, chapters of the page."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from html import escape
from typing import Any

import numpy as np

from orchestrator.core.arrays import Numbers
from orchestrator.core.late import xr
from orchestrator.output.report.colours import colour
from orchestrator.output.report.html.charts import ChartCurve, legend, line_chart
from orchestrator.output.report.html.elements import Figures, bullet_list, table
from orchestrator.studies.certification.certificate import Certificate
from orchestrator.studies.certification.codes.bench_point import BenchResult
from orchestrator.studies.certification.codes.criteria import POWER_SHOWN
from orchestrator.studies.certification.codes.measured import MeasuredRow
from orchestrator.studies.certification.codes.row import Band, Bounded, RowFinding
from orchestrator.studies.certification.codes.row_verdict import NO_VERDICT, NOT_JUDGED, RowVerdict
from orchestrator.studies.certification.form import CODE
from orchestrator.studies.certification.margins import margin_of


def code_responses(certificate: Certificate) -> xr.Dataset:
    """Signals of every row over a time of its own: ``row.signal`` over ``time_row`` [s, pu]."""
    data, coordinates = {}, {}
    for name, result in certificate.results.items():
        along = f"time_{name}"
        coordinates[along] = (along, result.times, {"units": "s"})
        for signal, values in result.signals.items():
            data[f"{name}.{signal}"] = (along, values, {"units": "pu"})
    return xr.Dataset(data, coords=coordinates, attrs={"source": "gfor certify"})


def code_json(c: Certificate) -> dict[str, Any]:
    return {
        "format": CODE,
        "code": c.code.key,
        "title": c.code.title,
        "source": c.code.source,
        "date": c.code.date,
        "f_n": c.f_n,
        "verdict": c.verdict,
        "sentence": c.sentence(),
        "model": c.description.model_name,
        "file": c.fmu_name,
        "binding": c.binding_name,
        "details": c.details.texts(),
        "values": dict(c.request.values),
        "declared": dict(c.code.declared),
        "left_out": list(c.code.left_out),
        "readings": list(c.code.readings),
        "departures": list(c.departures),
        "missing": list(c.missing),
        "rows": [_row(v, c) for v in c.verdicts],
        "acceptance": c.acceptance.report if c.acceptance else None,
        "environment": dict(c.computed_on),
    }


def _row(v: RowVerdict, c: Certificate) -> dict[str, Any]:
    return {
        "row": v.row.name,
        "title": v.row.title,
        "clause": v.row.clause,
        "judged": v.is_judged,
        "accepted": v.accepted,
        "unknown": v.unknown,
        "criteria": [f.recorded for f in v.findings],
        "findings": c.results[v.row.name].findings,
    }


def row_chapters(c: Certificate, figures: Figures) -> list[tuple[str, str]]:
    """Return what the page of a certificate says of its rows."""
    rows = [_cells_of_finding(v, f) for v in c.verdicts for f in v.findings]
    rows += [
        [
            escape(v.name),
            escape(v.row.clause),
            escape(v.row.title),
            "",
            "",
            "",
            escape(v.not_judged),
            "–",
            NOT_JUDGED,
        ]
        for v in c.verdicts
        if v.not_judged
    ]
    columns = [
        "Row",
        "Clause",
        "Stimulus",
        "Criterion",
        "Rule",
        "Number is",
        "Found",
        "Margin",
        "Verdict",
    ]
    shown_only = [row.name for row in c.code.rows if row.shown_only]
    without = f"<p>The code gives no verdict on</p>{bullet_list(shown_only)}" if shown_only else ""
    return [
        ("Result", table("All criteria", columns, rows, left=9) + without),
        ("Responses and their limits", _pictures(c, figures)),
        ("What was not tested", bullet_list([*c.code.left_out, *c.departures, *_not_judged(c)])),
    ]


def _not_judged(c: Certificate) -> list[str]:
    return [f"row {v.name}, not judged: {v.not_judged}" for v in c.verdicts if v.not_judged]


def _cells_of_finding(v: RowVerdict, f: RowFinding) -> list[str]:
    """One criterion of a row; clause and title of the row stand beside its first one alone."""
    is_first = f is v.findings[0]
    of_row = [escape(v.row.clause), escape(v.row.title)] if is_first else ["", ""]
    return [
        escape(v.name),
        *of_row,
        escape(f.criterion),
        escape(f.rule),
        "the code's" if f.origin == "code" else "reading",
        escape(f.text),
        margin_of(f),
        _word(v, f),
    ]


def _pictures(c: Certificate, figures: Figures) -> str:
    parts = []
    for v in c.verdicts:
        content = row_pictures(v, c.results[v.row.name], c.f_n, figures)
        if content:
            refusal = NO_VERDICT if v.row.shown_only else "not accepted"
            refusal = NOT_JUDGED if v.not_judged else refusal
            word = "accepted" if v.accepted else refusal
            title = escape(f"{v.row.name}: {v.row.title}: {word}")
            parts.append(
                f"<details{'' if v.accepted else ' open'}><summary>{title}</summary>{content}</details>"
            )
    return "".join(parts)


def _word(verdict: RowVerdict, finding: RowFinding) -> str:
    word = verdict.word(finding)
    return f'<span class="bad">{word}</span>' if finding.accepted is False else word


LIMIT = "#a11d1d"

BEFORE = 0.25  # so much of the response before an event is shown beside an envelope [s]


Picture = tuple[str, str, list[ChartCurve], str]  # name, label of what is drawn, curves, caption


def row_pictures(verdict: RowVerdict, result: BenchResult, f_n: float, figures: Figures) -> str:
    return "".join(_figure(*picture, figures) for picture in pictures_of(verdict, result, f_n))


def pictures_of(verdict: RowVerdict, result: BenchResult, f_n: float) -> Iterator[Picture]:
    """The response of a row and its limits: beside each envelope, and over the whole run."""
    if len(result.times) < 2:
        return
    programme = verdict.row.programme(f_n)
    measured = MeasuredRow(
        result.times, result.signals, f_n, programme.times, tuple(result.findings)
    )
    whole = result.times[-1] >= programme.stop - 2e-3
    bands = (
        [
            band
            for judge in verdict.row.criteria
            if isinstance(judge, Bounded)
            for band in judge.bands(measured)
        ]
        if whole
        else []
    )
    alone = [band for band in bands if band.alone]
    yield from _zoomed(verdict, measured, alone)
    yield from _along_the_run(
        verdict, measured, [band for band in bands if not band.alone], power=not alone
    )


def _zoomed(v: RowVerdict, row: MeasuredRow, bands: Sequence[Band]) -> Iterator[Picture]:
    said = {finding.criterion: f"{v.word(finding)}: {finding.text}" for finding in v.findings}
    for band in bands:
        part = row.within(float(band.times[0]) - BEFORE, float(band.times[-1]) + 1e-6)
        curves = [_response(row.times[part], band.quantity(row)[part]), *_limits(band)]
        caption = (
            f"{v.row.name}, {band.criterion}: {said.get(band.criterion, '')}. "
            "Means over a period; dashed: the envelope"
        )
        yield f"{v.row.name} {band.criterion}", band.label, curves, caption


def _along_the_run(
    v: RowVerdict, row: MeasuredRow, bands: Sequence[Band], *, power: bool
) -> Iterator[Picture]:
    """A picture of each quantity over the whole run, with all of its limits; of the power in any case."""
    labels = dict.fromkeys(([POWER_SHOWN] if power else []) + [band.label for band in bands])
    for label in labels:
        own = [band for band in bands if band.label == label]
        values = own[0].quantity(row) if own else row.mean_p
        curves = [_response(row.times, values), *(curve for band in own for curve in _limits(band))]
        asked = (
            f". Dashed, what is asked: {'; '.join(dict.fromkeys(b.criterion for b in own))}"
            if own
            else ""
        )
        caption = f"{v.row.name}, {v.row.title}; mean over a period{asked}"
        yield f"{v.row.name} {label}", label, curves, caption


def _response(times: Numbers, values: Numbers) -> ChartCurve:
    real = np.isfinite(values)
    return ChartCurve("response", colour(1), times[real], values[real])


def _limits(band: Band) -> Iterator[ChartCurve]:
    for name, bound in (("at most", band.high), ("at least", band.low)):
        if bound is not None:
            yield ChartCurve(f"{band.criterion}: {name}", LIMIT, band.times, bound, dashed=True)


def _figure(
    name: str, label: str, curves: Sequence[ChartCurve], caption: str, figures: Figures
) -> str:
    if not len(curves[0].x):
        return f"<p>{escape(name)}: no value is a number.</p>"
    names = legend([("response", colour(1)), *([("limit", LIMIT)] if len(curves) > 1 else [])])
    picture, _ = figures.add(names + line_chart(name, "Time [s]", label, curves), caption)
    return picture
