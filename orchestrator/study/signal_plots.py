"""Plots of signals of a run as picture files."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.figure import Figure

from orchestrator.cases.schema import PlotTable
from orchestrator.report.plot_style import STYLE, add_legend, colour, save_figure
from orchestrator.results.signals import outline, signal
from orchestrator.study.run import RunResult


def plot_signals(table: PlotTable, results: Sequence[RunResult], path: Path) -> bool:
    """Draw one figure of a case file, all scenarios in each panel; False if nothing of it was recorded.

    A panel whose signal no scenario recorded says so."""
    if all(signal(r.dataset.isel(time=slice(1)), panel.signal) is None for panel in table.panels for r in results):
        return False
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(7.2, 1.3 + 1.9 * len(table.panels)), layout="constrained")
        axes = figure.subplots(len(table.panels), 1, sharex=True, squeeze=False)[:, 0]
        for axis, panel in zip(axes, table.panels, strict=True):
            several = len(results) == 1 and bool(panel.also)
            for k, expression in enumerate((panel.signal, *panel.also)):
                draw_signal(
                    axis, results, expression, panel.scale, k if several else 0, expression if several else None
                )
            if several and axis.lines:
                axis.legend(loc="best", fontsize="x-small")
            axis.set_ylabel(panel.label)
            if not axis.lines:
                said = f"{panel.signal} was not recorded"
                axis.text(0.5, 0.5, said, transform=axis.transAxes, ha="center", va="center", parse_math=False)
        dashed = "; dashed: linear model" if any(r.linear is not None for r in results) else ""
        axes[0].set_title(f"{table.title}{dashed}", loc="left")
        axes[-1].set_xlabel("Time [s]")
        full = next(axis for axis in axes if axis.lines)
        handles, labels = full.get_legend_handles_labels()
        first = dict(zip(labels, handles, strict=True))
        if len(results) > 1 or not any(panel.also for panel in table.panels):
            add_legend(figure, [*first.values()], [*first])
        save_figure(figure, path)
    return True


def draw_signal(
    axis: Any, results: Sequence[RunResult], expression: str, scale: float = 1.0, first: int = 0,
    label: str | None = None,
) -> None:  # fmt: skip
    """One signal of all runs that recorded it; dashed, the linear model's response where there is one."""
    for index, result in enumerate(results, start=first):
        data = outline(result.dataset, expression)
        if data is not None:
            axis.plot(data["time"], scale * data, color=colour(index), label=label or result.modes.label)
        follows = outline(result.linear, expression) if result.linear is not None else None
        if follows is not None:
            axis.plot(follows["time"], scale * follows, color="black", linewidth=0.8, linestyle="--")
    axis.margins(x=0)
