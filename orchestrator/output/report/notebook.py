"""How results show themselves: HTML for a notebook, and Matplotlib Axes to draw on."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape
from typing import Any

from orchestrator.core.errors import InputError
from orchestrator.core.late import pd

# ``matplotlib.axes.Axes``; to import the class takes a second, which only plots are worth
Axes = Any

_ROWS = 40


def new_axes(width: float = 7.2, height: float = 4.4, *, polar: bool = False) -> Axes:
    """Axes of a new figure of pyplot, in the look of all plots."""
    import matplotlib as mpl  # noqa: PLC0415 - a second to import
    import matplotlib.pyplot as plt  # noqa: PLC0415 - as above

    from orchestrator.output.report.plot_style import STYLE  # noqa: PLC0415 - as above

    # The figure comes before the style: a notebook's backend sets itself up with the first figure, and a context
    # around that would take its settings back, so that no later figure is shown.
    figure = plt.figure(figsize=(width, height), layout="constrained")
    with mpl.rc_context(STYLE):
        return figure.subplots(subplot_kw={"projection": "polar"} if polar else None)


def axes_or_new(given: Axes, width: float, height: float, *, polar: bool = False) -> Axes:
    if given is None:
        return new_axes(width, height, polar=polar)
    if not hasattr(given, "get_legend_handles_labels"):
        raise InputError(
            f"ax = {given!r}; give Matplotlib Axes, such as those that another plot returned"
        )
    if polar and getattr(given, "name", "") != "polar":
        raise InputError(
            "ax: a mode's shape is drawn on polar Axes; make them by plt.subplots(subplot_kw={'projection': 'polar'})"
        )
    return given


def curves_on(axes: Axes) -> int:
    """Number of scenarios that Axes show already: it is the index of the next one's colour."""
    return len(axes.get_legend_handles_labels()[1])


_COLOURS = {True: "#17803f", False: "#c62828", None: "inherit"}
"""Of a verdict that is good, bad or not known, on a light ground and on a dark one."""


def headline(text: str, good: bool | None) -> str:
    """Return a verdict as HTML, in its colour."""
    return f'<p style="font-size: 1.15em; color: {_COLOURS[good]}"><b>{escape(text)}</b></p>'


def page(
    title: str,
    lines: Iterable[str] = (),
    table: pd.DataFrame | None = None,
    rest: str = "",
    verdict: str = "",
) -> str:
    """HTML of a result; of its table the first rows are shown.

    ``verdict``, which stands on top, and ``rest``, which stands below, are HTML already."""
    parts = [verdict, f"<p><b>{escape(title)}</b></p>"]
    parts += [f"<p>{escape(line)}</p>" for line in lines]
    if table is not None:
        counted = isinstance(table.index, pd.RangeIndex) and table.index.name is None
        figures = "{:.5g}".format
        parts.append(
            table.to_html(max_rows=_ROWS, na_rep="", float_format=figures, index=not counted)
        )
    return "\n".join(filter(None, [*parts, rest]))
