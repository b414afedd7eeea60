"""The two criteria on a certificate's page: every mode, and every response with the norm's construction."""

from collections.abc import Callable, Iterable, Iterator
from html import escape

import numpy as np

from orchestrator.linear.models.linear_model import PACKED
from orchestrator.linear.spectra.modes import damping_ratio
from orchestrator.output.report.colours import colour
from orchestrator.output.report.html.charts import (
    ChartCurve,
    Mark,
    complex_plane,
    legend,
    line_chart,
)
from orchestrator.output.report.html.elements import Figures, damping, eigenvalue, number, table
from orchestrator.output.report.linearised import exceptions_in_words
from orchestrator.studies.certification.case_file import WITH, WITHOUT
from orchestrator.studies.certification.certificate import Certificate, DampingCertificate
from orchestrator.studies.certification.criteria import PAIRED, is_judged, is_near
from orchestrator.studies.certification.figures import fit_errors_of, linearised_of
from orchestrator.studies.certification.judgement import LOWERED, PointVerdict, TimeVerdict
from orchestrator.studies.certification.pod_effect import pod_section
from orchestrator.studies.certification.point import COMPUTED, CONVERTER, FREQUENCY, PointResult

# length of the drawn part of the response, from the event on [s]. The whole response is judged.
_SHOWN = 30.0


PODS = {"none": "none", "p": "POD-P", "q": "POD-Q", "pq": "POD-P and POD-Q"}


def damping_chapters(c: DampingCertificate, figures: Figures) -> list[tuple[str, str]]:
    return [
        ("Result at every line reactance", _overview(c)),
        ("Dampings that the converter lowers", _lowered(c)),
        ("Stability at all frequencies", _stability(c)),
        ("Eigenvalue criterion", eigenvalues(c, figures)),
        (
            "Time-domain criterion",
            "".join(part for v in c.verdicts for part in _response(c, v, figures)),
        ),
        ("What the damping controllers change", pod_section(c.verdicts)),
    ]


def damping_findings(c: DampingCertificate) -> Iterator[str]:
    yield f"Eigenvalue criterion: {_where([v for v in c.verdicts if v.is_judged and not v.eigenvalues_accepted])}"
    bad = [v for v in c.verdicts if v.is_judged and (v.time is None or not v.time.accepted)]
    yield f"Time-domain criterion on {signal_name(c.signal)}: {_where(bad)}"
    yield escape(converter_model(c.results[WITH, v.X_L] for v in c.verdicts))
    yield f"Damping controllers: {PODS[c.pod]} ({escape(c.controllers.source)})"
    yield from _least_and_growth(c)
    yield from _remark(c)


def damping_facts(c: DampingCertificate) -> dict[str, str]:
    """Lines of the table of the converter."""
    linearised = linearised_of(c)
    return {
        "Damping controllers": f"{PODS[c.pod]}: {c.controllers.source}",
        "Watched in time": signal_name(c.signal),
        "In the modes": converter_model(c.results[WITH, v.X_L] for v in c.verdicts),
        "Linear models": exceptions_in_words(linearised, fit_errors_of(c))
        or ("all by perturbing the running FMUs" if linearised else "not recorded"),
    }


def signal_name(signal: str) -> str:
    return "the frequency at bus 2" if signal == FREQUENCY else "SG1's active power"


def converter_model(points: Iterable[PointResult]) -> str:
    known = [p for p in points if p.modes is not None]
    boxes = [p for p in known if p.identified is not None]
    if boxes:
        orders = ", ".join(dict.fromkeys(str(p.identified) for p in boxes))
        error = max(p.fit_errors.get(CONVERTER, 0.0) for p in boxes)
        return (
            f"Black box: a model identified at its port, of order {orders}; largest relative fitting error "
            f"{error:.1e}"
        )
    if any(p.linearised.get(CONVERTER) == PACKED for p in known):
        return (
            "The model packed in the FMU stands for the converter in the modes; it was compared with its own "
            "response"
        )
    return (
        "White box: the FMU's own states were perturbed"
        if known
        else "Modes of the converter are not known"
    )


_MODE = ("λ [rad/s]", "f [Hz]", "Damping [%]")


def _mode(value: complex) -> list[str]:
    hz = f"{value.imag / (2 * np.pi):.4f}"
    return [eigenvalue(value.real, value.imag), hz, damping(100 * damping_ratio(value))]


