"""A screening on a terminal."""

from collections import Counter

from rich.markup import escape
from rich.table import Table

from orchestrator.report.tables import PlainTable
from orchestrator.screening.record import Status
from orchestrator.screening.stress import by_outage
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
    table = PlainTable(title=title, title_justify="left", title_style="bold", header_style="bold")
    table.add_column("Outage", overflow="fold")
    if few:
        for point in plan.points:
            table.add_column(escape(point.name), justify="right")
        at = {(item.outage.name, item.point.name): item for item in summary.result.items}
        for row in rows[:_ROWS]:
            table.add_row(escape(row.name), *(_cell(at.get((row.name, point.name))) for point in plan.points))
    else:
        for column in ("Worst point", "Mode"):
            table.add_column(column, overflow="fold")
        for column in ("Damping [%]", "Not judged"):
            table.add_column(escape(column), justify="right")
        for row in rows[:_ROWS]:
            least = row.least
            names = "" if least is None else ", ".join(name for name, _ in least.participation(2))
            who = "" if least is None else f"{least.frequency:.2f} Hz ({names})"
            lost = f"{len(row.unjudged)} of {row.points}" if row.unjudged else ""
            shown = row.worst or row.unjudged[0]
            table.add_row(escape(row.name), escape(shown.point.name), escape(who), _cell(row.worst), lost)
    if len(rows) > _ROWS:
        table.caption = f"{len(rows) - _ROWS} more in items.csv"
    return table


def _cell(item: ScreenedItem | None) -> str:
    """The least damping at an item, or what became of it."""
    if item is None or item.record.status is not Status.COMPUTED:
        return "–" if item is None else str(item.record.status)
    if item.record.stable is False:
        return "[bold red]UNSTABLE[/]"
    return f"{ModeAt(item, item.record.critical[0]).damping:.2f}" if item.record.critical else "more"


def modes(summary: Summary) -> Table:
    """Each mode where it is damped least, and the converter whose damping controller moves it most there."""
    table = PlainTable(title="Modes, each where it is damped least", title_justify="left", title_style="bold",
                       header_style="bold")  # fmt: skip
    for column in ("Mode", "Point", "Outage"):
        table.add_column(column, overflow="fold")
    for column in ("Damping [%]", "Items", "Converter", "by gain [rad/s]"):
        table.add_column(escape(column), justify="right")
    for mode in summary.modes[:_ROWS]:
        best = mode.worst.ranking(1)
        name, size = (best[0][0], f"{max(abs(best[0][1]), abs(best[0][2])):.3g}") if best else ("–", "–")
        item = mode.worst.item
        table.add_row(escape(mode.name), escape(item.point.name), escape(item.outage.name),
                      f"{mode.worst.damping:.2f}", str(len(mode.at)), name, size)  # fmt: skip
    return table


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
