"""Plots: eigenvalue map, participation bars, who swings against whom, and a case's signals over the time."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from orchestrator.cases.form.schema import PlotTable, ReferenceModeTable
from orchestrator.linear.spectra.modes import Mode
from orchestrator.output.report.colours import colour
from orchestrator.output.report.plot_style import STYLE, add_legend, save_figure
from orchestrator.output.results.signals import outline, signal
from orchestrator.studies.modes.modes import ModesResult
from orchestrator.studies.runs.run import RunResult


def plot_signals(table: PlotTable, results: Sequence[RunResult], path: Path) -> bool:
    """Draw one figure of a case file, all scenarios in each panel; False if nothing of it was recorded.

    A panel whose signal no scenario recorded says so."""
    if all(
        signal(r.dataset.isel(time=slice(1)), panel.signal) is None
        for panel in table.panels
        for r in results
    ):
        return False
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(7.2, 1.3 + 1.9 * len(table.panels)), layout="constrained")
        axes = figure.subplots(len(table.panels), 1, sharex=True, squeeze=False)[:, 0]
        for axis, panel in zip(axes, table.panels, strict=True):
            several = len(results) == 1 and bool(panel.also)
            for k, expression in enumerate((panel.signal, *panel.also)):
                draw_signal(
                    axis,
                    results,
                    expression,
                    panel.scale,
                    k if several else 0,
                    expression if several else None,
                )
            if several and axis.lines:
                axis.legend(loc="best", fontsize="x-small")
            axis.set_ylabel(panel.label)
            if not axis.lines:
                said = f"{panel.signal} was not recorded"
                axis.text(
                    0.5,
                    0.5,
                    said,
                    transform=axis.transAxes,
                    ha="center",
                    va="center",
                    parse_math=False,
                )
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
    axis: Any,
    results: Sequence[RunResult],
    expression: str,
    scale: float = 1.0,
    first: int = 0,
    label: str | None = None,
) -> None:
    """One signal of all runs that recorded it; dashed, the linear model's response where there is one."""
    for index, result in enumerate(results, start=first):
        data = outline(result.dataset, expression)
        if data is not None:
            axis.plot(
                data["time"], scale * data, color=colour(index), label=label or result.modes.label
            )
        follows = outline(result.linear, expression) if result.linear is not None else None
        if follows is not None:
            axis.plot(
                follows["time"], scale * follows, color="black", linewidth=0.8, linestyle="--"
            )
    axis.margins(x=0)


_BARS = 10  # components with a bar in each mode, those that take part most
_NAMED = 4  # components of each side of a mode shape that are named, largest first


_RAY = "damping ray"  # marks what belongs to a ray
_MODE_LABEL = "mode"  # marks the label of a mode
_LABEL_GAP = (7, 3)  # between a mode and its label, across and up [points]
# of a label, what is turned to its mode; the first that has room is taken
_LABEL_SIDES = (("right", "bottom"), ("left", "bottom"), ("right", "top"), ("left", "top"))
_RAY_LABEL = (0.055, 0.05)  # room for a ray's label, in parts of the Axes' width and height


def plot_eigenvalues(results: Sequence[ModesResult], title: str, path: Path) -> None:
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(7.2, 5.0), layout="constrained")
        axis = figure.subplots()
        draw_eigenvalues(axis, results)
        axis.set_title(title, loc="left")
        add_legend(figure, *axis.get_legend_handles_labels())
        save_figure(figure, path)


