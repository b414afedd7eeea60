"""The table of short-circuit power that a terminal and a page show, over the JSON of `gfor scr`."""

from collections.abc import Mapping, Sequence
from typing import Any

from orchestrator.output.report.column_table import ShownTable

_FORMATS = {"s_sc_mva": ".0f", "scr": ".2f", "rating_mva": ".5g", "x_r": ".1f"}
"""How the figures of a bus are written."""


def strength_table(title: str, buses: Sequence[Mapping[str, Any]]) -> ShownTable:
    """Short-circuit power of buses [MVA], the ratio to the converters there, X/R, and the area if the file tells it.

    Results of earlier versions do not have all figures."""
    headings = ["Bus", "S_sc [MVA]", "SCR", "of [MVA]", "X/R", "Converters"]
    headings += ["Area"] * any("area" in bus for bus in buses)
    rows = []
    for bus in buses:
        figures = [_figure(bus.get(key), write) for key, write in _FORMATS.items()]
        row = [bus["bus"], *figures, ", ".join(bus.get("converters", ())), bus.get("area", "")]
        rows.append(row[: len(headings)])
    return ShownTable(title, headings, rows)


def _figure(value: float | None, write: str) -> str:
    return "–" if value is None else f"{value:{write}}"
