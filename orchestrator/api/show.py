"""How results show themselves: HTML for a notebook, and Matplotlib Axes to draw on."""

from collections.abc import Iterable
from html import escape
from typing import Any

import pandas as pd

Axes = Any
"""``matplotlib.axes.Axes``; to import the class takes a second, which only plots are worth."""

_ROWS = 40


def new_axes(width: float = 7.2, height: float = 4.4) -> Axes:
    """Axes of a new figure of pyplot, in the look of all plots.

    Parameters
    ----------
    width, height
        Of the figure [inches].
    """
    import matplotlib.pyplot as plt  # noqa: PLC0415 - a second to import

    from orchestrator.report.plot_style import STYLE  # noqa: PLC0415 - as above

    with plt.rc_context(STYLE):
        _, axes = plt.subplots(figsize=(width, height), layout="constrained")
    return axes


def curves_on(axes: Axes) -> int:
    """Number of scenarios that Axes show already: it is the index of the next one's colour."""
    return len(axes.get_legend_handles_labels()[1])


def page(title: str, lines: Iterable[str] = (), table: pd.DataFrame | None = None, rest: str = "") -> str:
    """HTML of a result: a title, lines of text, a table, and HTML of parts.

    Parameters
    ----------
    title, lines
        Plain text.
    table
        Its first rows are shown.
    rest
        HTML.
    """
    parts = [f"<p><b>{escape(title)}</b></p>", *(f"<p>{escape(line)}</p>" for line in lines)]
    if table is not None:
        counted = isinstance(table.index, pd.RangeIndex) and table.index.name is None
        figures = "{:.5g}".format
        parts.append(table.to_html(max_rows=_ROWS, na_rep="", float_format=figures, index=not counted))
    return "\n".join([*parts, rest])
