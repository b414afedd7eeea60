"""A screening as Python has it, as tables, as JSON, as files and as a page."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import asdict
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from rich.markup import escape as escape_markup

from orchestrator.cases.settings.layers import joined_values
from orchestrator.core.errors import Problem, few, number_of
from orchestrator.core.late import pd
from orchestrator.core.options import Option
from orchestrator.core.safe_files import made_folder, write_text
from orchestrator.core.truth import NoTruth
from orchestrator.output.report.colours import colour
from orchestrator.output.report.column_table import Column, ColumnTable, Marked
from orchestrator.output.report.explorer_cells import CELLS, Cell, CellLine, Cells
from orchestrator.output.report.html.charts import (
    ChartCurve,
    Mark,
    complex_plane,
    legend,
    line_chart,
)
from orchestrator.output.report.html.elements import SHADES, Figures, document, verdict_paragraph
from orchestrator.output.report.mode_tables import LEAST_DAMPING, damping, eigenvalue_text
from orchestrator.output.report.notebook import headline, page
from orchestrator.output.report.short_texts import first_sentence, kinds_of
from orchestrator.output.results.file_writers import save_json
from orchestrator.output.results.mode_json import eigenvalue_json
from orchestrator.output.results.staging import new_run_id, staged
from orchestrator.studies.operating_points.item import Status
from orchestrator.studies.operating_points.line_ends import line_of
from orchestrator.studies.screening.limits import (
    limit_columns,
    limits_json,
    limits_sentence,
    limits_table,
)
from orchestrator.studies.screening.study import ScreenedItem, ScreeningResult
from orchestrator.studies.screening.summary import (
    ModeAt,
    ScreenedMode,
    Summary,
    duration,
    least_of,
    less_damped_above,
    where,
)
from orchestrator.studies.screening.trips import run_columns, runs_json, runs_table
from orchestrator.studies.screening.words import (
    WIDENED,
    OutageRow,
    above_the_range,
    by_outage,
    growth_in_short,
    question_of_widenings,
    verdict_of,
    verdict_sentence,
    what_was_counted,
)

# names of the files in a folder of results
ITEMS = "items.csv"
MODES = "modes.csv"
SUMMARY = "screening.json"
PAGE = "screening.html"

_CLAUSE = re.compile(r"; |: (?=\d)")
"""Ends the first clause of a sentence: a remedy follows, or further figures."""
_SHOWN = 4  # kinds of warnings that are listed; the others are counted
_FEW = 6  # points that are named one by one
_NAMED = 40  # outages of one cause that are named: a planner looks for each; items.csv has them all
_CURVES = 6
_MOST_MARKS = 4000


class Screening(NoTruth):
    """Critical modes of operating points and outages. `Case.screen` makes it.

    Attributes
    ----------
    result
        All items.
    summary
        What they come to.
    """

    def __init__(self, result: ScreeningResult) -> None:
        self.result = result
        self.summary = Summary(result)

    @property
    def stable(self) -> bool | None:
        """Return whether nothing grows anywhere; None where an item has no verdict and none grows."""
        return self.summary.stable

    @property
    def verdict(self) -> str:
        """The verdict in one sentence."""
        return verdict_sentence(self.summary)

    def table(self) -> pd.DataFrame:
        """One row for each outage: its worst point, those not judged first. `items` has all points."""
        rows = self.items().sort_values("least_damping_percent", na_position="first", kind="stable")
        return rows.drop_duplicates("outage").set_index("outage")

    def items(self) -> pd.DataFrame:
        """One row for each operating point with each outage: status, verdict and least damping [%]."""
        return items_table(self.summary).frame()

    def modes(self) -> pd.DataFrame:
        """One row for each mode: where it is damped least, and how much there."""
        return modes_table(self.summary).frame()

    def as_json(self) -> dict[str, Any]:
        """The same as ``gfor screen --json`` prints, as JSON's types."""
        return as_json(self.summary)

    def save(self, folder: str | Path) -> list[Path]:
        """Write ``items.csv``, ``modes.csv``, ``screening.json``, ``cells.json`` and the page ``screening.html``."""
        place = made_folder(folder)
        with staged(place, new_run_id()) as staging:
            items_table(self.summary).save(staging / ITEMS)
            _every_mode(self.summary).save(staging / MODES)
            save_json(self.as_json(), staging / SUMMARY)
            _cells(self.summary).save(staging, place)
            write_text(staging / PAGE, _page(self.summary))
        return [place / name for name in (ITEMS, MODES, SUMMARY, CELLS, PAGE)]

    def __repr__(self) -> str:
        plan = self.result.plan
        head = f"Screening of {plan.case.name}, {plan.prepared.name}: {self.verdict}"
        return f"<{head}; all points stand in items(), the worst of each outage in table()>"

    def _repr_html_(self) -> str:
        told = (*_lines_behind(self.summary), what_was_counted(self.summary))
        title = f"Screening of {self.result.plan.case.name}"
        top = headline(self.verdict, self.stable)
        return page(title, [*told, "items() has all points"], self.modes(), verdict=top)


