"""A screening on a terminal."""

from collections import Counter

from rich.markup import escape
from rich.table import Table
from rich.text import Text

from orchestrator.operating_points.item import Status
from orchestrator.report.tables import Cell, make_table
from orchestrator.screening.stress import OutageRow, by_outage
from orchestrator.screening.study import ScreenedItem
from orchestrator.screening.summary import ModeAt, Summary
from orchestrator.screening.words import verdict_of, what_was_counted, where

_ROWS, _SHOWN, _FEW = 12, 4, 6


def verdict(summary: Summary) -> str:
    """The verdict as rich markup, and what it rests on."""
    return f"{verdict_of(summary).markup()}\n{escape(what_was_counted(summary))}"


def overview(summary: Summary) -> Table:
    """Outages and points: the least damping of each, by points where these are few, else at the worst one."""
    rows, plan = by_outage(summary), summary.result.plan
    few = 1 < len(plan.points) <= _FEW
    title = f"Least damping [%] below {100 * plan.wanted.damping:g} %, worst outage first"
    if few:
        at = {(item.outage.name, item.point.name): item for item in summary.result.items}
        columns, left = [point.name for point in plan.points], 1
        cells = [[row.name, *(_cell(at.get((row.name, name))) for name in columns)] for row in rows[:_ROWS]]
    else:
        columns, left = ["Worst point", "Mode", "Damping [%]", "Not judged"], 3
        cells = [_at_worst(row) for row in rows[:_ROWS]]
    table = make_table(title, "Outage", *columns, left=left, rows=cells)
    if len(rows) > _ROWS:
        table.caption = f"{len(rows) - _ROWS} more in items.csv"
    return table


def _at_worst(row: OutageRow) -> list[Cell]:
    least = row.least
    who = "" if least is None else f"{least.frequency:.2f} Hz ({', '.join(name for name, _ in least.participation(2))})"
    lost = f"{len(row.unjudged)} of {row.points}" if row.unjudged else ""
    return [row.name, (row.worst or row.unjudged[0]).point.name, who, _cell(row.worst), lost]


def _cell(item: ScreenedItem | None) -> Cell:
    """The least damping at an item, or what became of it."""
    if item is None or item.record.status is not Status.COMPUTED:
        return "–" if item is None else str(item.record.status)
    if item.record.stable is False:
        return Text("UNSTABLE", "bold red")
    return f"{ModeAt(item, item.record.critical[0]).damping:.2f}" if item.record.critical else "more"


def modes(summary: Summary) -> Table:
    """Each mode where it is damped least, and the converter whose damping controller moves it most there."""
    columns = ("Mode", "Point", "Outage", "Damping [%]", "Items", "Converter", "by gain [rad/s]")
    rows = []
    for mode in summary.modes[:_ROWS]:
        best, item = mode.worst.ranking(1), mode.worst.item
        name, size = (best[0][0], f"{max(abs(best[0][1]), abs(best[0][2])):.3g}") if best else ("–", "–")
        figures = (f"{mode.worst.damping:.2f}", str(len(mode.at)), name, size)
        rows.append((mode.name, item.point.name, item.outage.name, *figures))
    return make_table("Modes, each where it is damped least", *columns, left=3, rows=rows)


def remarks(summary: Summary) -> list[str]:
    """What was not computed, and what is unusual, counted and named."""
    texts = []
    for status, number in summary.counts.items():
        if status is Status.COMPUTED:
            continue
        named = [item for item in summary.failures() if item.record.status is status]
        texts.append(f"{status}: {number} of {len(summary.result.items)}:")
        texts += [f"  {where(item)}: {item.record.text}" for item in named[:_SHOWN]]
        texts += [f"  … and {number - _SHOWN} more, in items.csv"] if number > _SHOWN else []
    warned = [(text, item) for item in summary.result.items for text in item.record.warnings]
    kinds, first = Counter(text for text, _ in warned), dict(reversed(warned))
    texts += [
        f"at {number} of {len(summary.result.items)}, first at {where(first[text])}: {text}"
        for text, number in kinds.most_common(_SHOWN)
    ]
    if len(kinds) > _SHOWN:
        texts.append(f"… and {len(kinds) - _SHOWN} more warnings, in items.csv")
    return texts
