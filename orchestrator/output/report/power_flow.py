"""The tables of a power flow: columns, rows as text, and totals."""

from collections.abc import Mapping, Sequence
from typing import Any

from orchestrator.output.report.column_table import ShownTable

COLUMNS = {
    "machines": {
        "name": "Unit",
        "bus": "Bus",
        "rating_mva": "Rating [MVA]",
        "p_mw": "P [MW]",
        "q_mvar": "Q [Mvar]",
        "loading_percent": "Loading [% of rating]",
    },
    "buses": {"name": "Bus", "v_pu": "Voltage [pu]", "angle_deg": "Angle [°]"},
    "branches": {
        "name": "Branch",
        "from_bus": "From",
        "to_bus": "To",
        "p_from_mw": "P from [MW]",
        "q_from_mvar": "Q from [Mvar]",
        "p_to_mw": "P to [MW]",
        "q_to_mvar": "Q to [Mvar]",
        "losses_mw": "Losses [MW]",
    },
}

# how many columns at the left of each table hold text
TEXTS = {"machines": 2, "buses": 1, "branches": 3}
_REGIONS = {"area": "Area", "zone": "Zone", "owner": "Owner", "station": "Station"}
"""Columns of a file that tells them."""

_DIGITS = {"v_pu": 4, "angle_deg": 2, "rating_mva": None, "losses_mw": 3}


def totals(found: dict[str, Any]) -> list[tuple[str, str]]:
    slack, voltages = found["slack"], [bus["v_pu"] for bus in found["buses"]]
    share = (
        ""
        if slack["share_percent"] is None
        else f", {slack['share_percent']:.0f} % of the generation"
    )
    return [
        ("generation", f"{found['generation_mw']:.1f} MW"),
        ("losses in branches", f"{found['losses_mw']:.2f} MW"),
        (f"slack {', '.join(slack['units'])}", f"{slack['p_mw']:.1f} MW{share}"),
        ("voltages", f"{min(voltages):.3f} to {max(voltages):.3f} pu"),
    ]


def columns(rows: Sequence[Mapping[str, Any]], kind: str) -> dict[str, str]:
    """Return the headings of a table by column, with the regions that its rows tell."""
    told = {name: heading for name, heading in _REGIONS.items() if any(name in row for row in rows)}
    return COLUMNS[kind] | told


def flow_table(title: str, kind: str, rows: Sequence[Mapping[str, Any]]) -> ShownTable:
    """A table of machines, buses or branches; a bus has its name in the file beside it."""
    shown = columns(rows, kind)
    cells = [
        [_cell(column, row.get(column, "")) + _titled(column, row) for column in shown]
        for row in rows
    ]
    return ShownTable(title, list(shown.values()), cells, left=TEXTS[kind])


def _titled(column: str, row: Mapping[str, Any]) -> str:
    return f" {row['title']}" if column == "name" and row.get("title") else ""


def _cell(column: str, value: Any) -> str:
    if isinstance(value, str):
        return value
    digits = _DIGITS.get(column, 1)
    return f"{value:g}" if digits is None else f"{value:.{digits}f}"