def items_table(summary: Summary) -> ColumnTable[ScreenedItem]:
    return ColumnTable(
        "Items",
        (
            Column("Point", lambda item: item.point.name, name="point"),
            Column("Outage", lambda item: item.outage.name, name="outage"),
            Column("", lambda item: item.point.hours, name="hours"),
            Column("What", lambda item: str(item.record.status), name="status"),
            Column("", lambda item: item.record.stable, name="stable"),
            Column("", lambda item: item.record.counted, name="counted"),
            Column(
                "",
                lambda item: _of_least(item, "damping"),
                name="least_damping_percent",
            ),
            Column(
                "",
                lambda item: _of_least(item, "frequency"),
                name="frequency_hz",
            ),
            Column(
                "",
                lambda item: "; ".join(filter(None, (item.record.text, *item.record.warnings))),
                name="why",
            ),
            *limit_columns(summary),
            *run_columns(summary),
            Column("Why", lambda item: item.record.text),
        ),
        summary.result.items,
        left=4,
    )


def _of_least(item: ScreenedItem, figure: str) -> float | None:
    """Return a figure of an item's least damped mode; None where it has none."""
    return getattr(least_of(item), figure, None)


def _cells(summary: Summary) -> Cells:
    """Outages by operating points, the worst outage first."""
    result, plan = summary.result, summary.result.plan
    of = {(item.outage.name, item.point.name): item for item in result.items}
    taken = {one.name: one.elements for one in plan.outages}
    outages = [row.name for row in by_outage(summary)]

    def cell(item: ScreenedItem | None) -> Cell | None:
        if item is None:
            return None
        least, record = least_of(item), item.record
        text = "; ".join(
            filter(None, ("" if record.status is Status.COMPUTED else record.status, record.text))
        )
        if least is None:
            return Cell(
                text or f"no mode below {100 * plan.wanted.damping:g} %", None, record.stable
            )
        figures = f"{least.frequency:.3f} Hz, {least.damping:.2f} %"
        return Cell(
            "; ".join(filter(None, (figures, text))),
            least.damping,
            record.stable,
            least.value.real,
            least.frequency,
        )

    cells = [[cell(of.get((name, point.name))) for point in plan.points] for name in outages]
    return Cells(
        f"Least damping of {plan.case.table.title or plan.case.name}: outages, worst first, by operating points",
        plan.case,
        scenario=plan.prepared.name,
        frequencies=(plan.wanted.lowest_hz, plan.wanted.highest_hz),
        rows=[CellLine(name, out=taken[name]) for name in outages],
        columns=[CellLine(one.name, one.values, out=one.out) for one in plan.points],
        cells=cells,
        values=joined_values(plan.layers),
        step=plan.tasks[0].study.step_size,
        sharing=plan.tasks[0].sharing,
        move_controls=plan.tasks[0].move_controls,
    )


