"""Plots of signals of a run as picture files."""

from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
from matplotlib.figure import Figure

from orchestrator.cases.schema import PlotTable
from orchestrator.report.plot_style import STYLE, add_legend, colour, save_figure
from orchestrator.results.signals import signal
from orchestrator.study.run import RunResult


def plot_signals(table: PlotTable, results: Sequence[RunResult], path: Path) -> bool:
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
