"""Every response of a row as a picture, with the limits within which its criteria ask it to stay."""

from collections.abc import Iterator, Sequence
from html import escape

import numpy as np

from orchestrator.arrays import Numbers
from orchestrator.certification.codes.bench_point import BenchResult
from orchestrator.certification.codes.criteria import POWER_SHOWN
from orchestrator.certification.codes.measured import MeasuredRow
from orchestrator.certification.codes.row import Band, Bounded
from orchestrator.certification.codes.row_verdict import RowVerdict
from orchestrator.report.html.charts import ChartCurve, legend, line_chart
from orchestrator.report.html.elements import Figures, colour

LIMIT = "#a11d1d"
"""Colour of limits."""

BEFORE = 0.25  # so much of the response before an event is shown beside an envelope [s]


Picture = tuple[str, str, list[ChartCurve], str]  # name, label of what is drawn, curves, caption


def row_pictures(verdict: RowVerdict, result: BenchResult, f_n: float, figures: Figures) -> str:
    return "".join(_figure(*picture, figures) for picture in pictures_of(verdict, result, f_n))


def pictures_of(verdict: RowVerdict, result: BenchResult, f_n: float) -> Iterator[Picture]:
    """The response of a row and its limits: beside each envelope, and over the whole run."""
    if len(result.times) < 2:
        return
    programme = verdict.row.programme(f_n)
    measured = MeasuredRow(result.times, result.signals, f_n, programme.times, tuple(result.findings))
    whole = result.times[-1] >= programme.stop - 2e-3
    bands = [band for judge in verdict.row.criteria if isinstance(judge, Bounded) for band in judge.bands(measured)
             ] if whole else []  # fmt: skip
    alone = [band for band in bands if band.alone]
    yield from _zoomed(verdict, measured, alone)
    yield from _along_the_run(verdict, measured, [band for band in bands if not band.alone], power=not alone)


def _zoomed(v: RowVerdict, row: MeasuredRow, bands: Sequence[Band]) -> Iterator[Picture]:
    said = {finding.criterion: f"{v.word(finding)}: {finding.text}" for finding in v.findings}
    for band in bands:
        part = row.within(float(band.times[0]) - BEFORE, float(band.times[-1]) + 1e-6)
        curves = [_response(row.times[part], band.quantity(row)[part]), *_limits(band)]
        caption = (
            f"{v.row.name}, {band.criterion}: {said.get(band.criterion, '')}. Means over a period; dashed: the envelope"
        )
        yield f"{v.row.name} {band.criterion}", band.label, curves, caption


def _along_the_run(v: RowVerdict, row: MeasuredRow, bands: Sequence[Band], *, power: bool) -> Iterator[Picture]:
    """A picture of each quantity over the whole run, with all of its limits; of the power in any case."""
    labels = dict.fromkeys(([POWER_SHOWN] if power else []) + [band.label for band in bands])
    for label in labels:
        own = [band for band in bands if band.label == label]
        values = own[0].quantity(row) if own else row.mean_p
        curves = [_response(row.times, values), *(curve for band in own for curve in _limits(band))]
        asked = f". Dashed, what is asked: {'; '.join(dict.fromkeys(b.criterion for b in own))}" if own else ""
        caption = f"{v.row.name}, {v.row.title}; mean over a period{asked}"
        yield f"{v.row.name} {label}", label, curves, caption


def _response(times: Numbers, values: Numbers) -> ChartCurve:
    real = np.isfinite(values)
    return ChartCurve("response", colour(1), times[real], values[real])


def _limits(band: Band) -> Iterator[ChartCurve]:
    for name, bound in (("at most", band.high), ("at least", band.low)):
        if bound is not None:
            yield ChartCurve(f"{band.criterion}: {name}", LIMIT, band.times, bound, dashed=True)


def _figure(name: str, label: str, curves: Sequence[ChartCurve], caption: str, figures: Figures) -> str:
    if not len(curves[0].x):
        return f"<p>{escape(name)}: no value is a number.</p>"
    names = legend([("response", colour(1)), *([("limit", LIMIT)] if len(curves) > 1 else [])])
    picture, _ = figures.add(names + line_chart(name, "Time [s]", label, curves), caption)
    return picture