def _every_mode(summary: Summary) -> ColumnTable[tuple[ModeAt, str]]:
    names = {(id(one.item), one.place): mode.name for mode in summary.modes for one in mode.at}
    rows = [
        (ModeAt(item, place), names[id(item), place])
        for item in summary.result.items
        for place in item.record.critical
    ]
    return ColumnTable(
        "Modes",
        (
            Column("", lambda row: row[0].item.point.name, name="point"),
            Column("", lambda row: row[0].item.outage.name, name="outage"),
            Column("", lambda row: row[1], name="mode"),
            Column("", lambda row: row[0].value.real, name="real"),
            Column("", lambda row: row[0].value.imag, name="imag"),
            Column("", lambda row: row[0].frequency, name="frequency_hz"),
            Column("", lambda row: row[0].damping, name="damping_percent"),
            Column(
                "",
                lambda row: " ".join(
                    f"{name}:{share:.3f}" for name, share in row[0].participation(3)
                ),
                name="participation",
            ),
            Column(
                "",
                lambda row: next(
                    (f"{n}:{max(abs(p), abs(q)):.4g}" for n, p, q in row[0].ranking(1)), ""
                ),
                name="converter",
            ),
        ),
        rows,
    )


def verdict(summary: Summary) -> str:
    told = [escape_markup(text) for text in (*_lines_behind(summary), what_was_counted(summary))]
    return "\n".join((verdict_of(summary).markup(), *told))


def _lines_behind(summary: Summary) -> list[str]:
    """The lines behind the verdict: what swings above the range, and branches and buses beyond their limits."""
    return [*filter(None, (above_the_range(summary), limits_sentence(summary)))]


def overview(summary: Summary, most: int = 12) -> ColumnTable[OutageRow]:
    """Outages and points: the least damping of each, by points where these are few, else at the worst one."""
    plan, rows = summary.result.plan, by_outage(summary)
    at = {(item.outage.name, item.point.name): item for item in summary.result.items}
    title = "Least damping [%], worst outage first"
    columns = [Column[OutageRow]("Outage", lambda row: row.name)]
    prepared = plan.prepared
    out = {one.name: tuple(map(line_of, one.elements)) for one in plan.outages}
    if prepared.regions.has_areas:
        columns.append(Column("Area", lambda row: prepared.area_of(*out.get(row.name, ()))))
    texts = len(columns)

    def cell(item: ScreenedItem | None) -> str | Marked:
        return _cell(item, 100 * plan.wanted.damping)

    def at_point(name: str) -> Column[OutageRow]:
        return Column(name, lambda row: at.get((row.name, name)), cell)

    if 1 < len(plan.points) <= _FEW:
        return ColumnTable(
            title + _out_already(summary, len(rows) * len(plan.points)),
            [*columns, *(at_point(point.name) for point in plan.points)],
            rows,
            texts,
            most,
            ITEMS,
        )
    if len(plan.points) > 1:
        columns.append(Column("Worst point", lambda row: (row.worst or row.unjudged[0]).point.name))
    columns += [
        Column("Mode", lambda row: row.least, _who),
        Column("Damping [%]", lambda row: row.worst, cell),
    ]
    if any(row.worst and growth_in_short(row.worst.record) for row in rows):
        columns.append(Column("What grows besides", _grows_besides, text=True))
    if any(row.unjudged for row in rows):
        columns.append(Column("Not judged", _unjudged))
        columns.append(Column("Why not", _why_unjudged, text=True))
    return ColumnTable(title, columns, rows, _place_of(columns, "Damping [%]"), most, ITEMS)


def _out_already(summary: Summary, cells: int) -> str:
    """Say in the title why cells of points have no figure, where no part is missing."""
    left = summary.result.complete and len(summary.result.items) < cells
    return "; – where a point has out of service already what the outage takes" if left else ""


def _place_of(columns: Sequence[Column[OutageRow]], heading: str) -> int:
    return [column.heading for column in columns].index(heading)


