"""Plots of a sweep: trajectories in the complex plane, and figures of the named modes over the parameter."""

from collections.abc import Callable, Iterator, Sequence
from operator import itemgetter
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from orchestrator.output.report.colours import colour
from orchestrator.output.report.plot_style import STYLE, save_figure
from orchestrator.studies.runs.mode_plots import damping_rays
from orchestrator.studies.sweep.dataset import Curve, Samples
from orchestrator.studies.sweep.sweep import ScenarioSweep
from orchestrator.studies.sweep.trajectories import Trajectory

# the complex plane leaves out modes whose damping stays above this [%] at all points
_LEAST_DAMPED = 75.0

_DASHES = ("-", "--", ":", "-.")


def save_sweep_plots(samples: Samples, folder: Path) -> list[Path]:
    plots: list[tuple[Callable[[Samples, Path], bool], str]] = [
        (plot_trajectories, "trajectories.png"),
        (plot_named, "named_modes.png"),
        (plot_swing, "sweep_participation.png"),
    ]
    return [folder / name for plot, name in plots if plot(samples, folder / name)]


def _rows(curve: Curve) -> Iterator[Curve]:
    """Pieces of a curve without a gap, along the last axis."""
    piece: Curve = []
    for place, sample in curve:
        if piece and not (place[:-1] == piece[-1][0][:-1] and place[-1] == piece[-1][0][-1] + 1):
            yield piece
            piece = []
        piece.append((place, sample))
    if piece:
        yield piece