def before(value: complex | None) -> str:
    if value is None:
        return "no such mode"
    return f"{value.imag / (2 * np.pi):.3f} Hz, {damping(100 * damping_ratio(value))} %"


def verdict(accepted: bool) -> str:
    return (
        '<span class="good">accepted</span>'
        if accepted
        else '<span class="bad">not accepted</span>'
    )


def eigenvalues(c: Certificate, figures: Figures) -> str:
    marks = []
    for k, scenario in enumerate((WITHOUT, WITH)):
        for (name, X_L), point in c.results.items():
            if name != scenario or point.modes is None:
                continue
            for value, words in zip(
                point.modes.eigenvalues.tolist(), point.components, strict=True
            ):
                hz = value.imag / (2 * np.pi)
                if is_judged(hz) and value.real > -4:
                    text = f"{scenario} the converter, X_L = {X_L:g} pu\n"
                    text += f"{hz:.3f} Hz, {100 * damping_ratio(value):.2f} %\n{words}"
                    marks.append(Mark(value.real, hz, colour(k), text, large=scenario == WITH))
    names = legend([("without the converter", colour(0)), ("with the converter", colour(1))])
    picture, link = figures.add(
        names + complex_plane("Eigenvalue map", marks, highest_hz=1.5),
        "Modes from 0.1 to 1.5 Hz at all line reactances, with rays of equal damping. Left of the 5 % ray all is well.",
    )
    parts = [f"<p>{link} shows the modes; the tables below hold them all.</p>{picture}"]
    for v in c.verdicts:
        rows = [
            [
                *_mode(m.eigenvalue),
                f"{before(m.before)} {escape(m.doubt)}",
                f"{m.similarity:.2f}",
                escape(m.components),
                verdict(m.accepted),
            ]
            for m in v.modes
        ]
        columns = [
            *_MODE,
            "Same mode without the converter",
            "Likeness",
            "Who takes part",
            "Verdict",
        ]
        summary = f"X_L = {v.X_L:g} pu: {len(rows)} modes from 0.1 to 1.5 Hz"
        modes = table(f"Modes at X_L = {v.X_L:g} pu", columns, rows)
        content = f"{modes}{_modes_beside(v)}{_base_modes(c, v)}"
        parts.append(f"<details open><summary>{summary}</summary>{content}</details>")
    return "".join(parts)


def _modes_beside(v: PointVerdict) -> str:
    rows = [[*_mode(m.eigenvalue), before(m.before), escape(m.components)] for m in v.neighbours]
    columns = [*_MODE, "Same mode without the converter", "Who takes part"]
    caption = f"Just outside, from {COMPUTED[0]:g} to 0.1 Hz and from 1.5 to {COMPUTED[1]:g} Hz: not judged"
    return table(caption, columns, rows) if rows else f'<p class="soft">{caption}: none.</p>'


def _base_modes(c: Certificate, v: PointVerdict) -> str:
    point = c.results[WITHOUT, v.X_L]
    if point.modes is None:
        return ""
    entries = zip(point.modes.eigenvalues.tolist(), point.components, strict=True)
    rows = [[*_mode(x), escape(words)] for x, words in entries if is_near(x.imag / (2 * np.pi))]
    caption = f"Without the converter, from {PAIRED[0]:g} to {PAIRED[1]:g} Hz"
    said = v.of_base_critical()
    note = f"<p>{escape(said[0].upper() + said[1:])}.</p>" if said else ""
    return table(caption, [*_MODE, "Who takes part"], rows) + note


def _response(c: DampingCertificate, v: PointVerdict, figures: Figures) -> Iterator[str]:
    yield f"<h3>X_L = {v.X_L:g} pu</h3>"
    if v.time is None:
        yield f'<p class="bad">{escape("; ".join(v.faults) or v.unknown)}</p>'
        return
    label, curves = response_curves(c, v, c.event_time)
    picture, link = figures.add(
        line_chart(f"Response at X_L = {v.X_L:g} pu", "Time [s]", label, curves),
        f"Response to +2 % of SG2's voltage reference at X_L = {v.X_L:g} pu. Dashed: without the converter. "
        "Red: lines from maximum to maximum, and ΔPkMk.",
    )
    reasons = f"{escape(v.time.swings.reason)}. By its modes: {escape(v.time.modal.reason)}."
    yield f"<p>{link}: {reasons} {verdict(v.time.accepted)}</p>"
    yield picture
    yield _swing_table(v.time, c.results[WITH, v.X_L].units[v.time.signal])
    yield _modal_table(v.time)