def _grows_besides(row: OutageRow) -> str:
    return growth_in_short(row.worst.record) if row.worst else ""


def _unjudged(row: OutageRow) -> str:
    return f"{len(row.unjudged)} of {row.points}" if row.unjudged else ""


def _why_unjudged(row: OutageRow) -> str:
    """Return what became of the first item of an outage that has no modes, with the first clause of its cause."""
    if not row.unjudged:
        return ""
    record = row.unjudged[0].record
    cause = (record.cause or record.text).removeprefix(
        f"{str(record.status).removeprefix('no ')}: "
    )
    return f"{record.status}: {_CLAUSE.split(first_sentence(cause), maxsplit=1)[0]}"


def _who(mode: ModeAt | None) -> str:
    if mode is None:
        return ""
    return f"{mode.frequency:.2f} Hz ({', '.join(name for name, _ in mode.participation(2))})"


def _cell(item: ScreenedItem | None, wanted: float) -> str | Marked:
    """The least damping at an item [%], or what became of it, and that of a swing above the range that has less.

    ``wanted``: damping [%] below which modes are critical."""
    if item is None or item.record.status is not Status.COMPUTED:
        return "–" if item is None else str(item.record.status)
    least, above = least_of(item), less_damped_above(item, wanted)
    mark = WIDENED if item.record.widenings else ""
    if item.record.stable is False:
        return Marked(f"{least.damping:.2f} UNSTABLE{mark}" if least else f"UNSTABLE{mark}", "bad")
    if above is None:
        return f"> {wanted:g}{mark}" if least is None else _with_mark(least.damping, mark)
    within = f"> {wanted:g}" if least is None else f"{least.damping:.2f}"
    text = f"{within}; {above.frequency:.2f} Hz above the range: {above.damping:.2f}{mark}"
    return Marked(text, "bad") if above.damping < LEAST_DAMPING else text


def _with_mark(value: float, mark: str) -> str | Marked:
    """Return a damping [%] with a mark behind it, in the colour that it has without."""
    text = damping(value)
    if not mark:
        return text
    return Marked(f"{text.text}{mark}", text.mark) if isinstance(text, Marked) else f"{text}{mark}"


def no_modes(summary: Summary) -> str:
    """Return the sentence in the place of the modes; "" where there are some, or nothing is known."""
    wanted = summary.result.plan.wanted
    if summary.modes or not summary.counts[Status.COMPUTED]:
        return ""
    band = f"{wanted.lowest_hz:g} to {wanted.highest_hz:g} Hz"
    return f"No mode from {band} is damped by less than {100 * wanted.damping:g} %."


def modes_table(
    summary: Summary, most: int = 12, *, whole: bool = False
) -> ColumnTable[ScreenedMode]:
    """Each mode where it is damped least, and the converter whose damping controller moves it most there.

    ``whole``: with eigenvalue and participation, for which a terminal is too narrow."""
    takes_part = [
        Column[ScreenedMode](
            "Who takes part",
            lambda mode: ", ".join(f"{name} {x:.2f}" for name, x in mode.worst.participation(4)),
        )
    ][: int(whole)]
    value = [Column[ScreenedMode]("λ [rad/s]", lambda mode: mode.worst.value, eigenvalue_text)][
        : int(whole)
    ]

    plan, total = summary.result.plan, len(summary.result.items)
    point = "Point" if len(plan.points) > 1 else ""
    columns: list[Column[ScreenedMode]] = [
        Column("Mode", lambda mode: mode.name, name="mode"),
        Column(point, lambda mode: mode.worst.item.point.name, name="point"),
        Column("Outage", lambda mode: mode.worst.item.outage.name, name="outage"),
        *takes_part,
        Column("", lambda mode: mode.worst.frequency, name="frequency_hz"),
        Column("Damping [%]", lambda mode: mode.worst.damping, damping, "damping_percent"),
        Column("Seen at", lambda mode: len(mode.at), lambda n: f"{n} of {total}", "items"),
        *value,
    ]
    if any(mode.worst.ranking(1) for mode in summary.modes):
        best_at = "Damping controller best at"
        columns += [
            Column(best_at, lambda mode: _best_controller(mode)[0], text=True),
            Column("Shift by gain 1 pu [rad/s]", lambda mode: _best_controller(mode)[1], ".3g"),
        ]
    left = 2 + bool(point) + len(takes_part)
    title = "Modes, each where it is damped least"
    return ColumnTable(title, columns, summary.modes, left, most, MODES)


