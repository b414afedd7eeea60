"""Write the figures that the tests compare against: ``python -m tests.reference``."""

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from tests.reference.descriptor import Linearised
from tests.reference.two_areas import DETUNED, SCENARIOS, grid_code_system, paper_system

FOLDER = Path(__file__).parent
REACTANCES = (0.01, *(k / 20 for k in range(1, 13)))
"""Of the grid code's test [pu on 100 MVA]."""

DIGITS = 7
"""Decimals of an eigenvalue in the files [1/s]."""

PAPER_TABLE = {
    "base": [0.06, 3.62, 0.58, -1.63],
    "gfor": [-0.38, 3.66, 0.58, 10.3],
    "pod_p": [-1.1, 4.8, 0.76, 22.4],
    "pod_q": [-0.91, 3.62, 0.58, 24.4],
    "pod_pq": [-1.26, 5.09, 0.81, 24.0],
}


def figures(system: Linearised, lowest_hz: float, highest_hz: float) -> dict[str, Any]:
    """Oscillations in a range, and the largest growth rate of all eigenvalues but the common angle's 0."""
    values = system.eigenvalues()
    modes = system.oscillations(lowest_hz, highest_hz)
    growth = np.delete(values, np.argmin(np.abs(values))).real.max()
    rounded = [[round(float(z.real), DIGITS), round(float(z.imag), DIGITS)] for z in modes]
    return {"growth": round(float(growth), DIGITS), "eigenvalues": rounded}


def two_area_rows() -> Iterable[dict[str, Any]]:
    """The paper's five scenarios at two reactances, with and without SG1's governor, and saturated at the paper's."""
    for X_L in (0.1, 0.05):
        for governor in (True, False):
            for scenario in SCENARIOS:
                found = figures(paper_system(scenario, X_L, governor).linearised(), 0.1, 2.0)
                yield {
                    "X_L": X_L,
                    "governor_on_sg1": governor,
                    "saturation": False,
                    "scenario": scenario,
                } | found
    for scenario in SCENARIOS:
        found = figures(paper_system(scenario, 0.1, saturation=True).linearised(), 0.1, 2.0)
        yield {
            "X_L": 0.1,
            "governor_on_sg1": True,
            "saturation": True,
            "scenario": scenario,
        } | found


def grid_code_rows(
    converters: Iterable[str], reactances: Iterable[float] = REACTANCES, **options: Any
) -> Iterable[dict[str, Any]]:
    """The grid code's system with each converter at each reactance; ``base`` is the one without."""
    for converter in converters:
        for X_L in reactances:
            found = figures(grid_code_system(converter, X_L, **options).linearised(), 0.1, 1.5)
            yield {"converter": converter, "X_L": X_L} | found


def contents() -> dict[str, dict[str, Any]]:
    """Files by name."""
    return {
        "two_area.json": {
            "provenance": "python -m tests.reference; README.md beside this file. 'independent': eigenvalues [1/s] "
            "from 0.1 to 2 Hz and the largest growth rate [1/s] of the two-area system, from an independent monolithic "
            "linearisation. 'paper': its table of the electromechanical mode at X_L = 0.1: real, imag, Hz, damping %. "
            "Mateu-Barriendos et al. 2024; system data: Norma tecnica de supervision 631 v2.0 (2020).",
            "paper": PAPER_TABLE,
            "independent": list(two_area_rows()),
        },
        "norm631.json": {
            "provenance": "python -m tests.reference; README.md beside this file. Eigenvalues [1/s] from 0.1 to 1.5 Hz "
            "and the largest growth rate [1/s] of the grid code's test system at every reactance: with PSS2A and loads "
            "of constant current that follow with 1 ms; the same with loads that follow at once; without PSS2A.",
            "figures": list(grid_code_rows((*SCENARIOS, *DETUNED))),
            "current at once": list(grid_code_rows(SCENARIOS, loads="current at once")),
            "without stabiliser": list(grid_code_rows(("base",), stabiliser=False)),
        },
    }


def written(content: dict[str, Any]) -> str:
    """JSON with one row of a table on a line."""
    parts = []
    for key, value in content.items():
        if isinstance(value, list):
            rows = ",\n".join(f"  {json.dumps(row, ensure_ascii=False)}" for row in value)
            parts.append(f" {json.dumps(key)}: [\n{rows}\n ]")
        else:
            parts.append(f" {json.dumps(key)}: {json.dumps(value)}")
    return "{\n" + ",\n".join(parts) + "\n}\n"


if __name__ == "__main__":
    for name, content in contents().items():
        (FOLDER / name).write_text(written(content), encoding="utf-8")
        print(FOLDER / name)