def response_curves(
    c: Certificate, v: PointVerdict, event_time: float
) -> tuple[str, list[ChartCurve]]:
    """The response with the norm's construction, and what it is of."""
    time = v.time
    assert time is not None
    unit = c.results[WITH, v.X_L].units[time.signal]
    curves = []
    for k, scenario in enumerate((WITHOUT, WITH)):
        point = c.results[scenario, v.X_L]
        if time.signal in point.signals:
            shown = point.times <= event_time + _SHOWN
            curves.append(
                ChartCurve(
                    f"{scenario} the converter",
                    colour(k),
                    point.times[shown],
                    point.signals[time.signal][shown],
                    dashed=scenario == WITHOUT,
                )
            )
    curves += _construction(time, event_time + _SHOWN)
    return (
        f"{'Frequency at bus 2' if time.signal == FREQUENCY else 'Active power of SG1'} [{unit}]",
        curves,
    )


def _construction(time: TimeVerdict, last: float) -> Iterator[ChartCurve]:
    red = "#a11d1d"
    for s in time.swings.swings:
        if s.after.time <= last and s.number <= 6:
            ends = (
                np.array([s.before.time, s.after.time]),
                np.array([s.before.value, s.after.value]),
            )
            yield ChartCurve(f"P{s.number}–P{s.number + 1}", red, *ends, dashed=True)
            moment = np.array([s.minimum.time, s.minimum.time + 1e-6])
            yield ChartCurve(
                f"ΔP{s.number}M{s.number}", red, moment, np.array([s.minimum.value, s.line])
            )


def _swing_table(time: TimeVerdict, unit: str) -> str:
    test = time.swings
    rows = []
    for s in test.swings[:8]:
        row = [
            text
            for p in (s.before, s.minimum, s.after)
            for text in (f"{p.time:.3f}", f"{p.value:.6f}")
        ]
        rows.append([str(s.number), *row, f"{s.line:.6f}", f"{s.depth:.6f}"])
    columns = [
        "k",
        "Pk at [s]",
        f"Pk [{unit}]",
        "Mk at [s]",
        f"Mk [{unit}]",
        "Pk+1 at [s]",
        f"Pk+1 [{unit}]",
        "Line at Mk",
        "ΔPkMk",
    ]
    note = ""
    if test.dropped:
        kind = "maximum" if test.dropped.is_maximum else "minimum"
        note = (
            f'<p class="soft">Left out: the {kind} {test.dropped.value:.6f} at {test.dropped.time:.3f} s, '
            f"towards which the oscillation starts. With it: {escape(time.other_reading.reason)}.</p>"
        )
    return (table("Maxima, minima and distances", columns, rows) if rows else "") + note


def _modal_table(time: TimeVerdict) -> str:
    rows = [[*_mode(m.eigenvalue), f"{m.amplitude:.3g}"] for m in time.modal.modes]
    caption = "Modes in the signal from 0.1 to 1.5 Hz (matrix pencil)"
    return table(caption, [*_MODE, "Amplitude"], rows) if rows else ""


def _overview(c: Certificate) -> str:
    rows = []
    for v in c.verdicts:
        worst = v.modes[0] if v.modes else None
        row = [f"{v.X_L:g}"]
        row += (
            [f"{worst.frequency_hz:.3f}", damping(worst.damping_percent)] if worst else ["–", "–"]
        )
        row += [before(worst.before) if worst else "–", *_time_cells(v.time), _verdict_cell(c, v)]
        rows.append(row)
    columns = [
        "X_L [pu]",
        "Least damped mode [Hz]",
        "Damping [%]",
        "Without the converter",
        "ΔP1M1",
        "ΔP5M5",
        "Ratio",
        "Least damping in the signal [%]",
        "Verdict",
    ]
    reasons = [(v.X_L, "; ".join(v.faults) or v.unknown) for v in c.verdicts]
    listed = "".join(
        f"<li>X_L = {X_L:g} pu: {escape(reason)}</li>" for X_L, reason in reasons if reason
    )
    return table("All line reactances, with the converter", columns, rows) + (
        f"<ul>{listed}</ul>" if listed else ""
    )


