"""A linear model as files that other tools read."""

import json
import math
from pathlib import Path

import numpy as np

from orchestrator.analysis.stability import Stability
from orchestrator.analysis.state_space import StateSpace
from orchestrator.analysis.steady_state import OperatingPoint
from orchestrator.cases.prepare import PreparedScenario
from orchestrator.results.storage import provenance, save_json, save_matrices, save_table


def save_linear_model(
    model: StateSpace, point: OperatingPoint, stability: Stability, prepared: PreparedScenario, folder: Path
) -> list[Path]:
    """Write A, B, C, D with names, operating point and verdict: ``linear_model.mat`` for MATLAB, one CSV a matrix."""
    matrices = {"A": model.A, "B": model.B, "C": model.C, "D": model.D}
    names = {"states": model.states, "inputs": model.inputs, "outputs": model.outputs}
    operating_point = [point.states.get(name, math.nan) for name in model.states]
    save_matrices(
        matrices
        | {key: np.array(values, dtype=object).reshape(-1, 1) for key, values in names.items()}
        | {
            "step_size": model.step_size or 0.0,  # as MATLAB's ss: 0 is continuous
            "operating_point": np.array(operating_point).reshape(-1, 1),
            "stability": json.dumps(stability.as_json()),
            "provenance": json.dumps({**provenance(prepared), "linearised": dict(model.sources)}),
        },
        folder / "linear_model.mat",
    )
    entries = {
        "A": (model.states, model.states),
        "B": (model.states, model.inputs),
        "C": (model.outputs, model.states),
        "D": (model.outputs, model.inputs),
    }
    for key, (rows, columns) in entries.items():
        labelled = zip(rows, matrices[key].tolist(), strict=True)
        lines = [{"": row, **dict(zip(columns, values, strict=True))} for row, values in labelled]
        save_table(lines, folder / f"{key}.csv")
    save_json(stability.as_json(), folder / "stability.json")
    return [folder / "linear_model.mat", folder / "stability.json", *(folder / f"{key}.csv" for key in entries)]
