"""The report on a damping test as one HTML page, with every figure that a person needs to check it by hand."""

import tomllib
from collections.abc import Iterable, Iterator, Mapping
from datetime import datetime
from html import escape
from pathlib import Path

from orchestrator.analysis.linear_model import PACKED
from orchestrator.binding.binding import read_table
from orchestrator.certification.case_file import BINDING, FMU, WITH, WITHOUT
from orchestrator.certification.environment import environment
from orchestrator.certification.figures import commands, parameter_rows
from orchestrator.certification.judgement import LOWERED, PointVerdict, TimeVerdict
from orchestrator.certification.pod_effect import pod_section
from orchestrator.certification.point import CONVERTER, FREQUENCY, PointResult
from orchestrator.certification.report_criteria import before, eigenvalues, responses, verdict
from orchestrator.certification.request import REACTANCES, missing_reactances
from orchestrator.certification.study import Certification
from orchestrator.certification.verdict import FAILS, INCOMPLETE, PASSES
from orchestrator.fmi.origin import read_origin
from orchestrator.fmi.port import BoundDescription
from orchestrator.fmi.values import Scalar, as_text
from orchestrator.report.html.elements import Figures, damping, document, number, table
from orchestrator.report.linearised import exceptions_in_words

PODS = {"none": "none", "p": "POD-P", "q": "POD-Q", "pq": "POD-P and POD-Q"}

_TEXTS: dict[str, str] = tomllib.loads(Path(__file__).with_name("texts.toml").read_text(encoding="utf-8"))
STUDY, INTEGRITY = _TEXTS["study"], _TEXTS["integrity"]


def reading(pod: str) -> str:
    """The rules as they were applied, with the decisions where the norm leaves a choice."""
    watched = "by_frequency" if "p" in pod.removeprefix("none") else "by_power"
    return _TEXTS["reading"].format(watched=_TEXTS[watched])


def converter_model(points: Iterable[PointResult]) -> str:
    known = [p for p in points if p.modes is not None]
    boxes = [p for p in known if p.identified is not None]
    if boxes:
        orders = ", ".join(dict.fromkeys(str(p.identified) for p in boxes))
        error = max(p.fit_errors.get(CONVERTER, 0.0) for p in boxes)
        return (
            f"Black box: a model identified at its port, of order {orders}; largest relative fitting error {error:.1e}"
        )
    if any(p.linearised.get(CONVERTER) == PACKED for p in known):
        return (
            "The model packed in the FMU stands for the converter in the modes; it was compared with its own response"
        )
    return "White box: the FMU's own states were perturbed" if known else "Modes of the converter are not known"


_LINE = '<span class="blank"></span>'  # A line to be filled in by hand

Hashes = Mapping[str, str | None]


def details(c: Certification) -> str:
    rows = [[label, escape(text).replace("\n", "<br>") or _LINE] for label, text in c.details.rows()]
    rows += [[f"Signature of the {who}", _LINE] for who in ("tester", "applicant")]
    return table("Filled in from the file of --details, or by hand", ["", ""], rows, left=2)


def signal_name(signal: str) -> str:
    return "the frequency at bus 2" if signal == FREQUENCY else "SG1's active power"


def converter(c: Certification, hashes: Hashes) -> str:
    origin = read_origin(c.description.path)
    values = {**c.request.values, **c.controllers.settings, **c.request.study_values}
    given = {
        "FMU": c.request.fmu.name, "Model": c.description.model_name, "Description": origin.description,
        "Author": origin.author, "Version": origin.version, "Made by": origin.generation_tool,
        "Made on": origin.generated, "Copyright": origin.copyright, "License": origin.license,
        "FMI": f"{origin.fmi_version}, co-simulation", "Guid": c.description.guid, "SHA-256": hashes[FMU],
        "Rating": _rating(c), "Voltage": _voltage(c),
        "Binding": c.request.binding.name if c.request.binding else "none: the port is ours",
        "Values set": ", ".join(f"{k} = {as_text(v)}" for k, v in values.items()) or "none",
        "Damping controllers": f"{PODS[c.pod]}: {c.controllers.source}",
        "Watched in time": signal_name(c.signal),
        "In the modes": converter_model(c.points[WITH, v.X_L] for v in c.verdicts),
        "Linear models": exceptions_in_words(c.linearised, c.fit_errors)
        or ("all by perturbing the running FMUs" if c.linearised else "not recorded"),
    }  # fmt: skip
    rows = [[escape(name), escape(str(value)) or '<span class="soft">not said</span>'] for name, value in given.items()]
    return table("The converter", ["", ""], rows, left=2)


