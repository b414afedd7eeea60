"""Records of what failed criteria would take: tables for a terminal, JSON, and a page."""

from collections.abc import Sequence
from dataclasses import asdict
from datetime import UTC, datetime
from html import escape
from pathlib import Path
from typing import Any

from orchestrator.core.safe_files import write_text
from orchestrator.output.report.column_table import ShownTable
from orchestrator.output.report.html.elements import document, table
from orchestrator.output.results.file_writers import save_json
from orchestrator.studies.certification.codes.sensitivity import MarginSensitivity
from orchestrator.studies.certification.codes.what_it_takes import (
    ChangePlan,
    ConfirmedChange,
    CriterionNeeds,
)
from orchestrator.studies.certification.margins import margin_text
from orchestrator.studies.certification.texts import TEXTS
from orchestrator.studies.sensitivities.parameters import Parameter

FORMAT = "margin-sensitivities-1"  # form of the JSON
# names of files in the results
NEEDS_HTML = "sensitivities.html"
NEEDS_JSON = "sensitivities.json"

_COLUMNS = ("Parameter", "Value", "Margin below", "Margin above", "Points per %", "Remark")


def save_needs(plan: ChangePlan, needs: Sequence[CriterionNeeds], folder: Path) -> list[Path]:
    made = datetime.now(UTC).replace(microsecond=0)
    content = {"made": made.isoformat(), **needs_json(plan, needs)}
    save_json(content, folder / NEEDS_JSON)
    write_text(folder / NEEDS_HTML, _page(plan, needs, made))
    return [folder / NEEDS_HTML, folder / NEEDS_JSON]


def needs_json(plan: ChangePlan, needs: Sequence[CriterionNeeds]) -> dict[str, Any]:
    return {
        "format": FORMAT,
        "code": plan.certificate.code.key,
        "change": plan.change,
        "failed": [_need_json(need) for need in needs],
        "left_out": dict(plan.left_out),
    }


def _need_json(need: CriterionNeeds) -> dict[str, Any]:
    return {
        "row": need.row,
        **asdict(need.criterion),
        "sensitivities": [_row_json(s) for s in need.sensitivities],
        "confirmed": None if need.confirmed is None else _confirmed_json(need.confirmed),
    }


def _row_json(s: MarginSensitivity) -> dict[str, Any]:
    p = s.parameter
    return {
        "parameter": p.variable,
        "value": p.value,
        "unit": p.unit,
        "variability": "tunable" if p.tunable else "fixed",
        "margin_below": s.below,
        "margin_above": s.above,
        "met_below": s.met[0],
        "met_above": s.met[1],
        "margin_per_relative_change": s.slope,
        "points_per_percent": _points(s.per_percent),
        "relative_to": p.scale,
        "doubts": "; ".join(s.doubts),
        "reason": s.reason,
    }


def _confirmed_json(c: ConfirmedChange) -> dict[str, Any]:
    return {
        "parameter": c.parameter.variable,
        "value": c.value,
        "relative_change": c.change,
        "margin_by_straight_line": c.straight_line,
        "margin": c.margin,
        "met": c.met,
        "row_fails": list(c.failing),
        "reason": c.reason,
    }


def needs_table(need: CriterionNeeds, *, whole: bool = False) -> ShownTable:
    """The sensitivities of a criterion; ``whole``: those of parameters without any effect as well."""
    rows = [_cells(s) for s in need.sensitivities if whole or not s.idle]
    return ShownTable(_title(need), _COLUMNS, rows)


def remarks_of(need: CriterionNeeds) -> list[str]:
    """Return what else is to be said of a criterion, as sentences: parameters without effect, and runs that meet it."""
    idle = [s.parameter.variable for s in need.sensitivities if s.idle]
    said = (
        [f"No effect at all, to the last bit of the response: {', '.join(idle)}."] if idle else []
    )
    met = [_setting(s.parameter, value) for s in need.sensitivities for value in s.values_that_meet]
    return (
        [*said, f"Met, as it was run, with {' or '.join(met)}; other rows were not run."]
        if met
        else said
    )