def _best_controller(mode: ScreenedMode) -> tuple[str, float | None]:
    """The converter whose damping controller moves a mode most, and how far by unit gain [rad/s]."""
    return next(((n, max(abs(p), abs(q))) for n, p, q in mode.worst.ranking(1)), ("–", None))


def _cause(summary: Summary, item: ScreenedItem) -> str:
    """Why an item has no modes, without the questions that the base asks already."""
    text = item.record.text
    for question in summary.result.plan.prepared.questions:
        place = question.place_in_short or question.place
        text = text.replace(f"; {Problem(place, f'questioned besides: {question.text}')}", "")
    return text


def _places(summary: Summary, items: Sequence[ScreenedItem]) -> str:
    """The items of one cause: the first in full, the outages and the points of all."""
    if len(items) == 1:
        return where(summary, items[0])
    outages = list(dict.fromkeys(item.outage.name for item in items))
    points = list(dict.fromkeys(item.point.name for item in items))
    at = f" at {few(points, _FEW)}" if len(points) > 1 else ""
    return f"{len(items)} items ({few(outages, _NAMED)}{at}), first {where(summary, items[0])}"


def _of_controls(summary: Summary) -> str:
    """Tell whether taps and switched shunts move after outages; "" where there is none, or no outage."""
    plan = summary.result.plan
    counted = plan.prepared.counted_controls
    if not counted or not any(outage.elements for outage in plan.outages):
        return ""
    if plan.prepared.moving:
        return f"after outages {counted} move until voltages are in their bands"
    return f"after outages {counted} are held; --move-controls lets them move"


def _of_relays(summary: Summary) -> str:
    """Tell that no relay acts in the runs of the outages; "" where there are relays, or no runs.

    Models may trip by themselves nevertheless: motors, DC lines, shares of DER_A."""
    if not summary.runs or summary.result.plan.prepared.relays:
        return ""
    told = "the case has no relay of a unit or a load, so that in the runs of the outages none acts"
    return f"{told}; " + Option.PROTECTION + " prc029 lets converters trip by NERC's PRC-029"


def remarks(summary: Summary) -> list[str]:
    told = (question_of_widenings(summary), _of_controls(summary), _of_relays(summary))
    texts = [*filter(None, told)]
    for status, number in summary.counts.items():
        if status is Status.COMPUTED:
            continue
        named = [item for item in summary.failures() if item.record.status is status]
        texts.append(f"{status}: {number} of {len(summary.result.items)}:")
        causes = kinds_of((item, [_cause(summary, item)]) for item in named)
        texts += [f"  {_places(summary, items)}: {text}" for text, items in causes]
    every = summary.result.items
    kinds = kinds_of((item, _not_said_yet(item)) for item in every)
    texts += [
        f"at {len(x)} of {len(every)}, first at {where(summary, x[0])}: {text}"
        for text, x in kinds[:_SHOWN]
    ]
    if len(kinds) > _SHOWN:
        texts.append(f"… and {len(kinds) - _SHOWN} more warnings, in items.csv")
    return texts


def _not_said_yet(item: ScreenedItem) -> list[str]:
    """An item's warnings but those about ratings, which the verdict counts."""
    return [text for text in item.record.warnings if text not in item.record.of_rating]