def _verdict_cell(c: Certificate, v: PointVerdict) -> str:
    beyond = "" if any(v.name == row.name for row in c.code.rows) else ", beyond the norm's"
    return (verdict(v.accepted) if v.is_judged else '<span class="bad">not judged</span>') + beyond


def _time_cells(time: TimeVerdict | None) -> list[str]:
    if time is None:
        return ["–"] * 4
    swings, test = time.swings.swings, time.swings
    first = f"{swings[0].depth:.4g}" if swings else "–"
    died_out = "died out" if test.accepted else "–"
    fifth = f"{swings[4].depth:.4g}" if len(swings) >= 5 else died_out
    depths = [first, fifth]
    ratio = "–" if test.ratio is None else f"{test.ratio:.3f}"
    least = min((m.damping_percent for m in time.modal.modes), default=None)
    return [
        *depths,
        ratio if test.accepted else f'<span class="bad">{ratio}</span>',
        "–" if least is None else damping(least),
    ]


def _remark(c: Certificate) -> Iterator[str]:
    for remark, where in remarks_on(c, damping):
        yield f"<b>{remark}</b>; {where}"


def remarks_on(
    c: Certificate, in_words: Callable[[float], str] = lambda percent: number(percent, 2)
) -> Iterator[tuple[str, str]]:
    """Yield each remark on a verdict, and where it shows; ``in_words`` writes a damping [%]."""
    lowered = [(m, v.X_L) for v in c.verdicts for m in v.lowered]
    if lowered:
        worst, X_L = min(lowered, key=lambda entry: entry[0].damping_percent)
        places = ", ".join(f"{X:g}" for X in dict.fromkeys(X for _, X in lowered))
        change = (
            f"from {number(worst.before_percent or 0.0, 2)} to {in_words(worst.damping_percent)} %"
        )
        yield (
            f"Remark: the converter lowers a damping by more than {LOWERED:g} points at X_L = {places} pu",
            f"the lowest of them at {X_L:g} pu and {worst.frequency_hz:.3f} Hz, {change}",
        )


def _where(bad: list[PointVerdict]) -> str:
    places = ", ".join(f"{v.X_L:g}" for v in bad)
    return f"not accepted at X_L = {places} pu" if bad else "accepted wherever it was judged"


def _least_and_growth(c: Certificate) -> Iterator[str]:
    least = min(
        (m for v in c.verdicts for m in v.modes), key=lambda m: m.damping_percent, default=None
    )
    if least:
        yield f"Least damping of all judged modes: {damping(least.damping_percent)} % at {least.frequency_hz:.3f} Hz"
    growing = [c.results[WITH, v.X_L] for v in c.verdicts]
    if growing and all(p.modes is not None for p in growing):
        worst = max(growing, key=lambda p: p.growth)
        words = worst.stability["sentence"] if worst.stability else f"{worst.growth:+.3g} 1/s"
        yield f"All frequencies, largest growth rate with the converter, at {worst.X_L:g} pu: {escape(words)}"


def _lowered(c: Certificate) -> str:
    rows = [
        [
            f"{v.X_L:g}",
            f"{m.frequency_hz:.3f}",
            number(m.before_percent or 0.0, 2),
            damping(m.damping_percent),
            number(m.damping_percent - (m.before_percent or 0.0), 2),
            escape(m.components),
        ]
        for v in c.verdicts
        for m in v.lowered
    ]
    columns = ["X_L [pu]", "f [Hz]", "from [%]", "to [%]", "by [points]", "Who takes part"]
    caption = (
        f"Modes whose damping is lower by more than {LOWERED:g} points than without the converter"
    )
    said = "The norm asks for 5 % only; what is here is for the reader to weigh."
    return f"{table(caption, columns, rows)}<p>{said}</p>" if rows else f"<p>{caption}: none.</p>"


def _stability(c: Certificate) -> str:
    rows = [
        [
            f"{v.X_L:g}",
            name,
            escape(p.stability["sentence"]) if p.stability else f"{p.growth:+.3g} 1/s",
        ]
        for v in c.verdicts
        for name in (WITHOUT, WITH)
        if (p := c.results[name, v.X_L]).modes is not None
    ]
    caption = "The verdict over the whole spectrum, whatever the frequency"
    note = "<p>The free angle of the system has an eigenvalue of 0, which is left out.</p>"
    return table(caption, ["X_L [pu]", "The converter", "Verdict"], rows, left=3) + note
