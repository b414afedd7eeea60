"""GB: the network-frequency-perturbation plot of a converter, and how stiff a source it is; without a verdict."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from orchestrator.output.report.colours import colour
from orchestrator.output.report.plot_style import STYLE, save_figure
from orchestrator.output.results.file_writers import save_json, save_table
from orchestrator.studies.black_box.frequency_response import Excitation
from orchestrator.studies.certification.codes.frequency.limits import (
    POWER,
    AskedStiffness,
    asked_stiffness,
)
from orchestrator.studies.certification.codes.response_at_point import point_values, response_at
from orchestrator.studies.certification.codes.stiffness import Stiffness, stiffness
from orchestrator.studies.certification.request import CertificationRequest
from orchestrator.studies.immittance.forms import rows_of

# names of files in a certificate's folder
FIGURES_CSV = "frequency.csv"
FIGURES_JSON = "frequency.json"
FIGURES_PNG = "frequency.png"

# band in which the least stiffness is told [Hz]: between the droops and the period of the grid
BAND = (5.0, 40.0)
EXCITATION = Excitation()  # how it is excited: from 0.05 to 1000 Hz

NO_VERDICT = (
    "no verdict: the GB Grid Code (ECP.A.3.9) states no criteria for the plot, and the thresholds and the band of "
    f"arXiv 2605.02131 were not at hand; {BAND[0]:g} to {BAND[1]:g} Hz is this program's band"
)


def measure_stiffness(
    request: CertificationRequest, f_n: float, report: Callable[[str], None]
) -> Stiffness:
    """Measure a converter at an ideal bus, at half of its rating and 1 pu."""
    values = point_values(POWER, 0.0, 1.0, f_n)
    response, voltage = response_at(request, values, EXCITATION, report, can_be_moved=True)
    return stiffness(response, voltage, f_n)


def figures_of_stiffness(found: Stiffness, model: str, f_n: float) -> dict[str, Any]:
    least = {
        f"{name} [{unit}]": dict(zip(("value", "at_hz"), found.least(name, *BAND), strict=True))
        for name, unit in (("P/theta", "pu/rad"), ("Q/V", "pu/pu"))
    }
    slow, asked = found.powers["P/omega"][0], asked_stiffness(found, f_n)
    return {
        "code": "gb",
        "model": model,
        "verdict": None,
        "sentence": NO_VERDICT,
        "band_hz": list(BAND),
        "least": least,
        "slow": {
            "name": "P/omega [pu/pu]",
            "real": float(slow.real),
            "imag": float(slow.imag),
            "at_hz": float(found.frequencies[0]),
        },
        "phase_jump": {
            "name": "P/theta [pu/rad]",
            "asked": asked.value,
            "band_hz": list(asked.band),
            "found": asked.found,
            "at_hz": asked.at,
            "met": asked.met,
            "sentence": asked.sentence(),
        },
    }


def stiffness_in_words(figures: dict[str, Any]) -> list[str]:
    slow = figures["slow"]
    least = [
        f"least |{name}|: {one['value']:.4g} at {one['at_hz']:.4g} Hz"
        for name, one in figures["least"].items()
    ]
    return [*least, f"P/ω at {slow['at_hz']:g} Hz: {slow['real']:.4g} {slow['imag']:+.4g}j pu/pu"]


def save_stiffness(found: Stiffness, model: str, f_n: float, folder: Path) -> list[Path]:
    table, figures, picture = (folder / name for name in (FIGURES_CSV, FIGURES_JSON, FIGURES_PNG))
    save_table(rows_of(found.frequencies, found.powers), table)
    save_json(figures_of_stiffness(found, model, f_n), figures)
    _plot(found, asked_stiffness(found, f_n), picture)
    return [table, figures, picture]


def _plot(found: Stiffness, asked: AskedStiffness, path: Path) -> None:
    import matplotlib as mpl  # noqa: PLC0415 - a second to import
    from matplotlib.figure import Figure  # noqa: PLC0415 - as above

    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(7.2, 6.4), layout="constrained")
        size, phase, stiff = figure.subplots(3, 1, sharex=True)
        size.plot(found.frequencies, np.abs(found.powers["P/omega"]), ".-", ms=3, color=colour(0))
        size.set(xscale="log", yscale="log", ylabel="|P/ω| [pu/pu]")
        size.set_title("Network frequency perturbation, no verdict", loc="left")
        phase.plot(
            found.frequencies,
            np.rad2deg(np.angle(found.powers["P/omega"])),
            ".-",
            ms=3,
            color=colour(0),
        )
        phase.set_ylabel("Phase of P/ω [°]")
        for k, (name, key) in enumerate((("|P/θ| [pu/rad]", "P/theta"), ("|Q/V| [pu/pu]", "Q/V"))):
            stiff.plot(
                found.frequencies,
                np.abs(found.powers[key]),
                ".-",
                ms=3,
                color=colour(k),
                label=name,
            )
        stiff.axvspan(*BAND, color="0.9", zorder=0)
        stiff.plot(
            asked.band,
            [asked.value] * 2,
            color="0.3",
            ls="--",
            label="asked by 0.2 pu for 10° at SCR 3",
        )
        stiff.set(yscale="log", ylabel="Stiffness", xlabel="Frequency of the change [Hz]")
        stiff.legend()
        save_figure(figure, path)