def as_json(summary: Summary) -> dict[str, Any]:
    result = summary.result
    free = [_where(item) | {"zero_eigenvalues": item.record.zeros} for item in summary.free]
    failures = [
        _where(item)
        | {
            "status": str(item.record.status),
            "why": item.record.text,
            "cause": item.record.cause or item.record.text,
        }
        for item in summary.failures()
    ]
    return {
        **result.plan.prepared.about,
        "points": len(result.plan.points),
        "outages": len(result.plan.outages) - 1,
        "controls": _of_controls(summary) or None,
        "items": len(result.items),
        "complete": result.complete,
        "stable": summary.stable,
        "verdict": verdict_sentence(summary),
        "counted_at_all_frequencies": summary.counted_items,
        "slowest_growth_counted": summary.slowest,
        "nothing_restores": free,
        "counts": {str(status): number for status, number in summary.counts.items()},
        "beyond_rating": summary.beyond or None,
        "widened_limits": list(map(_widened_json, summary.widened)),
        "limits": limits_json(summary),
        "runs": runs_json(summary),
        "above_the_range": above_the_range(summary) or None,
        "unstable": list(map(_where, summary.unstable)),
        "failures": failures,
        "modes": list(map(_mode_json, summary.modes)),
    }


def _widened_json(item: ScreenedItem) -> dict[str, Any]:
    return _where(item) | {"limits": [asdict(one) for one in item.record.widenings]}


def _mode_json(mode: ScreenedMode) -> dict[str, Any]:
    worst = mode.worst
    return {
        "name": mode.name,
        "worst": _where(worst.item) | eigenvalue_json(worst.value, worst.damping),
        "participation": dict(worst.participation()),
        "items": len(mode.at),
        "hours": mode.hours,
        "converters": [
            {"component": name, "residue_p": abs(p), "residue_q": abs(q)}
            for name, p, q in worst.ranking()
        ],
    }


def _where(item: ScreenedItem) -> dict[str, Any]:
    return {"point": item.point.name, "outage": item.outage.name, "place": item.point.place}


def _page(summary: Summary) -> str:
    """One file that needs no other: what is worst, when, with which outage, and where a damping controller helps."""
    plan, figures = summary.result.plan, Figures()
    content = [("Outages", overview(summary, 20).html())] if len(plan.outages) > 1 else []
    beyond = limits_table(summary, 20)
    if beyond is not None:
        content.append(("Ratings and voltage bands", beyond.html()))
    ran = runs_table(summary, 20)
    if ran is not None:
        content.append(("Runs of the outages", ran.html()))
    if summary.modes:
        content += _of_modes(summary, figures)
    else:
        none = no_modes(summary) or "No point has modes that are known."
        content.append(("Modes", f"<p>{none}</p>"))
    failed = list(summary.failures())
    if failed:
        shown = ColumnTable(
            "Points and outages without modes", items_table(summary).columns, failed, 4, 20, ITEMS
        )
        content.append(("Not computed", shown.html()))
    title = f"{plan.case.table.title or plan.case.name}: screening"
    points, outages = (
        number_of(len(plan.points), "operating point"),
        number_of(len(plan.outages) - 1, "outage"),
    )
    kind = f"{plan.prepared.title}, {points}, {outages}"
    shade, sure = SHADES[summary.stable], what_was_counted(summary)
    verdict = re.sub("`([^`]+)`", r"<code>\1</code>", escape(verdict_sentence(summary)))
    told = "".join(f"<p>{escape(text)}</p>" for text in _lines_behind(summary))
    findings = (
        f'<div class="findings">{verdict_paragraph(shade, verdict)}{told}'
        f'<p class="soft">{escape(sure)}</p></div>'
    )
    return document(title, kind, findings, content, names=plan.prepared.names)


def _of_modes(summary: Summary, figures: Figures) -> list[tuple[str, str]]:
    """The sections on critical modes; a single operating point has no durations and no course."""
    content = [("Modes", modes_table(summary, 20, whole=True).html())]
    if len(summary.result.plan.points) > 1:
        content.append(("Damping and how long", _durations(summary, figures)))
        content.append(("Damping over the points", _over_points(summary, figures)))
    content.append(("All critical modes", _plane(summary, figures)))
    content.append(("Where a damping controller helps", _ranking(summary)))
    return content


