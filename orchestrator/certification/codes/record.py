"""What the files of a code's certificate hold: its figures, its responses and its page."""

from dataclasses import asdict
from datetime import datetime
from html import escape
from typing import Any

import xarray as xr

from orchestrator.certification.codes.certificate import CodeCertificate
from orchestrator.certification.codes.row import RowFinding
from orchestrator.certification.codes.row_pictures import row_pictures
from orchestrator.certification.codes.row_verdict import NO_VERDICT, NOT_JUDGED, RowVerdict
from orchestrator.certification.environment import environment
from orchestrator.certification.form import CODE
from orchestrator.certification.margins import margin_of
from orchestrator.report.html.elements import Figures, document, table


def code_responses(certificate: CodeCertificate) -> xr.Dataset:
    """Signals of every row over a time of its own: ``row.signal`` over ``time_row`` [s, pu]."""
    data, coordinates = {}, {}
    for name, result in certificate.results.items():
        along = f"time_{name}"
        coordinates[along] = (along, result.times, {"units": "s"})
        for signal, values in result.signals.items():
            data[f"{name}.{signal}"] = (along, values, {"units": "pu"})
    return xr.Dataset(data, coords=coordinates, attrs={"source": "gfor certify"})


def code_json(c: CodeCertificate) -> dict[str, Any]:
    return {
        "format": CODE, "code": c.code.key, "title": c.code.title, "source": c.code.source, "date": c.code.date,
        "f_n": c.f_n, "verdict": c.verdict, "sentence": c.sentence(), "model": c.description.model_name,
        "binding": c.request.binding.name if c.request.binding else None,
        "values": dict(c.request.values), "declared": dict(c.code.declared),
        "left_out": list(c.code.left_out), "readings": list(c.code.readings), "departures": list(c.departures),
        "missing": list(c.missing), "rows": [_row(v, c) for v in c.verdicts],
        "acceptance": c.acceptance.report if c.acceptance else None, "environment": environment(),
    }  # fmt: skip


def _row(v: RowVerdict, c: CodeCertificate) -> dict[str, Any]:
    return {
        "row": v.row.name, "title": v.row.title, "clause": v.row.clause, "judged": v.judged, "accepted": v.accepted,
        "unknown": v.unknown, "criteria": [asdict(f) for f in v.findings],
        "findings": c.results[v.row.name].findings,
    }  # fmt: skip


def code_page(c: CodeCertificate, made: datetime, mark: str) -> str:
    """The page of a certificate; ``mark`` is the hash of its figures."""
    rows = [
        [escape(v.row.name), escape(v.row.clause), escape(v.row.title), escape(f.criterion), escape(f.rule),
         "the code's" if f.origin == "code" else "reading", escape(f.text), margin_of(f), _word(v, f)]
        for v in c.verdicts for f in v.findings
    ]  # fmt: skip
    rows += [[escape(v.row.name), escape(v.row.clause), escape(v.row.title), "", "", "", escape(v.unknown), "–",
              NOT_JUDGED] for v in c.verdicts if v.unknown]  # fmt: skip
    columns = ["Row", "Clause", "Stimulus", "Criterion", "Rule", "Number is", "Found", "Margin", "Verdict"]
    shown_rows = [r.name for r in c.code.rows if r.shown_only]
    source = f"<p>{escape(c.code.source)}, {escape(c.code.date)}. Figures: SHA-256 {mark}.</p>"
    details = [[escape(label), escape(text)] for label, text in c.details.rows()]
    sections = [
        ("For whom and by whom", table("Details", ["", ""], details, left=2)),
        ("Result", table("All criteria", columns, rows, left=9) + _list("The code gives no verdict on", shown_rows)),
        ("Responses and their limits", _pictures(c)),
        ("What was not tested", _list("", [*c.code.left_out, *c.departures])),
        ("How the code was read", _list("", c.code.readings)),
        ("Source", source),
    ]
    return document(f"{c.code.key.upper()}: {c.verdict}", c.code.title, f"<p><b>{escape(c.sentence())}</b></p>",
                    sections, made)  # fmt: skip


def _pictures(c: CodeCertificate) -> str:
    figures, parts = Figures(), []
    for v in c.verdicts:
        if content := row_pictures(v, c.results[v.row.name], c.f_n, figures):
            word = "accepted" if v.accepted else NO_VERDICT if v.row.shown_only else "not accepted"
            title = escape(f"{v.row.name}: {v.row.title}: {word}")
            parts.append(f"<details{'' if v.accepted else ' open'}><summary>{title}</summary>{content}</details>")
    return "".join(parts)


def _list(heading: str, texts: Any) -> str:
    items = "".join(f"<li>{escape(text)}</li>" for text in texts)
    return (f"<p>{escape(heading)}</p>" if heading and items else "") + (f"<ul>{items}</ul>" if items else "")


def _word(verdict: RowVerdict, finding: RowFinding) -> str:
    word = verdict.word(finding)
    return f'<span class="bad">{word}</span>' if finding.accepted is False else word
