"""Plots of signals as picture files, and the look that all plots share."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
from matplotlib.figure import Figure

from orchestrator.cases.schema import PlotTable
from orchestrator.report.signals import signal

if TYPE_CHECKING:
    from orchestrator.study.run import RunResult

STYLE: dict[Any, Any] = {
    "axes.grid": True,
    "grid.color": "#e3e3e3",
    "grid.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlesize": 11,
    "font.size": 9.5,
    "legend.frameon": False,
    "lines.linewidth": 1.3,
}
_COLOURS = ("#4d4d4d", "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")
"""Distinguishable with any colour vision (Okabe and Ito); a scenario keeps its colour in every plot."""
_DPI = 150
_LEGEND_WIDTH = 96
"""Characters that fit in a line of a legend, marks included."""


def plot_signals(table: PlotTable, results: Sequence["RunResult"], path: Path) -> bool:
    """Draw one figure of a case file, all scenarios in each panel; False if nothing of it was recorded."""
    drawn = [(p, [(k, r, signal(r.dataset, p.signal)) for k, r in enumerate(results)]) for p in table.panels]
    if all(data is None for _, curves in drawn for _, _, data in curves):
        return False
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(7.2, 1.3 + 1.9 * len(table.panels)), layout="constrained")
        axes = figure.subplots(len(table.panels), 1, sharex=True, squeeze=False)[:, 0]
        for axis, (panel, curves) in zip(axes, drawn, strict=True):
            for index, result, data in curves:
                if data is not None:
                    axis.plot(
                        data["time"],
                        panel.scale * data,
                        color=colour(index),
                        label=result.modes.label,
                    )
                follows = signal(result.linear, panel.signal) if result.linear is not None else None
                if follows is not None:
                    axis.plot(follows["time"], panel.scale * follows, color="black", linewidth=0.8, linestyle="--")
            axis.set_ylabel(panel.label)
            axis.margins(x=0)
        dashed = "; dashed: linear model" if any(r.linear is not None for r in results) else ""
        axes[0].set_title(f"{table.title}{dashed}", loc="left")
        axes[-1].set_xlabel("Time [s]")
        handles, labels = axes[0].get_legend_handles_labels()
        add_legend(figure, handles, labels)
        save_figure(figure, path)
    return True


def add_legend(figure: Figure, handles: Sequence[Any], labels: Sequence[str]) -> None:
    """Below the axes, in as many columns as the longest label leaves room for."""
    columns = max(1, min(3, _LEGEND_WIDTH // (6 + max(map(len, labels), default=1))))
    figure.legend(handles, labels, loc="outside lower center", ncols=columns)


def colour(index: int) -> str:
    """A scenario's colour, the same in every plot."""
    return _COLOURS[index % len(_COLOURS)]


def save_figure(figure: Figure, path: Path) -> None:
    """Write a figure, with the folder it belongs in."""
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=_DPI)
