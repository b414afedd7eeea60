"""The oscillations of a record as a page: where their energy flows, when they are there, and their spectra."""

from collections.abc import Iterator
from html import escape

import numpy as np

from orchestrator.core.arrays import Numbers
from orchestrator.core.errors import number_of
from orchestrator.core.units import whole_percent
from orchestrator.output.report.colours import colour
from orchestrator.output.report.html.charts import ChartCurve, legend, line_chart
from orchestrator.output.report.html.elements import SHADES, Figures, document
from orchestrator.output.report.html.network_map import network_map
from orchestrator.studies.oscillations.detection import (
    SpectralLine,
    envelope,
    signals_of,
    spectra,
)
from orchestrator.studies.oscillations.location import works
from orchestrator.studies.oscillations.measurements import Measurements
from orchestrator.studies.oscillations.tables import opinions_table
from orchestrator.studies.oscillations.verdict import Located

_LEAST_FLOW = 0.02  # part of the largest energy flow below which a branch has no arrow
_RED = 0.05  # part of the largest energy flow from which on a bus that feeds it is seen to be red
_CURVES = 3
_MEGAWATTS = 100.0  # [MW] that a measurement's base is
_LINE_WIDTH = 0.01  # of the largest value: two pixels of a chart


def source_page(measured: Measurements, found: list[Located]) -> str:
    figures = Figures()
    findings = "".join(f"<li>{_finding(x)}<br>Next: {escape(x.advice)}.</li>" for x in found)
    content = [
        (f"{x.found.frequency:.4f} Hz", "".join(_chapter(measured, x, found, figures)))
        for x in found
    ]
    return document(
        f"Oscillations in {measured.label}",
        number_of(len(measured.places), "place"),
        f'<div class="findings"><ul>{findings or "<li>No oscillation was found.</li>"}</ul></div>',
        [*content, ("Spectrum", _spectrum(measured, found, figures))],
    )


def _finding(one: Located) -> str:
    """Tell what is there and who drives it, in the colour of what is to be done about it, and why."""
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
    yield _map(measured, one, [x.found.frequency for x in found if x is not one], figures)
    curves = envelope_curves(measured, one.found)
    if curves:
        chart = legend((c.label, c.colour) for c in curves) + line_chart(
            "timeline", "Time [s]", "Amplitude [MW]", curves
        )
        yield figures.add(chart, "Amplitude over the time, of the powers that show it best.")[0]


def envelope_curves(measured: Measurements, found: SpectralLine) -> list[ChartCurve]:
    """Amplitudes over the time of the powers that show a line best [MW]; equal ones are one curve with all names.

    A machine and its transformer, or two lines side by side, carry the same power: one of two such curves would hide
    the other.
    """
    signals = signals_of(measured)
    named: list[tuple[list[str], Numbers]] = []
    half = 0
    for name in [n for n in found.amplitudes if n.endswith(".p")]:
        values = signals.values[:, signals.names.index(name)]
        z, half = envelope(signals.times, values, found.frequency)
        size = np.abs(z) * _MEGAWATTS / measured.base
        same = next((names for names, other in named if _lie_together(size, other)), None)
        if same is not None:
            same.append(name)
        elif len(named) < _CURVES:
            named.append(([name], size))
    times = signals.times[half : len(signals.times) - half]
    return [
        ChartCurve(" = ".join(names), colour(k + 1), times, size)
        for k, (names, size) in enumerate(named)
    ]


def _lie_together(one: Numbers, other: Numbers) -> bool:
    """Return whether two curves are nowhere further apart than the width of a line."""
    return bool(np.abs(one - other).max() <= _LINE_WIDTH * max(one.max(), other.max()))


def _map(measured: Measurements, one: Located, others: list[float], figures: Figures) -> str:
    """Buses by the dissipating energy that is fed there, and branches by what flows along them."""
    energy = dict(
        zip(
            [p.name for p in measured.places],
            works(measured.places, measured.times, one.found, others)[0].values.tolist(),
            strict=True,
        )
    )
    scale = max(map(abs, energy.values()), default=0.0) or 1.0
    fed: dict[str, float] = {}
    flows: dict[tuple[str, str], float] = {}
    for place in measured.places:
        if place.beyond:
            fed.setdefault(place.beyond, 0.0)
            out = -energy[place.name] / scale
            if abs(out) > _LEAST_FLOW:
                flows[(place.bus, place.beyond) if out > 0 else (place.beyond, place.bus)] = min(
                    abs(out), 1.0
                )
        fed[place.bus] = fed.get(place.bus, 0.0) + (
            0.0 if place.beyond else energy[place.name] / scale
        )
    branches = [(place.bus, place.beyond) for place in measured.places if place.beyond]
    texts = {
        bus: f"{bus}: {'feeds' if part > 0 else 'takes'} {whole_percent(abs(part))}"
        for bus, part in fed.items()
    }
    seen = max(fed.values(), default=0.0) > _RED
    red = "the redder a bus, the more it feeds" if seen else "no bus that is measured feeds any"
    text = f"Dissipating energy, as parts of the largest flow: {red}; arrows along flows."
    return figures.add(network_map("map of energy flows", branches, fed, texts, flows), text)[0]


def _spectrum(measured: Measurements, found: list[Located], figures: Figures) -> str:
    grid, power = spectra(signals_of(measured).values, measured.interval)
    shown = (grid > 0.05) & (grid < min(4.0, 0.4 / measured.interval))
    mean = power[shown].mean(axis=1)
    level = 10 * np.log10(np.maximum(mean / mean.max(), 1e-12))
    curves = [ChartCurve("all signals", colour(1), grid[shown], level)]
    chart = line_chart("spectrum", "Frequency [Hz]", "Power [dB]", curves)
    lines = ", ".join(f"{x.found.frequency:.4f} Hz" for x in found) or "none"
    return figures.add(
        chart, f"Mean power of all signals, each as a part of its own. Lines found: {lines}."
    )[0]
