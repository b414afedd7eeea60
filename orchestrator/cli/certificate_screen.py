"""The first screen of a certificate: the verdict on the whole and on each row, then what its criteria found."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.text import Text

from orchestrator.analysis.modes import damping_ratio
from orchestrator.certification.certificate import Certificate, Judged
from orchestrator.certification.codes.certificate import CodeCertificate
from orchestrator.certification.codes.row_verdict import NO_VERDICT, NOT_JUDGED
from orchestrator.certification.judgement import PointVerdict
from orchestrator.certification.margins import margin_of, narrowest
from orchestrator.certification.study import Certification
from orchestrator.certification.verdict import FAILS, INCOMPLETE
from orchestrator.fmi.port import BoundDescription
from orchestrator.report.tables import PlainTable, make_table, short
from orchestrator.watch.finding import MISFIT

_LONGEST = 100  # of a remark in the first table [characters]


def show(found: Certificate[Judged], files: Sequence[Path], folder: Path, console: Console) -> None:
    colour = {INCOMPLETE: "yellow"}.get(found.verdict, "green" if found.passed and not found.refused else "red")
    said = found.sentence()
    if isinstance(found, CodeCertificate) and found.departures:
        said += f" Not as the code has it: {', '.join(found.departures)}."
    console.print(f"[bold {colour}]{escape(said)}[/]", soft_wrap=True)
    if isinstance(found, Certification):
        _show_damping_test(found, console)
    elif isinstance(found, CodeCertificate):
        console.print(_verdicts(found), "")
        for text in _remarks(found):
            console.print(escape(text), soft_wrap=True, highlight=False)
        console.print(_criteria(found), "")
    console.print(escape(f"Report in {folder}: {', '.join(f.name for f in files)}"), soft_wrap=True)


def _verdicts(found: CodeCertificate) -> PlainTable:
    table = make_table(f"{found.code.title}: {found.description.model_name}", "Row", "Verdict", "Criteria met",
                       "Least margin", "Remark", left=99)  # fmt: skip
    judged = [v for v in found.verdicts if v.judged]
    bad, unknown = [v for v in judged if not v.accepted], [v for v in found.verdicts if v.unknown]
    counted = [f"{len(judged)} judged", f"{len(bad)} failed", f"{len(found.verdicts) - len(judged)} not judged"]
    colour = {FAILS: "red", INCOMPLETE: "yellow"}.get(found.verdict, "green")
    table.add_row("all", Text(found.verdict, style=f"bold {colour}"), "", "", ", ".join(counted))
    for v in found.verdicts:
        known = [f for f in v.findings if f.accepted is not None]
        least = narrowest(known)
        word = NOT_JUDGED if v in unknown else NO_VERDICT if not v.judged else "fails" if v in bad else "accepted"
        failed = "; ".join(f"{f.criterion}: {f.text}" for f in v.failed)
        remark = v.unknown or failed or (f"nearest: {least.criterion}" if least else "")
        margin = "–" if least is None else margin_of(least)
        met = f"{sum(f.accepted is True for f in known)} of {len(v.findings)}"
        table.add_row(v.row.name, word, met, margin, short(remark, _LONGEST))
    return table


def _remarks(found: CodeCertificate) -> list[str]:
    """Remarks on the device, its acceptance tests and parts not tested, each once."""
    said = _misfits(r.findings for r in found.results.values())
    if isinstance(found.description, BoundDescription):
        said += [f"the binding has {text}" for text in found.description.unlike_delivered().values()]
    if left := [part for part in found.missing if part not in found.departures]:
        said.append(f"Not tested: {'; '.join(left)}")
    return list(dict.fromkeys(said))


def _misfits(findings: Iterable[Sequence[Mapping[str, Any]]]) -> list[str]:
    return list(dict.fromkeys(str(f["message"]) for found in findings for f in found if f["kind"] == MISFIT))


def _criteria(found: CodeCertificate) -> PlainTable:
    table = make_table("Criteria", "Row", "Criterion", "Found", "Margin", "", left=99)
    for v in found.verdicts:
        for f in v.findings:
            table.add_row(v.row.name, f.criterion, short(f.text, 160), margin_of(f), v.word(f))
    return table


def _show_damping_test(found: Certification, console: Console) -> None:
    for text in _misfits(p.findings for p in found.points.values()):
        console.print(escape(text), soft_wrap=True, highlight=False)
    table = make_table(f"Damping test, {found.signal} watched", "X_L [pu]", "least damped [Hz]", "ξ [%]",
                       "the same without", "ΔP5M5/ΔP1M1", "in the signal: ξ [%]", "", left=0)  # fmt: skip
    for v in found.verdicts:
        table.add_row(f"{v.X_L:g}", *_figures(v), "accepted" if v.accepted else
                      Text("not accepted" if v.judged else NOT_JUDGED, "red"))  # fmt: skip
    console.print(table, "")
    for v in found.verdicts:
        if said := v.of_base_critical():
            console.print(f"X_L = {v.X_L:g} pu: {escape(said)}", soft_wrap=True, highlight=False)
    if found.stored:
        console.print(f"{found.stored} of {len(found.points)} points were there already")


def _figures(v: PointVerdict) -> Iterator[str]:
    worst = v.modes[0] if v.modes else None
    yield from ("–", "–") if worst is None else (f"{worst.frequency_hz:.3f}", f"{worst.damping_percent:.2f}")
    before = worst.before if worst else None
    yield "–" if before is None else f"{before.imag / (2 * np.pi):.3f} Hz, {100 * damping_ratio(before):.2f} %"
    ratio = v.time.swings.ratio if v.time else None
    seen = min((m.damping_percent for m in v.time.modal.modes), default=None) if v.time else None
    yield "–" if ratio is None else f"{ratio:.3f}"
    yield "–" if seen is None else f"{seen:.2f}"
