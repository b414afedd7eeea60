"""Plots of a study as picture files."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from orchestrator.cases.schema import PlotTable, ReferenceModeTable
from orchestrator.report.signals import signal

if TYPE_CHECKING:
    from orchestrator.study import ModesResult, RunResult

_STYLE: dict[Any, Any] = {
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


def plot_signals(table: PlotTable, results: Sequence["RunResult"], path: Path) -> bool:
    """Draw one figure of a case file, all scenarios in each panel; False if nothing of it was recorded."""
    drawn = [(p, [(k, r, signal(r.dataset, p.signal)) for k, r in enumerate(results)]) for p in table.panels]
    if all(data is None for _, curves in drawn for _, _, data in curves):
        return False
    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(7.2, 1.3 + 1.9 * len(table.panels)), layout="constrained")
        axes = figure.subplots(len(table.panels), 1, sharex=True, squeeze=False)[:, 0]
        for axis, (panel, curves) in zip(axes, drawn, strict=True):
            for index, result, data in curves:
                if data is not None:
                    axis.plot(
                        data["time"],
                        panel.scale * data,
                        color=_colour(index),
                        label=result.modes.prepared.title,
                    )
            axis.set_ylabel(panel.label)
            axis.margins(x=0)
        axes[0].set_title(table.title, loc="left")
        axes[-1].set_xlabel("Time [s]")
        handles, labels = axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=min(3, len(labels)))
        _save(figure, path)
    return True


def plot_eigenvalues(results: Sequence["ModesResult"], title: str, path: Path) -> None:
    """Eigenvalue map with rays of equal damping; other people's figures as open circles."""
    named = [m.frequency_hz for r in results for m in r.named.values()]
    highest_hz = 1.25 * max([*named, *(t.frequency_hz for r in results for t in r.references.values())], default=0.8)
    shown = {id(r): [m for m in r.modes if m.frequency_hz <= highest_hz and m.eigenvalue.real > -3] for r in results}
    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(7.2, 5.0), layout="constrained")
        axis = figure.subplots()
        for index, result in enumerate(results):
            modes = shown[id(result)]
            axis.scatter(
                [m.eigenvalue.real for m in modes],
                [m.frequency_hz for m in modes],
                marker="x",
                s=[70 if result.name_of(m) else 30 for m in modes],
                linewidths=[2.0 if result.name_of(m) else 1.0 for m in modes],
                color=_colour(index),
                label=result.prepared.title,
                zorder=3,
            )
            for reference in result.references.values():
                at = _real_and_hz(reference)
                axis.scatter(*at, marker="o", s=110, facecolors="none", edgecolors=_colour(index), zorder=3)
        left = min([-1.0, *(1.1 * m.eigenvalue.real for modes in shown.values() for m in modes)])
        axis.set_xlim(left, 0.35)
        axis.set_ylim(0, highest_hz)
        _damping_rays(axis, left, highest_hz)
        axis.axvline(0, color="#888888", linewidth=0.8)
        axis.set_xlabel("Real part [1/s]")
        axis.set_ylabel("Frequency [Hz]")
        axis.set_title(title, loc="left")
        figure.legend(loc="outside lower center", ncols=3)
        _save(figure, path)


def _real_and_hz(reference: ReferenceModeTable) -> tuple[float, float]:
    """Real part [1/s] and frequency [Hz], from the damping ratio where the source gives no eigenvalue."""
    if reference.real is not None:
        return reference.real, reference.frequency_hz
    ratio = reference.damping_percent / 100
    return float(-ratio / np.sqrt(1 - ratio**2) * 2 * np.pi * reference.frequency_hz), reference.frequency_hz


def _damping_rays(axis: Any, left: float, highest_hz: float) -> None:
    for percent in (5, 10, 15, 20, 30):
        ratio = percent / 100
        slope = ratio / np.sqrt(1 - ratio**2) * 2 * np.pi  # −Re λ per Hz
        end = min(highest_hz, -left / slope)
        axis.plot([0, -slope * end], [0, end], color="#b0b0b0", linewidth=0.7, linestyle="--", zorder=1)
        axis.annotate(f"{percent} %", (-slope * end, end), color="#888888", fontsize=8, ha="right", va="top")


def _colour(index: int) -> str:
    return _COLOURS[index % len(_COLOURS)]


def _save(figure: Figure, path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=_DPI)