def _durations(summary: Summary, figures: Figures) -> str:
    parts = []
    for outages, text in ((False, "the intact network"), (True, "the worst outage of each point")):
        if outages and len(summary.result.plan.outages) < 2:
            continue
        curves = []
        for k, mode in enumerate(_longest(summary)):
            hours, percent = duration(mode, outages=outages)
            if len(hours):
                steps = np.repeat(np.concatenate([[0.0], hours]), 2)[1:-1]
                curves.append(ChartCurve(mode.name, colour(k + 1), steps, np.repeat(percent, 2)))
        if curves:
            key = legend((curve.label, curve.colour) for curve in curves)
            chart = line_chart(
                f"Damping and duration, {text}",
                "Hours with at most this damping",
                "Damping [%]",
                curves,
                260,
            )
            picture, _ = figures.add(
                key + chart, f"For how long each mode is damped by at most so much, {text}."
            )
            parts.append(picture)
    return "".join(parts) or "<p>No critical mode was found.</p>"


def _longest(summary: Summary) -> list[ScreenedMode]:
    most = max((len(mode.at) for mode in summary.modes), default=0)
    return [mode for mode in summary.modes if len(mode.at) >= most / 4][:_CURVES]


def _over_points(summary: Summary, figures: Figures) -> str:
    place = {point.name: float(k) for k, point in enumerate(summary.result.plan.points)}
    curves = []
    for k, mode in enumerate(_longest(summary)):
        intact = [one for one in mode.at if not one.item.outage.elements]
        if len(intact) > 1:
            at = np.array([place[one.item.point.name] for one in intact])
            curves.append(
                ChartCurve(mode.name, colour(k + 1), at, np.array([one.damping for one in intact]))
            )
    if not curves:
        return "<p>No critical mode was followed over several points.</p>"
    key = legend((curve.label, curve.colour) for curve in curves)
    chart = line_chart(
        "Damping over the points",
        "Operating point, in the file's order",
        "Damping [%]",
        curves,
        260,
    )
    return figures.add(key + chart, "Damping of the modes in the intact network.")[0]


def _plane(summary: Summary, figures: Figures) -> str:
    every = [(k, one) for k, mode in enumerate(summary.modes) for one in mode.at]
    shown = every if len(every) <= _MOST_MARKS else every[:: len(every) // _MOST_MARKS + 1]
    marks = [
        Mark(
            one.value.real,
            one.frequency,
            colour(k + 1),
            f"{one.item.point.name}, {one.item.outage.name}\n{one.frequency:.3f} Hz, {one.damping:.2f} %",
            "dot" if one.item.outage.elements else "cross",
        )
        for k, one in shown
    ]
    text = "Critical modes of all points and outages; crosses: the intact network, dots: outages."
    if len(shown) < len(every):
        text += f" {len(shown)} of {len(every)} are shown."
    return figures.add(complex_plane("Critical modes", marks), text)[0]


def _ranking(summary: Summary) -> str:
    parts = [
        "<p>Size of the residue from a converter's power reference to its own frequency: so far a damping controller "
        "there moves the eigenvalue by unit gain [pu of its rating by pu of frequency], if its phase is right and its "
        "gain small.</p>"
    ]
    columns: tuple[Column[tuple[str, complex, complex]], ...] = (
        Column("Converter", lambda row: row[0]),
        Column("through P [rad/s]", lambda row: abs(row[1]), ".4f"),
        Column("through Q [rad/s]", lambda row: abs(row[2]), ".4f"),
    )
    for mode in summary.modes[:_CURVES]:
        where = f"at {mode.worst.item.point.name}, {mode.worst.item.outage.name}"
        found = mode.worst.ranking()
        if found:
            parts.append(ColumnTable(f"{mode.name}, {where}", columns, found).html())
    return (
        "".join(parts) if len(parts) > 1 else "<p>No converter of this scenario can be ranked.</p>"
    )
