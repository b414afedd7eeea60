"""A screening on a terminal."""

from collections import Counter

from rich.markup import escape
from rich.table import Table

from orchestrator.report.tables import PlainTable
from orchestrator.screening.record import Status
from orchestrator.screening.summary import Summary
from orchestrator.screening.words import verdict_of, what_was_counted, where

_ROWS, _SHOWN = 12, 4


def verdict(summary: Summary) -> str:
    """The verdict as rich markup, and what it rests on."""
    return f"{verdict_of(summary).markup()}\n{escape(what_was_counted(summary))}"


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