def draw_eigenvalues(
    axis: Any,
    results: Sequence[ModesResult],
    first: int = 0,
    *,
    radians: bool = False,
    annotate: bool = False,
) -> None:
    """Eigenvalue map with rays of equal damping; other people's figures as open circles.

    ``radians``: the imaginary part [rad/s] instead of the frequency.
    ``annotate``: frequency and damping beside each mode, with its name where it has one."""
    turn = 2 * np.pi if radians else 1.0
    named = [m.frequency_hz for r in results for m in r.named.values()]
    highest_hz = 1.25 * max(
        [*named, *(t.frequency_hz for r in results for t in r.references.values())], default=0.8
    )
    if first:
        highest_hz = max(highest_hz, axis.get_ylim()[1] / turn)
    shown = {
        id(r): [m for m in r.modes if m.frequency_hz <= highest_hz and m.eigenvalue.real > -3]
        for r in results
    }
    for index, result in enumerate(results, start=first):
        modes = shown[id(result)]
        sizes = [70 if result.name_of(m) else 30 for m in modes]
        widths = [2.0 if result.name_of(m) else 1.0 for m in modes]
        axis.scatter(
            [m.eigenvalue.real for m in modes],
            [m.frequency_hz * turn for m in modes],
            marker="x",
            # the legend takes its mark from here
            s=sizes or 30,
            linewidths=widths or 1.0,
            color=colour(index),
            label=result.label,
            zorder=3,
        )
        for mode in modes if annotate else ():
            text = f"{result.name_of(mode) or ''} {mode.frequency_hz:.2f} Hz, {mode.damping_percent:.1f} %"
            look = {"size": "x-small", "color": colour(index), "gid": _MODE_LABEL}
            place = (mode.eigenvalue.real, mode.frequency_hz * turn)
            axis.annotate(text.strip(), place, textcoords="offset points", xytext=(0, 0), **look)
        for reference in result.references.values():
            real, hertz = _real_and_hz(reference)
            axis.scatter(
                real,
                hertz * turn,
                marker="o",
                s=110,
                facecolors="none",
                edgecolors=colour(index),
                zorder=3,
            )
    left = min([-1.0, *(1.1 * m.eigenvalue.real for modes in shown.values() for m in modes)])
    if first:
        left = min(left, axis.get_xlim()[0])
    axis.set_xlim(left, 0.35)
    axis.set_ylim(0, highest_hz * turn)
    damping_rays(axis, left, highest_hz * turn, turn)
    if not first:
        axis.axvline(0, color="#888888", linewidth=0.8)
    axis.set_xlabel("Real part [1/s]")
    axis.set_ylabel("Imaginary part [rad/s]" if radians else "Frequency [Hz]")
    _place_mode_labels(axis)


def _place_mode_labels(axis: Any) -> None:
    """Put each label of a mode beside it, where the frame and the labels before it leave room."""
    labels = [text for text in axis.texts if text.get_gid() == _MODE_LABEL]
    if not labels:
        return
    axis.figure.draw_without_rendering()  # its layout decides how wide the frame is
    frame, taken = axis.get_window_extent(), list[Any]()
    for label in labels:
        places = [_extent(label, side) for side in _LABEL_SIDES]
        inside = [k for k, box in enumerate(places) if _holds(frame, box)] or [0]
        free = [k for k in inside if not places[k].count_overlaps(taken)]
        best = (free or inside)[0]
        taken.append(_extent(label, _LABEL_SIDES[best]))


def _extent(label: Any, side: tuple[str, str]) -> Any:
    """Put a label on a side of its mode, and tell the box that it fills."""
    across, up = _LABEL_GAP
    x = -across if side[0] == "right" else across
    y = up if side[1] == "bottom" else -up
    label.set(ha=side[0], va=side[1], position=(x, y))
    return label.get_window_extent()


def _holds(frame: Any, box: Any) -> bool:
    return bool(
        frame.x0 <= box.x0 and box.x1 <= frame.x1 and frame.y0 <= box.y0 and box.y1 <= frame.y1
    )


def _real_and_hz(reference: ReferenceModeTable) -> tuple[float, float]:
    """Real part [1/s] and frequency [Hz], from the damping ratio where the source gives no eigenvalue."""
    if reference.real is not None:
        return reference.real, reference.frequency_hz
    ratio = reference.damping_percent / 100
    return float(
        -ratio / np.sqrt(1 - ratio**2) * 2 * np.pi * reference.frequency_hz
    ), reference.frequency_hz


def damping_rays(axis: Any, left: float, highest: float, turn: float = 1.0) -> None:
    """Rays of equal damping ratio from 5 to 30 %, between a real part [1/s] and a frequency [Hz, or times ``turn``].

    Each has its label on it, inside of the Axes, whose limits must be set before. Rays that the Axes have are replaced.
    """
    for old in [artist for artist in (*axis.lines, *axis.texts) if artist.get_gid() == _RAY]:
        old.remove()
    labels: list[tuple[float, float]] = []
    for percent in (5, 10, 15, 20, 30):
        ratio = percent / 100
        slope = ratio / np.sqrt(1 - ratio**2) * 2 * np.pi / turn  # −Re λ per unit of the axis
        end = min(highest, -left / slope)
        axis.plot(
            [0, -slope * end],
            [0, end],
            color="#b0b0b0",
            linewidth=0.7,
            linestyle="--",
            zorder=1,
            gid=_RAY,
        )
        labels.append(_place_of_label(axis, slope, labels))
        behind = {"facecolor": "white", "edgecolor": "none", "pad": 1.0}
        words = {"color": "#888888", "fontsize": 8, "ha": "center", "va": "center"}
        axis.text(*labels[-1], f"{percent} %", bbox=behind, zorder=1.5, gid=_RAY, **words)


