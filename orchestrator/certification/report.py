"""The report on a damping test as one HTML page, with every figure that a person needs to check it by hand."""

import hashlib
from collections.abc import Iterator
from html import escape
from pathlib import Path

import numpy as np

from orchestrator.certification import texts
from orchestrator.certification.criteria import damping_ratio, is_judged
from orchestrator.certification.point import FREQUENCY
from orchestrator.certification.study import WITH, WITHOUT, Certification, PointVerdict, TimeVerdict
from orchestrator.report.html.charts import Curve, Mark, complex_plane, legend, line_chart
from orchestrator.report.html.document import document
from orchestrator.report.html.elements import Figures, colour, damping, eigenvalue, table
from orchestrator.report.linearised import exceptions_in_words

_SHOWN = 30.0
"""Part of the response that is drawn, from the event on [s]; all of it is judged."""


def page(certification: Certification) -> str:
    """The page's text."""
    figures = Figures()
    content = [
        ("What was tested", _tested(certification)),
        ("Result at every line reactance", _overview(certification)),
        ("Eigenvalue criterion", _eigenvalues(certification, figures)),
        ("Time-domain criterion", _responses(certification, figures)),
        ("How the norm was read", texts.reading(certification.pod)),
        ("Provenance", _provenance(certification)),
    ]
    title = (
        f"Damping test of {certification.description.model_name!r}: {'passed' if certification.passed else 'failed'}"
    )
    return document(title, "Norma técnica de supervisión 631, section 5.10", _findings(certification), content)


def _findings(c: Certification) -> str:
    items = [f'<b class="{"good" if c.passed else "bad"}">{escape(c.sentence())}</b>']
    bad = [v for v in c.verdicts if not v.eigenvalues_accepted]
    where = f"not accepted at X_L = {', '.join(f'{v.X_L:g}' for v in bad)} pu" if bad else "accepted everywhere"
    items.append(f"Eigenvalue criterion: {where}")
    bad = [v for v in c.verdicts if v.time is None or not v.time.accepted]
    where = f"not accepted at X_L = {', '.join(f'{v.X_L:g}' for v in bad)} pu" if bad else "accepted everywhere"
    items.append(f"Time-domain criterion on {_signal_name(c.signal)}: {where}")
    least = min((m for v in c.verdicts for m in v.modes), key=lambda m: m.damping_percent, default=None)
    if least is not None:
        items.append(f"Least damping of all judged modes: {damping(least.damping_percent)} % at "
                     f"{least.frequency_hz:.3f} Hz")  # fmt: skip
    warnings = dict.fromkeys(text for point in c.points.values() for text in point.warnings)
    extra = "".join(f'<div class="warning">{escape(text)}</div>' for text in warnings)
    return f'<div class="findings"><ul>{"".join(f"<li>{item}</li>" for item in items)}</ul></div>{extra}'


def _signal_name(signal: str) -> str:
    return "the frequency at bus 2" if signal == FREQUENCY else "SG1's active power"


def _tested(c: Certification) -> str:
    given = {"FMU": c.request.fmu.name, "Model": c.description.model_name, "Made by": c.description.generation_tool,
             "Guid": c.description.guid, "SHA-256": _hash(c.case.with_name("converter.fmu")),
             "Binding": c.request.binding.name if c.request.binding else "none: the port is ours",
             "Values set": ", ".join(f"{k} = {v}" for k, v in c.request.values.items()) or "none",
             "Damping controllers": texts.PODS[c.pod], "Watched in time": _signal_name(c.signal)}  # fmt: skip
    orders = [str(p.identified) for p in c.points.values() if p.identified is not None]
    if orders:
        given["In the modes"] = f"a model identified at its port, of order {', '.join(dict.fromkeys(orders))}"
    all_perturbed = "all by perturbing the running FMUs" if c.linearised else "not recorded"
    given["Linear models"] = exceptions_in_words(c.linearised, c.fit_errors) or all_perturbed
    rows = [[escape(name), escape(str(value))] for name, value in given.items()]
    return table("The converter", ["", ""], rows, left=2) + texts.STUDY


