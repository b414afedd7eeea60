"""The linear model of a component, and linear models as files that other tools read."""

import json
import math
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.core.errors import AnalysisError
from orchestrator.devices.fmi.linear_model import EmbeddedModel
from orchestrator.linear.models.linearization import linearize_within
from orchestrator.linear.models.perturbation import PERTURBATIONS
from orchestrator.linear.models.state_space import StateSpace
from orchestrator.linear.models.steady_state import OperatingPoint, find_operating_point
from orchestrator.linear.spectra.stability import Stability
from orchestrator.output.results.file_writers import (
    provenance,
    save_json,
    save_matrices,
    save_matrix,
)
from orchestrator.studies.modes.modes import running
from orchestrator.systems.coupling.step_awareness import STEP_PARAMETER, knows_step


def component_model(prepared: PreparedScenario, name: str) -> EmbeddedModel:
    """The continuous linear model of one component at the scenario's steady state.

    It is made of the FMU's own directional derivatives where it gives them, else by perturbation. Its inputs and
    outputs are all that the FMU has of type Real."""
    plan = prepared.system.components[name]
    info = plan.description.variables
    inputs, outputs = (
        [v for v in names if info[v].type == "Real"]
        for names in (plan.description.inputs, plan.description.outputs)
    )
    with running(prepared) as master:
        point = find_operating_point(master)
        open_inputs = [v for v in inputs if v not in master.exchanges[name].inputs.names]
        exact = plan.description.gives_directional_derivatives
        c = linearize_within(
            master,
            name,
            prepared.step_size,
            open_inputs,
            outputs,
            derivatives=True,
            without_step=True,
            directional=exact,
        )
        if c.A_c is None or c.B_c is None:
            raise AnalysisError(
                f"component {name!r}: its FMU does not give its derivatives, so no continuous model can be made"
            )
        values = master.components[name].get([*c.states, *inputs, *outputs])
        given = {STEP_PARAMETER} if knows_step(master, name) else set()

    def start_of(names: Iterable[str]) -> dict[str, float]:
        return {name: values[name] for name in names}

    columns = [c.inputs.index(v) for v in inputs]
    derivatives = f"central differences of {PERTURBATIONS[0]:g}"
    if exact:
        derivatives = "directional derivatives"
    parameters = {v: x for v, x in plan.parameters.items() if x != info[v].start and v not in given}
    return EmbeddedModel(
        A=c.A_c,
        B=c.B_c[:, columns],
        C=c.C_o,
        D=c.D_o[:, columns],
        states=start_of(c.states),
        inputs=start_of(inputs),
        outputs=start_of(outputs),
        parameters=parameters,
        units={v: info[v].unit for v in (*c.states, *inputs, *outputs, *parameters)},
        origin={
            "case": prepared.case.name,
            "scenario": prepared.name,
            "component": name,
            "step_size_s": prepared.step_size,
            "residual_per_step": point.residual,
            "derivatives": derivatives,
            "fmu_guid": plan.description.guid,
        },
    )


def save_linear_model(
    model: StateSpace,
    point: OperatingPoint,
    stability: Stability,
    prepared: PreparedScenario,
    folder: Path,
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
        save_matrix(matrices[key], rows, columns, folder / f"{key}.csv")
    save_json(stability.as_json(), folder / "stability.json")
    return [
        folder / "linear_model.mat",
        folder / "stability.json",
        *(folder / f"{key}.csv" for key in entries),
    ]