def _place_of_label(
    axis: Any, slope: float, others: Sequence[tuple[float, float]]
) -> tuple[float, float]:
    """Where a ray's label lies on it: as far out as the edges and the other labels leave room."""
    (left, right), (_, highest) = axis.get_xlim(), axis.get_ylim()
    width, height = _RAY_LABEL[0] * (right - left), _RAY_LABEL[1] * highest
    hertz = min(highest - 0.6 * height, (-left - 0.6 * width) / slope)
    while hertz > height and any(
        abs(hertz - y) < height and abs(slope * hertz + x) < width for x, y in others
    ):
        hertz -= 0.25 * height
    return -slope * hertz, hertz


def plot_participation(results: Sequence[ModesResult], path: Path) -> bool:
    """Participation of the components in each named mode, one bar a scenario; False if no mode has a name."""
    names = list(dict.fromkeys(name for r in results for name in r.named))
    if not names:
        return False
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(7.6, 0.9 + 2.1 * len(names)), layout="constrained")
        axes = figure.subplots(len(names), 1, squeeze=False)[:, 0]
        for axis, name in zip(axes, names, strict=True):
            draw_participation(axis, results, name)
            axis.set_title(
                f"Mode {name}" if len(names) > 1 else f"{name.capitalize()} mode", loc="left"
            )
        handles, labels = axes[0].get_legend_handles_labels()
        add_legend(figure, handles, labels)
        save_figure(figure, path)
    return True


def draw_participation(axis: Any, results: Sequence[ModesResult], name: str) -> None:
    """Bars of the components that take part most in a named mode, on Matplotlib Axes."""
    shares = {k: r.named[name].by_component for k, r in enumerate(results) if name in r.named}
    most = {c: max(s.get(c, 0.0) for s in shares.values()) for s in shares.values() for c in s}
    components = sorted(most, key=lambda c: -most[c])[:_BARS]
    width = 0.8 / len(results)
    for k, share in shares.items():
        at = np.arange(len(components)) + (k - (len(results) - 1) / 2) * width
        heights = [100 * share.get(c, 0.0) for c in components]
        axis.bar(at, heights, width, color=colour(k), label=results[k].prepared.title, zorder=3)
    axis.set_xticks(range(len(components)), components)
    axis.set_ylabel("Participation [%]")
    axis.grid(visible=False, axis="x")


def plot_mode_shapes(results: Sequence[ModesResult], path: Path) -> bool:
    """Speeds in each named mode as arrows, one row a mode and one column a scenario; False if there are none."""
    names = list(dict.fromkeys(name for r in results for name in r.named))
    if not names or not any(r.swing for r in results):
        return False
    rows, columns = len(names), len(results)
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(max(4.0, 2.5 * columns), 0.4 + 2.75 * rows), layout="constrained")
        axes = figure.subplots(rows, columns, squeeze=False, subplot_kw={"projection": "polar"})
        for row, name in enumerate(names):
            for column, result in enumerate(results):
                axis = axes[row, column]
                draw_mode_shape(axis, result, name, colour(column))
                mode = result.named.get(name)
                figures = (
                    f"\n{mode.frequency_hz:.2f} Hz, {mode.damping_percent:.1f} %"
                    if mode
                    else "\nnone in range"
                )
                axis.set_title(f"{name}: {result.prepared.title}{figures}", fontsize=8.5)
        save_figure(figure, path)
    return True


def draw_mode_shape(axis: Any, result: ModesResult, name: str, shade: str) -> None:
    """Arrows of the states that swing in a named mode, on polar Matplotlib Axes."""
    draw_shape(axis, result.named.get(name), result.swing, shade)


def draw_shape(axis: Any, mode: Mode | None, swing: Sequence[str], shade: str | None) -> None:
    """Arrows of those states that swing in a mode, on polar Matplotlib Axes; ``shade`` is their colour."""
    axis.set_ylim(0, 1.08)
    axis.spines["polar"].set_visible(False)
    axis.set_yticks([0.5, 1.0], [])
    axis.set_xticks(np.deg2rad([0, 90, 180, 270]), [])
    if mode is None:
        return
    together, against = mode.swing(swing, least=0.0)
    shade = colour(0) if shade is None else shade
    if not together:
        return
    leader = mode.shape[together[0]]
    for state in (*together, *against):
        value = mode.shape[state] / leader
        axis.plot([np.angle(value)] * 2, [0, abs(value)], color=shade, linewidth=1.0, alpha=0.85)
        axis.plot(np.angle(value), abs(value), marker="o", markersize=2.5, color=shade)
    right, left = (
        ", ".join(s.partition(".")[0] for s in side[:_NAMED]) for side in (together, against)
    )
    axis.set_xlabel(f"→ {right}\n← {left}", fontsize=7.5)
