"""The oscillations of a record as a page: where their energy flows, when they are there, and their spectra."""

from collections.abc import Iterator
from html import escape

import numpy as np

from orchestrator.core.errors import counted
from orchestrator.output.report.html.charts import ChartCurve, legend, line_chart
from orchestrator.output.report.html.elements import SHADES, Figures, colour, document
from orchestrator.output.report.html.network_map import network_map
from orchestrator.studies.oscillations.detection import envelope, signals_of, spectra
from orchestrator.studies.oscillations.location import works
from orchestrator.studies.oscillations.measurements import Measurements
from orchestrator.studies.oscillations.tables import opinions_table
from orchestrator.studies.oscillations.verdict import Located

_LEAST_FLOW = 0.02  # part of the largest energy flow below which a branch has no arrow
_CURVES = 3


def source_page(measured: Measurements, found: list[Located]) -> str:
    figures = Figures()
    findings = "".join(f"<li>{_finding(x)}<br>Next: {escape(x.advice)}.</li>" for x in found)
    content = [
        (f"{x.found.frequency:.4f} Hz", "".join(_chapter(measured, x, found, figures)))
        for x in found
    ]
    return document(
        f"Oscillations in {measured.label}",
        counted(len(measured.places), "place"),
        f'<div class="findings"><ul>{findings or "<li>No oscillation was found.</li>"}</ul></div>',
        [*content, ("Spectrum", _spectrum(measured, found, figures))],
    )


def _finding(one: Located) -> str:
    """What is there and who drives it, in the colour of what is to be done about it, and why."""
    at = f"{one.found.frequency:.3f} Hz:"
    if one.evidence.kind == "not known":
        return f'<b class="{SHADES[None]}">{at} {escape(one.reason)}</b>.'
    who = f", {one.source or one.drives} drives it" if one.source or one.drives else ""
    forced = one.evidence.kind == "forced"
    kind = "a forced oscillation" if forced else "a mode of the system, which nothing forces"
    return f'<b class="{SHADES[not forced]}">{at} {kind}{escape(who)}</b><br>{escape(one.reason)}.'


def _chapter(
    measured: Measurements, one: Located, found: list[Located], figures: Figures
) -> Iterator[str]:
    yield opinions_table("What each method says", one).html()
