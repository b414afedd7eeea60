"""Pictures of a cut: eigenloci with the unit circle and the margins, the matrices over frequency, the active bands."""

from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from orchestrator.output.report.colours import colour
from orchestrator.output.report.plot_style import STYLE, add_legend, save_figure
from orchestrator.studies.immittance.judgement import CutJudgement
from orchestrator.studies.immittance.retune import Retuned
from orchestrator.studies.immittance.sides import short_name
from orchestrator.studies.immittance.study import CutResult

_PANELS = 4  # parameters in a picture
_NAMED = 8  # loci, and crossings nearest to −1, that are told apart


def draw(
    result: CutResult, folder: Path, retuned: Sequence[Retuned] = (), goal: float = 0.0
) -> list[Path]:
    """Write ``eigenloci.png``, ``matrices.png``, and what parameters do as ``retune.png``."""
    loci, matrices = folder / "eigenloci.png", folder / "matrices.png"
    with mpl.rc_context(STYLE):
        save_figure(
            _eigenloci(
                result.judgement, f"{result.verdict}: {short_name(result.loop.device.name)}"
            ),
            loci,
        )
        save_figure(_matrices(result), matrices)
        shown = [one for one in retuned if one.figures][:_PANELS]
        if shown:
            save_figure(_retuned(shown, goal, result.scr), folder / "retune.png")
    return [loci, matrices, *([folder / "retune.png"] if shown else [])]


def _retuned(shown: Sequence[Retuned], goal: float, scr: float | None) -> Figure:
    """Distance, damping and the ratio at which stability is lost, a column for each parameter."""
    rows = 2 if scr is None else 3
    figure = Figure(
        figsize=(2.7 * max(len(shown), 3) + 0.6, 2.0 * rows + 0.6), layout="constrained"
    )
    axes = figure.subplots(rows, len(shown), squeeze=False, sharex="col", sharey="row")
    for column, one in zip(axes.T, shown, strict=True):
        x, now = one.values, one.setting.now
        curves = [
            one.distances,
            [f.damping for f in one.figures],
            [(scr or 0) / f.weaker for f in one.figures],
        ]
        for k, (axis, y, line) in enumerate(zip(column, curves, (goal, 0.0, scr), strict=False)):
            axis.plot(x, y, color=colour(k + 1), label=None if k else "from the scans' functions")
            axis.axhline(
                line,
                color="#888888",
                linestyle="--",
                linewidth=0.8,
                label=None if k else f"wanted: {goal:g}",
            )
            axis.axvline(now, color="#888888", linewidth=0.8, linestyle=":")
        column[0].plot(
            [c.value for c in one.checks],
            [c.found for c in one.checks],
            "o",
            color="black",
            ms=3.5,
            label="scanned after it was predicted",
        )
        column[0].axhspan(
            min(-0.02, np.nanmin(one.distances)), 0, color="#a11d1d", alpha=0.08, label="unstable"
        )
        column[-1].set_xscale("log" if x[0] > 0 else "linear")
        column[-1].set_xticks(
            [x[0], now, x[-1]], [f"{v:.3g}" for v in (x[0], now, x[-1])], minor=False
        )
        column[-1].minorticks_off()
        column[-1].set_xlabel(
            one.setting.name + (f" [{one.setting.unit}]" if one.setting.unit != "1" else "")
        )
    for axis, label in zip(
        axes[:, 0], ("Distance from −1", "Least damping [%]", "Lost below SCR"), strict=False
    ):
        axis.set_ylabel(label)
    add_legend(figure, *axes[0, 0].get_legend_handles_labels())
    return figure