def _hash(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _overview(c: Certification) -> str:
    rows = []
    for v in c.verdicts:
        worst = v.modes[0] if v.modes else None
        row = [f"{v.X_L:g}"]
        row += [f"{worst.frequency_hz:.3f}", damping(worst.damping_percent)] if worst else ["–", "–"]
        row += [_before(worst.before) if worst else "–", *_time_cells(v.time), _verdict(v.accepted)]
        rows.append(row)
    columns = ["X_L [pu]", "Least damped mode [Hz]", "Damping [%]", "Without the converter",
               "ΔP1M1", "ΔP5M5", "Ratio", "Least damping in the signal [%]", "Verdict"]  # fmt: skip
    faults = "".join(f"<li>X_L = {v.X_L:g} pu: {escape('; '.join(v.faults))}</li>" for v in c.verdicts if v.faults)
    return table("All line reactances, with the converter", columns, rows) + (f"<ul>{faults}</ul>" if faults else "")


def _before(value: complex | None) -> str:
    if value is None:
        return "no such mode"
    return f"{value.imag / (2 * np.pi):.3f} Hz, {damping(100 * damping_ratio(value))} %"


def _time_cells(time: TimeVerdict | None) -> list[str]:
    if time is None:
        return ["–"] * 4
    swings, test = time.swings.swings, time.swings
    depths = [f"{s.depth:.4g}" for s in (swings[0], swings[4])] if len(swings) >= 5 else [
        f"{swings[0].depth:.4g}" if swings else "–", "died out" if test.accepted else "–"]  # fmt: skip
    ratio = "–" if test.ratio is None else f"{test.ratio:.3f}"
    least = min((m.damping_percent for m in time.modal.modes), default=None)
    return [*depths, ratio if test.accepted else f'<span class="bad">{ratio}</span>',
            "–" if least is None else damping(least)]  # fmt: skip


def _verdict(accepted: bool) -> str:
    return '<span class="good">accepted</span>' if accepted else '<span class="bad">not accepted</span>'


def _eigenvalues(c: Certification, figures: Figures) -> str:
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
             _before(m.before), f"{m.similarity:.2f}", escape(m.components), _verdict(m.accepted)] for m in v.modes
        ]  # fmt: skip
        columns = ["λ [rad/s]", "f [Hz]", "Damping [%]", "Same mode without the converter", "Likeness"]
        columns += ["Who takes part", "Verdict"]
        summary = f"X_L = {v.X_L:g} pu: {len(rows)} modes from 0.1 to 1.5 Hz"
        modes = table(f"Modes at X_L = {v.X_L:g} pu", columns, rows)
        parts.append(f"<details open><summary>{summary}</summary>{modes}{_base_modes(c, v)}</details>")
    return "".join(parts)


def _base_modes(c: Certification, v: PointVerdict) -> str:
    point = c.points[WITHOUT, v.X_L]
    if point.modes is None:
        return ""
    entries = zip(point.modes.eigenvalues.tolist(), point.components, strict=True)
    rows = [
        [eigenvalue(x.real, x.imag), f"{x.imag / (2 * np.pi):.4f}", damping(100 * damping_ratio(x)), escape(words)]
        for x, words in entries
        if is_judged(x.imag / (2 * np.pi))
    ]
    return table("Without the converter", ["λ [rad/s]", "f [Hz]", "Damping [%]", "Who takes part"], rows)


def _responses(c: Certification, figures: Figures) -> str:
    return "".join(part for v in c.verdicts for part in _response(c, v, figures))


def _response(c: Certification, v: PointVerdict, figures: Figures) -> Iterator[str]:
    yield f"<h3>X_L = {v.X_L:g} pu</h3>"
    if v.time is None:
        yield f'<p class="bad">{escape("; ".join(v.faults))}</p>'
        return
    unit = c.points[WITH, v.X_L].units[v.time.signal]
    curves = []
    for k, scenario in enumerate((WITHOUT, WITH)):
        point = c.points[scenario, v.X_L]
        if v.time.signal in point.signals:
            shown = point.times <= c.event_time + _SHOWN
            curves.append(Curve(f"{scenario} the converter", colour(k), point.times[shown],
                                point.signals[v.time.signal][shown], dashed=scenario == WITHOUT))  # fmt: skip
    curves += _construction(v.time, c.event_time + _SHOWN)
    label = f"{'Frequency at bus 2' if v.time.signal == FREQUENCY else 'Active power of SG1'} [{unit}]"
    picture, link = figures.add(
        line_chart(f"Response at X_L = {v.X_L:g} pu", "Time [s]", label, curves),
        f"Response to +2 % of SG2's voltage reference at X_L = {v.X_L:g} pu. Dashed: without the converter. "
        "Red: lines from maximum to maximum, and ΔPkMk.",
    )
    reasons = f"{escape(v.time.swings.reason)}. By its modes: {escape(v.time.modal.reason)}."
    yield f"<p>{link}: {reasons} {_verdict(v.time.accepted)}</p>"
    yield picture
    yield _swing_table(v.time, unit)
    yield _modal_table(v.time)


def _construction(time: TimeVerdict, last: float) -> Iterator[Curve]:
    """The norm's lines, as far as they are in the picture."""
    red = "#a11d1d"
    for s in time.swings.swings:
        if s.after.time <= last and s.number <= 6:
            ends = np.array([s.before.time, s.after.time]), np.array([s.before.value, s.after.value])
            yield Curve(f"P{s.number}–P{s.number + 1}", red, *ends, dashed=True)
            moment = np.array([s.minimum.time, s.minimum.time + 1e-6])
            yield Curve(f"ΔP{s.number}M{s.number}", red, moment, np.array([s.minimum.value, s.line]))


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


def _provenance(c: Certification) -> str:
    worst = max((p.residual for p in c.points.values()), default=float("nan"))
    repeat = f"gfor modes {c.case.name} --scenario with --set grid.X_L=0.3 --range 0.05:2"
    text = escape(c.case.read_text(encoding="utf-8"))
    return (
        f"<p>Steady states hold to {worst:.1e} pu in one communication step. Any point can be "
        f"computed again beside this page, for example with <code>{escape(repeat)}</code>.</p>"
        f"<details><summary>Case file</summary><pre>{text}</pre></details>"
    )