def plot_trajectories(samples: Samples, path: Path) -> bool:
    """Complex plane with rays of equal damping as a picture; False where no mode is in it."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(8.0, 6.2), layout="constrained")
        axis = figure.subplots()
        if not draw_trajectories(axis, samples):
            return False
        figure.legend(loc="outside lower center", ncols=3)
        save_figure(figure, path)
    return True


def draw_trajectories(axis: Any, samples: Samples) -> bool:
    """Complex plane with rays of equal damping; a circle where each trajectory starts; False where no mode is in it."""
    drawn: list[tuple[int, Trajectory, Curve]] = []
    for k, sweep in enumerate(samples.result.scenarios):
        for trajectory in sweep.trajectories:
            curve = samples.of(sweep, trajectory)
            if any(sample["damping"] < _LEAST_DAMPED for _, sample in curve):
                drawn.append((k, trajectory, curve))
    points = [
        sample for _, _, curve in drawn for _, sample in curve if sample["damping"] < _LEAST_DAMPED
    ]
    if not points:
        return False
    left = min(-1.0, 1.05 * min(p["real"] for p in points))
    right = max(0.35, 1.2 * max(p["real"] for p in points))
    highest = 1.08 * max(p["frequency"] for p in points)
    for k, trajectory, curve in drawn:
        strong = trajectory.case_name is not None
        for piece in _rows(curve):
            at = [s["real"] for _, s in piece], [s["frequency"] for _, s in piece]
            axis.plot(
                *at, color=colour(k), linewidth=1.8 if strong else 0.9, alpha=1.0 if strong else 0.7
            )
            axis.plot(*at, ".", color=colour(k), markersize=4.5 if strong else 2.5)
            axis.plot(
                at[0][0],
                at[1][0],
                "o",
                color=colour(k),
                markerfacecolor="white",
                markersize=6,
                zorder=4,
            )
        if strong:
            ends = [(s["real"], s["frequency"]) for _, s in curve]
            axis.annotate(
                _number(trajectory),
                ends[-1],
                xytext=(5, 3),
                textcoords="offset points",
                color=colour(k),
                fontsize=9,
            )
    for k, sweep in enumerate(samples.result.scenarios):
        unstable = len(sweep.unstable(samples.axes))
        words = f": UNSTABLE at {unstable} of its points" if unstable else ""
        axis.plot([], [], color=colour(k), label=sweep.prepared.title + words)
    numbered = {t.name: number for _, t, _ in drawn if t.case_name and (number := _number(t))}
    for name, number in numbered.items():
        axis.plot([], [], linestyle="", marker=f"${number}$", color="black", label=name)
    axis.set_xlim(left, right)
    axis.set_ylim(0, highest)
    damping_rays(axis, left, highest)
    axis.axvline(0, color="#888888", linewidth=0.8)
    axis.set_xlabel("Real part [1/s]")
    axis.set_ylabel("Frequency [Hz]")
    title = "\n".join(
        f"{axis_label(a)} from {a.values[0]:g} to {a.values[-1]:g}" for a in samples.axes
    )
    axis.set_title(f"{title} (circle: start; thick: named modes)", loc="left")
    return True


def axis_label(axis: Any) -> str:
    """``grid.X_L [pu]``."""
    return f"{axis.key} [{axis.unit}]" if axis.unit else str(axis.key)


def _named_curves(samples: Samples) -> list[tuple[int, ScenarioSweep, Trajectory, Curve]]:
    return [
        (k, sweep, trajectory, samples.of(sweep, trajectory))
        for k, sweep in enumerate(samples.result.scenarios)
        for trajectory in sweep.trajectories
        if trajectory.case_name is not None
    ]


def _draw(
    axis: Any,
    samples: Samples,
    curve: Curve,
    value: Callable[[dict[str, Any]], float],
    **style: Any,
) -> None:
    last = samples.axes[-1]
    for piece in _rows(curve):
        x = np.array([float(last.values[int(place[-1])]) for place, _ in piece])
        y = np.array([value(sample) for _, sample in piece])
        named = np.array([sample["named"] for _, sample in piece])
        axis.plot(x, y, linewidth=0.9, alpha=0.75, **style)
        axis.plot(x, np.where(named, y, np.nan), linewidth=2.4, **style)
    if last.logarithmic:
        axis.set_xscale("log")


def plot_named(samples: Samples, path: Path) -> bool:
    """Damping and frequency of the named modes over the last parameter; False if none has a name."""
    panels = [("Damping [%]", itemgetter("damping")), ("Frequency [Hz]", itemgetter("frequency"))]
    return _plot_panels(samples, path, panels, 6.0)


def plot_swing(samples: Samples, path: Path) -> bool:
    """Participation of the swing states in the named modes; False if there are none."""
    panels = [(f"{state} [%]", _percent_of(state)) for state in samples.states[:6]]
    return _plot_panels(samples, path, panels, 0.8 + 2.3 * len(panels), sharey=True)


def _plot_panels(
    samples: Samples,
    path: Path,
    panels: Sequence[tuple[str, Callable[[dict[str, Any]], float]]],
    height: float,
    *,
    sharey: bool = False,
) -> bool:
    curves = _named_curves(samples)
    if not curves or not panels:
        return False
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(7.6, height), layout="constrained")
        axes = figure.subplots(len(panels), 1, sharex=True, sharey=sharey, squeeze=False)[:, 0]
        for k, _, trajectory, curve in curves:
            for axis, (label, value) in zip(axes, panels, strict=True):
                _draw(axis, samples, curve, value, color=colour(k), linestyle=_dash(trajectory))
                axis.set_ylabel(label)
        if not sharey:
            axes[0].axhline(0, color="#888888", linewidth=0.8)
        axes[-1].set_ylim(bottom=0)
        _finish(figure, axes, samples, curves)
        save_figure(figure, path)
    return True


def _percent_of(state: str) -> Callable[[dict[str, Any]], float]:
    return lambda sample: 100 * float(sample["states"].get(state, np.nan))


def _dash(trajectory: Trajectory) -> str:
    number = _number(trajectory)
    return _DASHES[(int(number) - 1) % len(_DASHES)] if number.isdigit() else _DASHES[0]


def _number(trajectory: Trajectory) -> str:
    """Which of the modes that bear the same name it is; empty if it is the only one."""
    return trajectory.name.removeprefix(trajectory.case_name or "").strip()


def _finish(figure: Figure, axes: Any, samples: Samples, curves: Any) -> None:
    for k, sweep, trajectory, _ in curves:
        label = sweep.prepared.title
        label += f": {trajectory.name}" if trajectory.name != trajectory.case_name else ""
        axes[0].plot([], [], color=colour(k), linestyle=_dash(trajectory), label=label)
    handles, labels = axes[0].get_legend_handles_labels()
    axes[0].set_title("Named modes (thick: where the case's name falls on the mode)", loc="left")
    axes[-1].set_xlabel(axis_label(samples.axes[-1]))
    axes[-1].margins(x=0.01)
    figure.legend(handles, labels, loc="outside lower center", ncols=2)
