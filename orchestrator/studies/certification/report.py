"""The report on a damping test as one HTML page, with every figure that a person needs to check it by hand."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from html import escape

from orchestrator.devices.binding.binding import read_table
from orchestrator.devices.fmi.archive import read_origin
from orchestrator.devices.fmi.port_mapping import BoundDescription
from orchestrator.devices.fmi.values import Scalar, as_text
from orchestrator.output.report.html.elements import SHADES, Figures, bullet_list, document, table
from orchestrator.output.report.short_texts import short
from orchestrator.studies.certification.case_file import BINDING, FMU, WITH
from orchestrator.studies.certification.certificate import Certificate, DampingCertificate
from orchestrator.studies.certification.codes.record import row_chapters
from orchestrator.studies.certification.figures import commands, parameter_rows
from orchestrator.studies.certification.point import FREQUENCY
from orchestrator.studies.certification.report_criteria import (
    damping_chapters,
    damping_facts,
    damping_findings,
)
from orchestrator.studies.certification.texts import TEXTS
from orchestrator.studies.certification.verdict import FAILS, INCOMPLETE, PASSES, verdicts_on_page

_LONGEST = 160  # characters of why a row is not accepted, at the top of the page
_LINE = '<span class="blank"></span>'  # A line to be filled in by hand

Hashes = Mapping[str, str | None]


@dataclass(frozen=True)
class PageParts:
    """Parts of a page that only one kind of test has."""

    chapters: Sequence[tuple[str, str]]
    commands: Mapping[str, str]  # which compute the first part of the test again
    findings: Sequence[str] = ()  # lines of the summary at the top
    facts: Mapping[str, str] = field(default_factory=dict)  # lines of the table of the converter
    steadiness: str = ""
    study: str = ""  # of the case in which the converter was tested
    watched: str = "by_power"  # the signal that is judged in time, as the texts have it


def _parts_of(c: Certificate) -> PageParts:
    if not isinstance(c, DampingCertificate):
        again = {"response": f"gfor run {c.case.name} --out again"}
        return PageParts(row_chapters(c, Figures()), again)
    X_L = c.verdicts[0].X_L
    residual = max(p.residual for p in c.results.values())
    return PageParts(
        chapters=damping_chapters(c, Figures()),
        commands=commands(X_L, WITH, identified=c.results[WITH, X_L].identified is not None),
        findings=list(damping_findings(c)),
        facts=damping_facts(c),
        steadiness=f"Steady states hold to {residual:.1e} pu in one communication step. ",
        study=TEXTS["study"],
        watched="by_frequency" if c.signal == FREQUENCY else "by_power",
    )


def details(c: Certificate) -> str:
    rows = [
        [label, escape(text).replace("\n", "<br>") or _LINE] for label, text in c.details.rows()
    ]
    rows += [[f"Signature of the {who}", _LINE] for who in ("tester", "applicant")]
    return table("Filled in from the file of --details, or by hand", ["", ""], rows, left=2)


def converter(c: Certificate, said: PageParts, hashes: Hashes) -> str:
    origin = read_origin(c.description.path)
    values = {**c.request.values, **c.settings, **c.request.study_values}
    given = {
        "FMU": c.fmu_name,
        "Model": c.description.model_name,
        "Description": origin["description"],
        "Author": origin["author"],
        "Version": origin["version"],
        "Made by": origin["generation_tool"],
        "Made on": origin["generated"],
        "Copyright": origin["copyright"],
        "License": origin["license"],
        "FMI": f"{origin['fmi_version']}, co-simulation",
        "Guid": c.description.guid,
        "SHA-256": hashes[FMU],
        "Rating": _rating(c),
        "Voltage": _voltage(c),
        "Binding": c.binding_name or "none: the port is ours",
        "Values set": ", ".join(f"{k} = {as_text(v)}" for k, v in values.items()) or "none",
        **said.facts,
    }
    rows = [
        [escape(name), escape(str(value)) or '<span class="soft">not said</span>']
        for name, value in given.items()
    ]
    return table("The converter", ["", ""], rows, left=2)


def _rating(c: Certificate) -> str:
    used = float(c.values.get("converter.S_n", 0.0))
    if isinstance(c.description, BoundDescription):
        return f"{c.description.port.rating:g} MVA by the binding; {used:g} MVA in the study"
    info = c.description.variables.get("S_n")
    return f"{info.start if info else '?'} MVA by the FMU; {used:g} MVA in the study"


def _voltage(c: Certificate) -> str:
    if c.request.binding is None:
        return "per unit of the bus; the FMU has no rated voltage"
    given = read_table(c.request.binding).rating.V_n
    return (
        f"{given} (V_n of the binding)"
        if given is not None
        else "per unit of the bus; the binding gives no V_n"
    )


def parameters(c: Certificate) -> str:
    rows = [
        [
            escape(r.name),
            _text(r.start),
            f"<b>{_text(r.used)}</b>" if r.changed_by else _text(r.used),
            escape(r.unit),
            escape(r.changed_by or "–"),
            escape(r.description),
        ]
        for r in parameter_rows(c)
    ]
    columns = ["Parameter", "In the file", "Used", "Unit", "Changed by", "Description"]
    changed = sum(1 for r in parameter_rows(c) if r.changed_by)
    return table(
        f"All {len(rows)} parameters by the FMU's own names, {changed} of them given a value",
        columns,
        rows,
    )


def _text(value: Scalar | None) -> str:
    if value is None:
        return "–"
    return escape(as_text(value) if not isinstance(value, float) else f"{value:.12g}")


def binding(c: Certificate, hashes: Hashes) -> str:
    if c.request.binding is None:
        return "<p>None: the FMU has the variables of our port.</p>"
    text = escape(c.request.binding.read_text(encoding="utf-8"))
    return f"<p>{escape(str(c.binding_name))}, SHA-256 {hashes[BINDING]}</p><pre>{text}</pre>"


def acceptance(c: Certificate) -> str:
    if c.acceptance is None:
        return "<p>They were not run (--no-check).</p>"
    marks = {"fail": "bad", "pass": "good"}
    rows = [
        [
            escape(r["check"]),
            f'<span class="{marks.get(r["verdict"], "soft")}">{escape(r["verdict"])}</span>',
            escape(f"{r['fault']}: {r['evidence']}" if r["fault"] else r["evidence"]),
        ]
        for r in c.acceptance.checks
    ]
    said = (
        "No check failed." if c.acceptance.trusted else f"FAILED: {', '.join(c.acceptance.faults)}."
    )
    style = "good" if c.acceptance.trusted else "bad"
    listed = table("gfor fmu check", ["Check", "Verdict", "What was seen"], rows, left=3)
    return f'<p class="{style}">{escape(said)}</p>{listed}'


def provenance(c: Certificate, said: PageParts, hashes: Hashes) -> str:
    machine = table(
        "Computed on", ["", ""], [[escape(k), escape(v)] for k, v in c.computed_on.items()], left=2
    )
    files = table(
        "SHA-256 of the files beside this page",
        ["File", "SHA-256"],
        [[escape(name), str(value)] for name, value in hashes.items()],
        left=2,
    )
    first = c.verdicts[0]
    named = "".join(
        f"<li>{name}: <code>{escape(text)}</code></li>" for name, text in said.commands.items()
    )
    text = escape(c.case.read_text(encoding="utf-8"))
    return (
        f"{machine}{files}<p>{said.steadiness}Any {c.part} can be computed again in the folder "
        f"of this page; the case file holds every value that was set. For {escape(first.name)}:</p>"
        f"<ul>{named}</ul>{TEXTS['integrity']}"
        f"<details data-print><summary>Case file</summary><pre>{text}</pre></details>"
    )


def page(c: Certificate, hashes: Hashes, made: datetime) -> str:
    said = _parts_of(c)
    readings = [text.replace("{watched}", TEXTS[said.watched]) for text in c.code.readings]
    content = [
        ("For whom and by whom", details(c)),
        ("What was tested", converter(c, said, hashes) + said.study),
        *said.chapters,
        ("Acceptance tests of the FMU", acceptance(c)),
        ("Parameters of the FMU", parameters(c)),
        ("Binding", binding(c, hashes)),
        (
            "How the code was read",
            f"{bullet_list(readings)}<p>{escape(c.code.source)}, {escape(c.code.date)}.</p>",
        ),
        ("Provenance", provenance(c, said, hashes)),
    ]
    return document(title(c), c.code.title, _findings(c, said.findings), content, made)


_TITLES = {PASSES: "passed", FAILS: "failed", INCOMPLETE: "incomplete"}


def title(c: Certificate) -> str:
    word = _TITLES[c.verdict] + c.part_of_test
    if c.refused:
        word += ", acceptance tests failed"
    return f"{c.heading} of {c.description.model_name!r}: {word}"


def _findings(c: Certificate, own: Sequence[str]) -> str:
    """The verdict in one sentence, a line a row of the code, and what else was asked in short notes."""
    shade = "good" if c.passed and not c.refused else "bad"
    sentences = [
        f'<b class="{shade}">{escape(text)}</b>' for text in verdicts_on_page(c.sentence())
    ]
    checked = "not run" if c.acceptance is None else "no check failed"
    checks = [] if c.refused else [f"Acceptance tests of the FMU (gfor fmu check): {checked}"]
    notes = [*checks, *own]
    warnings = dict.fromkeys(
        text for result in c.results.values() for text in getattr(result, "warnings", ())
    )
    extra = "".join(f'<div class="warning">{escape(text)}</div>' for text in warnings)
    verdict = "".join(f'<p class="verdict">{text}</p>' for text in sentences)
    below = "".join(f"<li>{text}</li>" for text in notes)
    return (
        f'<div class="findings">{verdict}{_row_lines(c)}<ul class="soft">{below}</ul></div>{extra}'
    )


def _row_lines(c: Certificate) -> str:
    """A line for each row of a code: its verdict in its colour, and the first criterion that is not met."""
    if isinstance(c, DampingCertificate):
        return ""
    rows = []
    for verdict in c.verdicts:
        failed = verdict.failed
        why = [f"{one.criterion}: {one.text}" for one in failed[:1]] or [verdict.not_judged]
        more = f" (and {', '.join(one.criterion for one in failed[1:])})" if failed[1:] else ""
        word = {True: "accepted", False: "NOT accepted", None: "not judged"}[verdict.accepted]
        shade = SHADES[verdict.accepted]
        rows.append(
            [
                escape(verdict.name),
                f'<b class="{shade}">{word}</b>',
                escape(f"{short(why[0], _LONGEST)}{more}") or "–",
            ]
        )
    return table("Row by row", ["Row", "Verdict", "Not met"], rows, left=3)
