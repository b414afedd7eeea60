"""Files of a device's voltage source behaviour: figures, impedances and their picture."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from orchestrator.output.report.colours import colour
from orchestrator.output.report.plot_style import STYLE, save_figure
from orchestrator.output.results.file_writers import save_json, save_table
from orchestrator.studies.certification.codes.frequency.point import AtPoint
from orchestrator.studies.certification.codes.frequency.verdict import (
    SOURCES,
    sentence_of,
    verdict_of,
)

KEY = "frequency"
FIGURES_JSON = "frequency.json"
IMPEDANCE_CSV = "impedance.csv"
PICTURE = "impedance.png"


def figures_of(points: Sequence[AtPoint], model: str, f_n: float) -> dict[str, Any]:
    """The result as JSON's types."""
    return {
        "code": KEY,
        "model": model,
        "rated_hz": f_n,
        "verdict": verdict_of(points),
        "sentence": sentence_of(points),
        "sources": list(SOURCES),
        "points": [one.figures() for one in points],
    }


def save(points: Sequence[AtPoint], figures: Mapping[str, Any], folder: Path) -> list[Path]:
    """Write figures, impedances and their picture; returns the files."""
    files = [folder / FIGURES_JSON]
    save_json(dict(figures), files[0])
    measured = [one for one in points if one.impedances is not None]
    rows = [
        {"P": one.point.active, "Q": one.point.reactive, "V": one.point.voltage} | row
        for one in measured
        for row in _rows_of(one)
    ]
    if rows:
        files += [folder / IMPEDANCE_CSV, folder / PICTURE]
        save_table(rows, files[1])
        _plot(measured, files[2])
    return files


def _rows_of(one: AtPoint) -> list[dict[str, float]]:
    return [] if one.impedances is None else one.impedances.rows()


def _plot(points: Sequence[AtPoint], path: Path) -> None:
    import matplotlib as mpl  # noqa: PLC0415 - a second to import
    from matplotlib.figure import Figure  # noqa: PLC0415 - as above

    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(7.2, 6.4), layout="constrained")
        size, phase = figure.subplots(2, 1, sharex=True)
        for k, one in enumerate(points):
            assert one.impedances is not None
            f, Z = one.impedances.frequencies, one.impedances.sequences[:, 0, 0]
            size.plot(f, np.abs(Z), ".-", ms=3, color=colour(k), label=str(one.point))
            phase.plot(f, np.rad2deg(np.angle(Z)), ".-", ms=3, color=colour(k))
        size.set(xscale="log", yscale="log", ylabel="|Z| of the positive sequence [pu]")
        size.set_title("Impedance of the device", loc="left")
        size.legend()
        phase.set(ylabel="Phase [°]", xlabel="Frequency in the rotating frame [Hz]")
        save_figure(figure, path)
