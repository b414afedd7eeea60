"""The two criteria on a certificate's page: every mode, and every response with the norm's construction."""

from collections.abc import Iterator
from html import escape

import numpy as np

from orchestrator.analysis.modes import damping_ratio
from orchestrator.certification.case_file import WITH, WITHOUT
from orchestrator.certification.criteria import PAIRED, is_judged, is_near
from orchestrator.certification.judgement import PointVerdict, TimeVerdict
from orchestrator.certification.point import COMPUTED, FREQUENCY
from orchestrator.certification.study import Certification
from orchestrator.report.html.charts import ChartCurve, Mark, complex_plane, legend, line_chart
from orchestrator.report.html.elements import Figures, colour, damping, eigenvalue, table

_SHOWN = 30.0  # length of the drawn part of the response, from the event on [s]. The whole response is judged.


def before(value: complex | None) -> str:
    if value is None:
        return "no such mode"
    return f"{value.imag / (2 * np.pi):.3f} Hz, {damping(100 * damping_ratio(value))} %"


def verdict(accepted: bool) -> str:
    return '<span class="good">accepted</span>' if accepted else '<span class="bad">not accepted</span>'


def eigenvalues(c: Certification, figures: Figures) -> str:
    marks = []
    for k, scenario in enumerate((WITHOUT, WITH)):
        for (name, X_L), point in c.points.items():
            if name != scenario or point.modes is None:
                continue
            for value, words in zip(point.modes.eigenvalues.tolist(), point.components, strict=True):
                hz = value.imag / (2 * np.pi)
                if is_judged(hz) and value.real > -4:
                    text = f"{scenario} the converter, X_L = {X_L:g} pu\n"
                    text += f"{hz:.3f} Hz, {100 * damping_ratio(value):.2f} %\n{words}"
                    marks.append(Mark(value.real, hz, colour(k), text, large=scenario == WITH))
    names = legend([("without the converter", colour(0)), ("with the converter", colour(1))])
    picture, link = figures.add(
        names + complex_plane("Eigenvalue map", marks, highest_hz=1.5),
        "Modes from 0.1 to 1.5 Hz at all line reactances, with rays of equal damping. Left of the 5 % ray all is well.",
    )  # fmt: skip
    parts = [f"<p>{link} shows the modes; the tables below hold them all.</p>{picture}"]
    for v in c.verdicts:
        rows = [
            [eigenvalue(m.eigenvalue.real, m.eigenvalue.imag), f"{m.frequency_hz:.4f}", damping(m.damping_percent),
             f"{before(m.before)} {escape(m.doubt)}", f"{m.similarity:.2f}", escape(m.components), verdict(m.accepted)]
            for m in v.modes
        ]  # fmt: skip
        columns = ["λ [rad/s]", "f [Hz]", "Damping [%]", "Same mode without the converter", "Likeness"]
        columns += ["Who takes part", "Verdict"]
        summary = f"X_L = {v.X_L:g} pu: {len(rows)} modes from 0.1 to 1.5 Hz"
        modes = table(f"Modes at X_L = {v.X_L:g} pu", columns, rows)
        content = f"{modes}{_modes_beside(v)}{_base_modes(c, v)}"
        parts.append(f"<details open><summary>{summary}</summary>{content}</details>")
    return "".join(parts)


def _modes_beside(v: PointVerdict) -> str:
    rows = [
        [eigenvalue(m.eigenvalue.real, m.eigenvalue.imag), f"{m.frequency_hz:.4f}", damping(m.damping_percent),
         before(m.before), escape(m.components)] for m in v.neighbours
    ]  # fmt: skip
    columns = ["λ [rad/s]", "f [Hz]", "Damping [%]", "Same mode without the converter", "Who takes part"]
    caption = f"Just outside, from {COMPUTED[0]:g} to 0.1 Hz and from 1.5 to {COMPUTED[1]:g} Hz: not judged"
    return table(caption, columns, rows) if rows else f'<p class="soft">{caption}: none.</p>'


def _base_modes(c: Certification, v: PointVerdict) -> str:
    point = c.points[WITHOUT, v.X_L]
    if point.modes is None:
        return ""
    entries = zip(point.modes.eigenvalues.tolist(), point.components, strict=True)
    rows = [
        [eigenvalue(x.real, x.imag), f"{x.imag / (2 * np.pi):.4f}", damping(100 * damping_ratio(x)), escape(words)]
        for x, words in entries
        if is_near(x.imag / (2 * np.pi))
    ]
    caption = f"Without the converter, from {PAIRED[0]:g} to {PAIRED[1]:g} Hz"
    said = v.of_base_critical()
    note = f"<p>{escape(said[0].upper() + said[1:])}.</p>" if said else ""
    return table(caption, ["λ [rad/s]", "f [Hz]", "Damping [%]", "Who takes part"], rows) + note