def _eigenloci(judgement: CutJudgement, title: str) -> Figure:
    figure = Figure(figsize=(9.0, 4.6), layout="constrained")
    path, m, count = judgement.path, judgement.margins, judgement.path.loci.shape[1]
    nearest = sorted(judgement.crossings, key=lambda c: abs(1 + c.real))[:_NAMED]
    near = 1.2 * max([1.5, *(min(abs(c.real), 3.0) for c in judgement.crossings)])
    for axes, reach, name in zip(
        figure.subplots(1, 2), (near, 3 * near), (title, "the same, further off"), strict=True
    ):
        for k in range(count):
            z = path.loci[:, k]
            of_all = None if k else f"{count} loci"
            label = f"locus {k + 1}" if count <= _NAMED else of_all
            axes.plot(z.real, z.imag, color=colour(k + 1), label=label)
            axes.plot(z.real, -z.imag, color=colour(k + 1), linestyle=":", linewidth=0.8)
        turn = np.exp(2j * np.pi * np.linspace(0, 1, 200))
        axes.plot(turn.real, turn.imag, color="#888888", linewidth=0.8, label="unit circle")
        if not judgement.reasons:
            close = -1 + m.distance.value * turn
            axes.plot(
                close.real,
                close.imag,
                color="#a11d1d",
                linewidth=0.8,
                linestyle="--",
                label=f"distance {m.distance.value:.3g} at {m.distance.frequency_hz:.3g} Hz",
            )
        axes.plot([-1], [0], "+", color="#a11d1d", ms=10, mew=2)
        for k, c in enumerate(nearest):
            axes.plot([c.real], [0], "o", color="black", ms=3.5)
            if abs(c.real) < reach and reach == near:
                axes.annotate(
                    f"{c.real:.3f} at {c.frequency_hz:.2f} Hz",
                    (c.real, 0),
                    (-12, 18 + 13 * (k % 4)),
                    fontsize=8,
                    textcoords="offset points",
                    arrowprops={"arrowstyle": "-", "linewidth": 0.5},
                )
        for margin, text in ((m.gain, "gain × {:.3g}"), (m.phase_deg, "phase {:.3g}°")):
            if margin is not None and not judgement.reasons:
                axes.plot(
                    [],
                    [],
                    " ",
                    label=f"{text.format(margin.value)} at {margin.frequency_hz:.4g} Hz",
                )
        axes.set(
            xlim=(-reach, reach),
            ylim=(-reach, reach),
            xlabel="Re λ(Z·Y)",
            ylabel="Im λ(Z·Y)",
            aspect="equal",
        )
        axes.set_title(name, loc="left")
    figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=4)
    return figure


def _matrices(result: CutResult) -> Figure:
    figure = Figure(figsize=(9.0, 6.4), layout="constrained")
    axes = figure.subplots(2, 2, sharex=True)
    low, high = result.judgement.range_hz
    f = np.geomspace(max(low, 0.01), high, 1000)
    sides = (
        (result.loop.device, f"Device admittance [{result.unit}]"),
        (result.loop.network, f"Network impedance [{'Ω' if result.unit == 'S' else 'pu'}]"),
    )
    for column, (side, label) in enumerate(sides):
        M = side.at(2j * np.pi * f) if column == 0 else result.loop.impedance(2j * np.pi * f)
        for k, (i, j) in enumerate(np.ndindex(2, 2)):
            axes[0, column].loglog(
                f, np.abs(M[:, i, j]) + 1e-300, color=colour(k), label="dq"[i] + "dq"[j]
            )
            axes[1, column].semilogx(f, np.rad2deg(np.angle(M[:, i, j])), color=colour(k))
        size = np.median(np.abs(M[:, :2, :2]).max(axis=(1, 2)))
        axes[0, column].set_ylim(1e-3 * size, max(30 * size, 1.5 * np.abs(M[[0, -1]]).max()))
        axes[0, column].set_title(label, loc="left")
        axes[1, column].set(
            xlabel="Frequency in dq [Hz]", ylabel="Phase [°]", yticks=range(-180, 181, 90)
        )
        for band in result.judgement.active[("device", "network")[column]]:
            for row in (0, 1):
                axes[row, column].axvspan(
                    *band, color="#a11d1d", alpha=0.08, label="not passive" if row == 0 else None
                )
    handles, labels = axes[0, 0].get_legend_handles_labels()
    unique = dict(zip(labels, handles, strict=True))
    figure.legend(unique.values(), unique.keys(), loc="outside lower center", ncols=5)
    return figure
