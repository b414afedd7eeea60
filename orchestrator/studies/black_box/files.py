"""Files of an identification: the measured response, the fitted model, and a picture of both."""

from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from orchestrator.linear.models.linear_model import IDENTIFIED
from orchestrator.output.report.colours import colour
from orchestrator.output.report.plot_style import STYLE, save_figure
from orchestrator.output.results.file_writers import save_json, save_matrices, save_table
from orchestrator.studies.black_box.fitting import IdentifiedModel, Passivity
from orchestrator.studies.black_box.frequency_response import FrequencyResponse


def save_identification(
    response: FrequencyResponse, model: IdentifiedModel, passive: Passivity, folder: Path
) -> list[Path]:
    """Write ``admittance.csv``, ``identified_model.mat``, ``identification.json`` and ``admittance.png``."""
    names = ("admittance.csv", "identified_model.mat", "identification.json", "admittance.png")
    table, matrices, summary, picture = (folder / name for name in names)
    save_table(_rows(response, passive), table)
    lists = {
        key: np.array(list(values), dtype=object).reshape(-1, 1)
        for key, values in (("inputs", model.inputs), ("outputs", model.outputs))
    }
    content = {"A": model.A, "B": model.B, "C": model.C, "D": model.D, "step_size": model.step_size}
    save_matrices(content | lists, matrices)
    save_json(identification_json(response, model, passive), summary)
    _plot(response, model, passive, picture)
    return [table, matrices, summary, picture]


def identification_json(
    response: FrequencyResponse, model: IdentifiedModel, passive: Passivity
) -> dict[str, Any]:
    slowest_first = sorted(model.poles.tolist(), key=abs)
    return {
        "method": response.method,
        "linearised": IDENTIFIED,
        "step_size_s": response.step_size,
        "simulated_s": response.seconds,
        "lines": len(response.frequencies),
        "range_hz": [float(response.frequencies[0]), float(response.frequencies[-1])],
        "operating_point": dict(
            zip(response.outputs, response.operating_point.tolist(), strict=True)
        ),
        "feedthrough": response.feedthrough.tolist(),
        "largest_relative_bound": response.largest_bound,
        "difference_at_half_amplitude": response.nonlinearity,
        "warnings": list(response.warnings),
        "model": {
            "order": len(model.A),
            "error": model.error,
            "poles": [{"real": p.real, "imag": p.imag} for p in slowest_first if p.imag >= 0],
        },
        "passivity": {
            "least_relative_index": float(passive.relative.min()),
            "active_hz": [list(pair) for pair in passive.ranges()],
        },
    }


def _rows(response: FrequencyResponse, passive: Passivity) -> list[dict[str, float]]:
    """One row a frequency; the admittance is −i/v as seen at communication points, and its bounds."""
    rows = []
    for k, f in enumerate(response.frequencies.tolist()):
        row = {"frequency [Hz]": f}
        for i, y in enumerate(response.outputs):
            for j, u in enumerate(response.inputs):
                value = -response.values[k, i, j]
                row[f"re {y}/{u}"], row[f"im {y}/{u}"] = float(value.real), float(value.imag)
                row[f"bound {y}/{u}"] = float(response.bounds[k, i, j])
        row["passivity index"], row["relative passivity index"] = (
            float(passive.index[k]),
            float(passive.relative[k]),
        )
        rows.append(row)
    return rows


def _plot(
    response: FrequencyResponse, model: IdentifiedModel, passive: Passivity, path: Path
) -> None:
    fine = np.geomspace(response.frequencies[0], response.frequencies[-1], 1500)
    z = np.exp(2j * np.pi * fine * response.step_size)
    fitted = model.response(z) + model.D / z[:, None, None]
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(7.2, 6.4), layout="constrained")
        size, phase, index = figure.subplots(3, 1, sharex=True)
        pairs = [(i, j) for i in range(len(response.outputs)) for j in range(len(response.inputs))]
        for k, (i, j) in enumerate(pairs):
            label = f"−{response.outputs[i]}/{response.inputs[j]}"
            value = -response.values[:, i, j]
            size.errorbar(
                response.frequencies,
                np.abs(value),
                response.bounds[:, i, j],
                fmt=".",
                ms=3.5,
                color=colour(k),
                label=label,
            )
            size.plot(fine, np.abs(fitted[:, i, j]), color=colour(k), linewidth=0.9)
            phase.plot(
                response.frequencies, np.rad2deg(np.angle(value)), ".", ms=3.5, color=colour(k)
            )
            phase.plot(fine, np.rad2deg(np.angle(-fitted[:, i, j])), color=colour(k), linewidth=0.9)
        size.set(xscale="log", yscale="log", ylabel="Admittance [pu, 100 MVA]")
        size.set_title("Measured (points, with bounds) and fitted (lines)", loc="left")
        phase.set_ylabel("Phase [°]")
        index.plot(passive.frequencies, passive.relative, color="black")
        index.axhline(0.0, color="#a11d1d", linewidth=0.8)
        index.set(ylabel="Relative passivity index", xlabel="Frequency [Hz]")
        figure.legend(*size.get_legend_handles_labels(), loc="outside lower center", ncols=4)
        save_figure(figure, path)
