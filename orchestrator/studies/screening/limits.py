"""Branches beyond the ratings and buses outside of the bands that a network's file has."""

from collections.abc import Callable, Collection
from typing import Any

from orchestrator.cases.networks.branch_limits import Loading
from orchestrator.core.errors import number_of
from orchestrator.output.report.column_table import Column, ColumnTable
from orchestrator.studies.operating_points.words import counted_items
from orchestrator.studies.screening.study import ScreenedItem
from orchestrator.studies.screening.summary import Summary, where

_FEW = 3

_FAR_BEYOND = 3.0
"""Part of a rating that no branch of an intact network carries for good. MultiGen of PowerSystemsTestData has 250 MVA
for each line and 4700 MW between two of its buses: 12.5 times as much."""


def worst_branch(item: ScreenedItem) -> Loading | None:
    """The branch that is loaded most; None where the file has no ratings."""
    return item.record.loadings[0] if item.record.loadings else None


def branches_beyond(item: ScreenedItem) -> list[str]:
    return [one.branch for one in item.record.loadings if one.beyond]


def limit_columns(summary: Summary) -> tuple[Column[ScreenedItem], ...]:
    """Columns of ``items.csv``: the worst branch and bus, and how many are beyond."""
    has_bands = _has_bands(summary)
    return (
        Column("", _branch, name="branch"),
        Column("", _percent, name="loading_percent"),
        Column("", lambda item: _number(item, branches_beyond(item)), name="branches_beyond"),
        Column("", _bus, name="bus_outside"),
        Column("", _voltage, name="voltage_pu"),
        Column("", lambda item: _outside(item, has_bands), name="buses_outside"),
    )


def limits_sentence(summary: Summary) -> str:
    """At how many items a branch is beyond its rating, and a bus outside of its band; "" where the file has neither."""
    sentences = (_branches_in_words(summary), _voltages_in_words(summary))
    return " ".join(filter(None, sentences))


def limits_table(summary: Summary, most: int = 12) -> ColumnTable[ScreenedItem] | None:
    """Items with a branch beyond its rating or a bus outside of its band, the most loaded first; None without any."""
    found = [item for item in summary.result.items if branches_beyond(item) or item.record.outliers]
    if not found:
        return None
    found.sort(key=lambda item: -(_percent(item) or 0.0))
    prepared = summary.result.plan.prepared
    has_areas = prepared.regions.has_areas

    def area(heading: str, get: Callable[[ScreenedItem], str | None]) -> list[Column[ScreenedItem]]:
        if not has_areas:
            return []
        return [Column(heading, lambda item: prepared.area_of(get(item) or ""), text=True)]

    return ColumnTable(
        "Branches beyond their rating, and buses outside of their band",
        (
            Column("Point", lambda item: item.point.name),
            Column("Outage", lambda item: item.outage.name),
            Column("Branch", lambda item: _branch(item) or ""),
            *area("Area of branch", _branch),
            Column("Loading [%]", _percent, ".4g"),
            Column("Beyond", lambda item: _number(item, branches_beyond(item))),
            Column("Bus", lambda item: _bus(item) or ""),
            *area("Area of bus", _bus),
            Column("Voltage [pu]", _voltage, ".4f"),
            Column("Outside", lambda item: len(item.record.outliers)),
        ),
        found,
        3 + has_areas,
        most,
        "items.csv",
    )


def limits_json(summary: Summary) -> dict[str, Any] | None:
    """Give every item with a branch beyond its rating or a bus outside of its band; None where the file has neither."""
    if not limits_sentence(summary):
        return None
    intact, area_of = _beyond_intact(summary), summary.result.plan.prepared.area_of
    concerned = [
        item for item in summary.result.items if branches_beyond(item) or item.record.outliers
    ]
    return {
        "items": [_item_json(item, intact.get(item.point.name, ()), area_of) for item in concerned]
    }