def responses(c: Certification, figures: Figures) -> str:
    return "".join(part for v in c.verdicts for part in _response(c, v, figures))


def _response(c: Certification, v: PointVerdict, figures: Figures) -> Iterator[str]:
    yield f"<h3>X_L = {v.X_L:g} pu</h3>"
    if v.time is None:
        yield f'<p class="bad">{escape("; ".join(v.faults) or v.unknown)}</p>'
        return
    label, curves = response_curves(c, v, v.time)
    picture, link = figures.add(
        line_chart(f"Response at X_L = {v.X_L:g} pu", "Time [s]", label, curves),
        f"Response to +2 % of SG2's voltage reference at X_L = {v.X_L:g} pu. Dashed: without the converter. "
        "Red: lines from maximum to maximum, and ΔPkMk.",
    )
    reasons = f"{escape(v.time.swings.reason)}. By its modes: {escape(v.time.modal.reason)}."
    yield f"<p>{link}: {reasons} {verdict(v.time.accepted)}</p>"
    yield picture
    yield _swing_table(v.time, c.points[WITH, v.X_L].units[v.time.signal])
    yield _modal_table(v.time)


def response_curves(c: Certification, v: PointVerdict, time: TimeVerdict) -> tuple[str, list[ChartCurve]]:
    """The response with the norm's construction, and what it is of."""
    unit = c.points[WITH, v.X_L].units[time.signal]
    curves = []
    for k, scenario in enumerate((WITHOUT, WITH)):
        point = c.points[scenario, v.X_L]
        if time.signal in point.signals:
            shown = point.times <= c.event_time + _SHOWN
            curves.append(ChartCurve(f"{scenario} the converter", colour(k), point.times[shown],
                                point.signals[time.signal][shown], dashed=scenario == WITHOUT))  # fmt: skip
    curves += _construction(time, c.event_time + _SHOWN)
    return f"{'Frequency at bus 2' if time.signal == FREQUENCY else 'Active power of SG1'} [{unit}]", curves


def _construction(time: TimeVerdict, last: float) -> Iterator[ChartCurve]:
    red = "#a11d1d"
    for s in time.swings.swings:
        if s.after.time <= last and s.number <= 6:
            ends = np.array([s.before.time, s.after.time]), np.array([s.before.value, s.after.value])
            yield ChartCurve(f"P{s.number}–P{s.number + 1}", red, *ends, dashed=True)
            moment = np.array([s.minimum.time, s.minimum.time + 1e-6])
            yield ChartCurve(f"ΔP{s.number}M{s.number}", red, moment, np.array([s.minimum.value, s.line]))


def _swing_table(time: TimeVerdict, unit: str) -> str:
    test = time.swings
    rows = []
    for s in test.swings[:8]:
        row = [text for p in (s.before, s.minimum, s.after) for text in (f"{p.time:.3f}", f"{p.value:.6f}")]
        rows.append([str(s.number), *row, f"{s.line:.6f}", f"{s.depth:.6f}"])
    columns = ["k", "Pk at [s]", f"Pk [{unit}]", "Mk at [s]", f"Mk [{unit}]", "Pk+1 at [s]", f"Pk+1 [{unit}]",
               "Line at Mk", "ΔPkMk"]  # fmt: skip
    note = ""
    if test.dropped:
        kind = "maximum" if test.dropped.is_maximum else "minimum"
        note = (
            f'<p class="soft">Left out: the {kind} {test.dropped.value:.6f} at {test.dropped.time:.3f} s, '
            f"towards which the oscillation starts. With it: {escape(time.other_reading.reason)}.</p>"
        )
    return (table("Maxima, minima and distances", columns, rows) if rows else "") + note


def _modal_table(time: TimeVerdict) -> str:
    rows = [
        [eigenvalue(m.eigenvalue.real, m.eigenvalue.imag), f"{m.frequency_hz:.4f}", damping(m.damping_percent),
         f"{m.amplitude:.3g}"] for m in time.modal.modes
    ]  # fmt: skip
    columns = ["λ [rad/s]", "f [Hz]", "Damping [%]", "Amplitude"]
    return table("Modes in the signal from 0.1 to 1.5 Hz (matrix pencil)", columns, rows) if rows else ""