def _rating(c: Certification) -> str:
    used = float(c.values.get("converter.S_n", 0.0))
    if isinstance(c.description, BoundDescription):
        return f"{c.description.port.rating:g} MVA by the binding; {used:g} MVA in the study"
    info = c.description.variables.get("S_n")
    return f"{info.start if info else '?'} MVA by the FMU; {used:g} MVA in the study"


def _voltage(c: Certification) -> str:
    if c.request.binding is None:
        return "per unit of the bus; the FMU has no rated voltage"
    given = read_table(c.request.binding).rating.V_n
    return f"{given} (V_n of the binding)" if given is not None else "per unit of the bus; the binding gives no V_n"


def parameters(c: Certification) -> str:
    rows = [
        [escape(r.name), _text(r.start), f"<b>{_text(r.used)}</b>" if r.changed_by else _text(r.used),
         escape(r.unit), escape(r.changed_by or "–"), escape(r.description)] for r in parameter_rows(c)
    ]  # fmt: skip
    columns = ["Parameter", "In the file", "Used", "Unit", "Changed by", "Description"]
    changed = sum(1 for r in parameter_rows(c) if r.changed_by)
    return table(f"All {len(rows)} parameters by the FMU's own names, {changed} of them given a value", columns, rows)


def _text(value: Scalar | None) -> str:
    if value is None:
        return "–"
    return escape(as_text(value) if not isinstance(value, float) else f"{value:.12g}")


def binding(c: Certification, hashes: Hashes) -> str:
    if c.request.binding is None:
        return "<p>None: the FMU has the variables of our port.</p>"
    text = escape(c.request.binding.read_text(encoding="utf-8"))
    return f"<p>{escape(c.request.binding.name)}, SHA-256 {hashes[BINDING]}</p><pre>{text}</pre>"


def acceptance(c: Certification) -> str:
    if c.acceptance is None:
        return "<p>They were not run (--no-check).</p>"
    marks = {"fail": "bad", "pass": "good"}
    rows = [
        [escape(r["check"]), f'<span class="{marks.get(r["verdict"], "soft")}">{escape(r["verdict"])}</span>',
         escape(f"{r['fault']}: {r['evidence']}" if r["fault"] else r["evidence"])] for r in c.acceptance.checks
    ]  # fmt: skip
    said = "No check failed." if c.acceptance.trusted else f"FAILED: {', '.join(c.acceptance.faults)}."
    style = "good" if c.acceptance.trusted else "bad"
    listed = table("gfor fmu check", ["Check", "Verdict", "What was seen"], rows, left=3)
    return f'<p class="{style}">{escape(said)}</p>{listed}'


