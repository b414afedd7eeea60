"""Runs of outages in words, as a table, and as JSON's types."""

from typing import Any

from orchestrator.core.errors import few
from orchestrator.output.report.column_table import Column, ColumnTable
from orchestrator.studies.screening.record import OutageRun
from orchestrator.studies.screening.study import ScreenedItem
from orchestrator.studies.screening.summary import Summary, where

_NAMED = 3  # trips of a run that a sentence or a cell names; the others are counted

_GONE_WRONG = {
    "loss_of_synchronism": "loses synchronism",
    "run_away": "runs away",
    "not_finite": "gives no numbers",
    "failure": "fails",
}
"""Kinds of what goes wrong in the run of an outage, in words."""


def _trips_of(run: OutageRun) -> str:
    told = (f"{trip.of} at {trip.time:.4g} s" for trip in run.trips)
    return few(list(dict.fromkeys(told)), _NAMED)


def _wrong_of(run: OutageRun) -> str:
    told = (f"{x.component} {_GONE_WRONG[x.kind]} at {x.time:.4g} s" for x in run.went_wrong)
    return few(list(dict.fromkeys(told)), _NAMED)


def runs_sentence(summary: Summary) -> str:
    """At how many of the runs relays trip or something goes wrong, and at which first; "" without runs."""
    total = len(summary.runs)
    if not total:
        return ""
    told = []
    for items, what, of in (
        (summary.tripping, "relays or models trip, or motors stall", _trips_of),
        (summary.gone_wrong, "the system does not hold", _wrong_of),
    ):
        if items:
            first = items[0]
            assert first.record.run is not None
            at = where(summary, first)
            told.append(f"in {len(items)} of {total} {what}, first {at}: {of(first.record.run)}")
    return f"runs of the outages: {'; '.join(told) or f'in none of {total} anything trips'}"


def runs_table(summary: Summary, most: int = 12) -> ColumnTable[ScreenedItem] | None:
    """Outages in whose runs anything happens besides; None without any."""
    told = (*summary.tripping, *summary.gone_wrong)
    found = [item for item in summary.runs if item in told]
    if not found:
        return None
    return ColumnTable(
        "Runs of the outages",
        (
            Column("Point", lambda item: item.point.name),
            Column("Outage", lambda item: item.outage.name),
            Column("Who trips", _trips, text=True),
            Column("Does not hold", _wrong, text=True),
        ),
        found,
        2,
        most,
        "items.csv",
    )


def run_columns(summary: Summary) -> tuple[Column[ScreenedItem], ...]:
    """Columns of ``items.csv``; none without runs."""
    if not summary.runs:
        return ()
    return (Column("", _trips, name="trips"), Column("", _wrong, name="gone_wrong"))


def _trips(item: ScreenedItem) -> str:
    return "" if item.record.run is None else _trips_of(item.record.run)


def _wrong(item: ScreenedItem) -> str:
    return "" if item.record.run is None else _wrong_of(item.record.run)


def runs_json(summary: Summary) -> list[dict[str, Any]] | None:
    """Give every run with its trips and what went wrong; None without runs."""
    if not summary.runs:
        return None
    return [_run_json(item, item.record.run) for item in summary.runs if item.record.run]


def _run_json(item: ScreenedItem, run: OutageRun) -> dict[str, Any]:
    trips = [
        {
            "of": trip.of,
            "record": trip.record,
            "time": trip.time,
            "seen": trip.seen,
            "message": trip.message,
        }
        for trip in run.trips
    ]
    wrong = [
        {"kind": x.kind, "component": x.component, "time": x.time, "message": x.message}
        for x in run.went_wrong
    ]
    return {
        "point": item.point.name,
        "outage": item.outage.name,
        "until": run.until,
        "trips": trips,
        "went_wrong": wrong,
    }