def _item_json(
    item: ScreenedItem, beyond_intact: Collection[str], area_of: Callable[[str], str]
) -> dict[str, Any]:
    """Return an item's branches and buses beyond their limits, with their areas where the file has several."""

    def area(element: str) -> dict[str, str]:
        name = area_of(element)
        return {"area": name} if name else {}

    branches = [
        {
            "branch": one.branch,
            "loading_percent": 100 * one.part,
            "beyond_in_intact_network": one.branch in beyond_intact,
            **area(one.branch),
        }
        for one in item.record.loadings
        if one.beyond
    ]
    buses = [
        {"bus": one.bus, "voltage_pu": one.voltage, "limit_pu": one.limit, **area(one.bus)}
        for one in item.record.outliers
    ]
    return {
        "point": item.point.name,
        "outage": item.outage.name,
        "branches": branches,
        "buses": buses,
    }


def _branches_in_words(summary: Summary) -> str:
    rated = [(one, item) for item in summary.result.items if (one := worst_branch(item))]
    if not rated:
        return ""
    worst, item = max(rated, key=lambda entry: entry[0].part)
    most = f"{worst.branch} with {100 * worst.part:.4g} % ({where(summary, item)})"
    over, total = sum(one.beyond for one, _ in rated), len(rated)
    if not over:
        return f"No branch is beyond its rating{_without_flow(summary)}; {most} is loaded most."
    text = f"At {counted_items(over, total)} a branch is beyond its rating, most {most}."
    already = sorted({name for names in _beyond_intact(summary).values() for name in names})
    if already:
        shown = ", ".join(already[:_FEW]) + f" and {len(already) - _FEW} more" * (
            len(already) > _FEW
        )
        text += f" Beyond it without an outage already: {shown}."
    return text + _far_beyond(summary)


def _far_beyond(summary: Summary) -> str:
    """Ask whether ratings are meant that the intact network exceeds many times; "" where none is."""
    intact = [item for item in summary.result.items if not item.outage.elements]
    found = [one for item in intact for one in item.record.loadings if one.part > _FAR_BEYOND]
    if not found:
        return ""
    worst = max(found, key=lambda one: one.part)
    rating = summary.result.plan.prepared.file_limits.ratings[worst.branch].mva
    number = len({one.branch for one in found})
    others = f"; {number - 1} more are alike" if number > 1 else ""
    return (
        f" Are its ratings meant? The file gives {worst.branch} {rating:g} MVA, and the intact network takes "
        f"{100 * worst.part:.4g} % of it{others}."
    )


def _voltages_in_words(summary: Summary) -> str:
    found = [(item.record.outliers[0], item) for item in summary.result.items if _bus(item)]
    if not found:
        if not _has_bands(summary) or not any(x.record.has_flow for x in summary.result.items):
            return ""
        return f"All bus voltages are within their bands{_without_flow(summary)}."
    worst, item = max(found, key=lambda entry: abs(entry[0].voltage - entry[0].limit))
    known = sum(x.record.has_flow for x in summary.result.items)
    side = "below" if worst.voltage < worst.limit else "above"
    return (
        f"At {counted_items(len(found), known)} a bus voltage is outside of its band, furthest "
        f"{worst.bus} with {worst.voltage:.4f} pu, {side} {worst.limit:g} pu ({where(summary, item)})."
    )


def _without_flow(summary: Summary) -> str:
    """Say of how many items that is not known; "" where it is known of all."""
    number = sum(not item.record.has_flow for item in summary.result.items)
    return f", except for {number_of(number, 'item')} not judged" if number else ""


def _has_bands(summary: Summary) -> bool:
    return bool(summary.result.plan.prepared.file_limits.bands)


def _outside(item: ScreenedItem, has_bands: bool) -> int | None:
    return len(item.record.outliers) if has_bands and item.record.has_flow else None


def _beyond_intact(summary: Summary) -> dict[str, set[str]]:
    """Branches that are beyond their rating in the intact network, by point."""
    intact = [item for item in summary.result.items if not item.outage.elements]
    return {item.point.name: set(branches_beyond(item)) for item in intact}


def _branch(item: ScreenedItem) -> str | None:
    one = worst_branch(item)
    return None if one is None else one.branch


def _percent(item: ScreenedItem) -> float | None:
    one = worst_branch(item)
    return None if one is None else 100 * one.part


def _number(item: ScreenedItem, beyond: list[str]) -> int | None:
    return len(beyond) if item.record.loadings else None


def _bus(item: ScreenedItem) -> str | None:
    return item.record.outliers[0].bus if item.record.outliers else None


def _voltage(item: ScreenedItem) -> float | None:
    return item.record.outliers[0].voltage if item.record.outliers else None