def provenance(c: Certification, hashes: Hashes) -> str:
    machine = table("Computed on", ["", ""], [[escape(k), escape(v)] for k, v in environment().items()], left=2)
    files = table("SHA-256 of the files beside this page", ["File", "SHA-256"],
                  [[escape(name), str(value)] for name, value in hashes.items()], left=2)  # fmt: skip
    worst = max((p.residual for p in c.points.values()), default=float("nan"))
    X_L = c.verdicts[0].X_L if c.verdicts else 0.1
    having = c.points[WITH, X_L]
    again = commands(X_L, WITH, identified=having.identified is not None)
    listed = "".join(f"<li>{name}: <code>{escape(text)}</code></li>" for name, text in again.items())
    text = escape(c.case.read_text(encoding="utf-8"))
    return (
        f"{machine}{files}<p>Steady states hold to {worst:.1e} pu in one communication step. Any point can be computed "
        f"again in the folder of this page; the case file holds every value that was set. For X_L = {X_L:g} pu:</p>"
        f"<ul>{listed}</ul>{INTEGRITY}"
        f"<details data-print><summary>Case file</summary><pre>{text}</pre></details>"
    )


_TITLES = {PASSES: "passed", FAILS: "failed", INCOMPLETE: "incomplete"}


def page(certification: Certification, hashes: Mapping[str, str | None], made: datetime) -> str:
    figures = Figures()
    content = [
        ("For whom and by whom", details(certification)),
        ("What was tested", converter(certification, hashes) + STUDY),
        ("Result at every line reactance", _overview(certification)),
        ("Dampings that the converter lowers", _lowered(certification)),
        ("Stability at all frequencies", _stability(certification)),
        ("Eigenvalue criterion", eigenvalues(certification, figures)),
        ("Time-domain criterion", responses(certification, figures)),
        ("What the damping controllers change", pod_section(certification.verdicts)),
        ("Acceptance tests of the FMU", acceptance(certification)),
        ("Parameters of the FMU", parameters(certification)),
        ("Binding", binding(certification, hashes)),
        ("How the norm was read", reading(certification.pod)),
        ("Provenance", provenance(certification, hashes)),
    ]
    return document(title(certification), "Norma técnica de supervisión 631, section 5.10", _findings(certification),
                    content, made)  # fmt: skip


def title(c: Certification) -> str:
    word = _TITLES[c.verdict]
    if c.missing:
        word += f" ({len(REACTANCES) - len(c.missing)} of {len(REACTANCES)})"
    if c.refused:
        word += ", acceptance tests failed"
    return f"Damping test of {c.description.model_name!r}: {word}"


def _findings(c: Certification) -> str:
    good = c.passed and not c.refused
    items = [f'<b class="{"good" if good else "bad"}">{escape(c.sentence())}</b>']
    items.append(f"Eigenvalue criterion: {_where([v for v in c.verdicts if v.judged and not v.eigenvalues_accepted])}")
    bad = [v for v in c.verdicts if v.judged and (v.time is None or not v.time.accepted)]
    items.append(f"Time-domain criterion on {signal_name(c.signal)}: {_where(bad)}")
    items.append(escape(converter_model(c.points[WITH, v.X_L] for v in c.verdicts)))
    items.append(f"Damping controllers: {PODS[c.pod]} ({escape(c.controllers.source)})")
    checked = "not run" if c.acceptance is None else "no check failed" if c.acceptance.trusted else "FAILED"
    items.append(f"Acceptance tests of the FMU (gfor fmu check): {checked}")
    items += _least_and_growth(c)
    items += _remark(c)
    if c.acceptance is not None and c.refused:
        items = [f'<b class="bad">ACCEPTANCE TESTS FAILED: {escape(", ".join(c.acceptance.faults))}</b>', *items]
    warnings = dict.fromkeys(text for point in c.points.values() for text in point.warnings)
    extra = "".join(f'<div class="warning">{escape(text)}</div>' for text in warnings)
    return f'<div class="findings"><ul>{"".join(f"<li>{item}</li>" for item in items)}</ul></div>{extra}'


def _remark(c: Certification) -> Iterator[str]:
    lowered = [(m, v.X_L) for v in c.verdicts for m in v.lowered]
    if lowered:
        worst, X_L = min(lowered, key=lambda entry: entry[0].damping_percent)
        places = ", ".join(f"{X:g}" for X in dict.fromkeys(X for _, X in lowered))
        change = f"from {number(worst.before_percent or 0.0, 2)} to {damping(worst.damping_percent)} %"
        yield (
            f"<b>Remark: the converter lowers a damping by more than {LOWERED:g} points at X_L = {places} pu</b>; the "
            f"lowest of them at {X_L:g} pu and {worst.frequency_hz:.3f} Hz, {change}"
        )