def _setting(parameter: Parameter, value: float) -> str:
    unit = "" if parameter.unit == "1" else f" {parameter.unit}"
    return f"{parameter.variable} = {value:.5g}{unit}"


def confirmed_text(need: CriterionNeeds) -> str:
    c = need.confirmed
    if c is None:
        return f"{need.row}, {need.criterion.criterion}: no parameter moves it smoothly, so that no change was tried."
    tried = f"{need.row}, {need.criterion.criterion}: with {_setting(c.parameter, c.value)}"
    if c.met is None:
        return f"{tried} the row gives no such figure: {' '.join(c.reason.split()).rstrip('.')}."
    word = "met" if c.met else "not met"
    found = f"{tried} it is {word}, with a margin of {margin_text(c.margin)}"
    found += f" ({margin_text(c.straight_line)} by the straight line)."
    rest = ", ".join(name for name in c.failing if name != need.criterion.criterion)
    return f"{found} {f'Not met in the row: {rest}.' if rest else 'The row meets all else.'} Other rows were not run."


def plan_text(plan: ChangePlan) -> str:
    rows = ", ".join(v.row.name for v in plan.rows)
    long = f"{plan.seconds / 60:.1f} minutes" if plan.seconds >= 90 else f"{plan.seconds:.0f} s"
    return (
        f"{len(plan.tasks)} runs of {rows}: {len(plan.parameters)} parameters by ±{100 * plan.change:g} %, about "
        f"{long} of one processor by what the rows took; runs that are kept are not repeated."
    )


def left_out_text(plan: ChangePlan) -> str:
    """Which parameters are not changed, by the reason; empty where all are."""
    reasons: dict[str, list[str]] = {}
    for name, why in plan.left_out.items():
        reasons.setdefault(why, []).append(name)
    return "; ".join(f"{why}: {', '.join(names)}" for why, names in reasons.items())


def _title(need: CriterionNeeds) -> str:
    c = need.criterion
    of = " of the run" if c.timed else ""
    return f"{need.row}, {c.criterion}: margin {margin_text(c.margin)}{of} ({c.text})"


def _cells(s: MarginSensitivity) -> list[str]:
    p = s.parameter
    value = f"{p.value:.5g}" + ("" if p.unit == "1" else f" {p.unit}")
    points = _points(s.per_percent)
    slope = "–" if points is None else f"{points:+.3g}".replace("-", "−")
    slope = "0" if points == 0 else slope
    remark = [" ".join(text.split()) for text in ([s.reason] if s.reason else s.doubts)]
    remark += [f"met {word}" for word, met in zip(("below", "above"), s.met, strict=True) if met]
    remark += ["per hundredth of its unit"] if not p.value else []
    return [p.variable, value, margin_text(s.below), margin_text(s.above), slope, "; ".join(remark)]


def _points(per_percent: float | None) -> float | None:
    return None if per_percent is None else 100 * per_percent


def _page(plan: ChangePlan, needs: Sequence[CriterionNeeds], made: datetime) -> str:
    sections = []
    for need in needs:
        texts = [
            *remarks_of(need),
            *([confirmed_text(need)] if any(n.confirmed for n in needs) else []),
        ]
        said = "".join(f"<p>{escape(text)}</p>" for text in texts)
        heading = f"{need.row}: {need.criterion.criterion}"
        sections.append((heading, needs_table(need, whole=True).html() + said))
    left = [[escape(name), escape(why)] for name, why in plan.left_out.items()]
    sections.append(
        ("Parameters that were not changed", table("Left out", ["Parameter", "Why"], left, left=2))
    )
    model = plan.certificate.description.model_name
    change = f"Each parameter was changed by ±{100 * plan.change:g} % of itself."
    findings = f"<p>{change} {escape(TEXTS['sensitivities'])}</p>"
    title = f"What {model!r} lacks for {plan.certificate.code.key.upper()}"
    return document(title, plan.certificate.code.title, findings, sections, made)