def _where(bad: list[PointVerdict]) -> str:
    places = ", ".join(f"{v.X_L:g}" for v in bad)
    return f"not accepted at X_L = {places} pu" if bad else "accepted wherever it was judged"


def _least_and_growth(c: Certification) -> Iterator[str]:
    least = min((m for v in c.verdicts for m in v.modes), key=lambda m: m.damping_percent, default=None)
    if least is not None:
        yield f"Least damping of all judged modes: {damping(least.damping_percent)} % at {least.frequency_hz:.3f} Hz"
    growing = [c.points[WITH, v.X_L] for v in c.verdicts]
    if growing and all(p.modes is not None for p in growing):
        worst = max(growing, key=lambda p: p.growth)
        words = worst.stability["sentence"] if worst.stability else f"{worst.growth:+.3g} 1/s"
        yield f"All frequencies, largest growth rate with the converter, at {worst.X_L:g} pu: {escape(words)}"


def _overview(c: Certification) -> str:
    rows = []
    for v in c.verdicts:
        worst = v.modes[0] if v.modes else None
        row = [f"{v.X_L:g}"]
        row += [f"{worst.frequency_hz:.3f}", damping(worst.damping_percent)] if worst else ["–", "–"]
        row += [before(worst.before) if worst else "–", *_time_cells(v.time), _said(v)]
        rows.append(row)
    columns = ["X_L [pu]", "Least damped mode [Hz]", "Damping [%]", "Without the converter",
               "ΔP1M1", "ΔP5M5", "Ratio", "Least damping in the signal [%]", "Verdict"]  # fmt: skip
    reasons = [(v.X_L, "; ".join(v.faults) or v.unknown) for v in c.verdicts]
    listed = "".join(f"<li>X_L = {X_L:g} pu: {escape(reason)}</li>" for X_L, reason in reasons if reason)
    return table("All line reactances, with the converter", columns, rows) + (f"<ul>{listed}</ul>" if listed else "")


def _said(v: PointVerdict) -> str:
    beyond = "" if len(missing_reactances([v.X_L])) < len(missing_reactances([])) else ", beyond the norm's"
    return (verdict(v.accepted) if v.judged else '<span class="bad">not judged</span>') + beyond


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


def _lowered(c: Certification) -> str:
    rows = [
        [f"{v.X_L:g}", f"{m.frequency_hz:.3f}", number(m.before_percent or 0.0, 2), damping(m.damping_percent),
         number(m.damping_percent - (m.before_percent or 0.0), 2), escape(m.components)]
        for v in c.verdicts for m in v.lowered
    ]  # fmt: skip
    columns = ["X_L [pu]", "f [Hz]", "from [%]", "to [%]", "by [points]", "Who takes part"]
    caption = f"Modes whose damping is lower by more than {LOWERED:g} points than without the converter"
    said = "The norm asks for 5 % only; what is here is for the reader to weigh."
    return f"{table(caption, columns, rows)}<p>{said}</p>" if rows else f"<p>{caption}: none.</p>"


def _stability(c: Certification) -> str:
    rows = [
        [f"{v.X_L:g}", name, escape(p.stability["sentence"]) if p.stability else f"{p.growth:+.3g} 1/s"]
        for v in c.verdicts for name in (WITHOUT, WITH) if (p := c.points[name, v.X_L]).modes is not None
    ]  # fmt: skip
    caption = "The verdict over the whole spectrum, whatever the frequency"
    note = "<p>The free angle of the system has an eigenvalue of 0, which is left out.</p>"
    return table(caption, ["X_L [pu]", "The converter", "Verdict"], rows, left=3) + note
