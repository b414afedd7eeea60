"""The exact continuous linear model of a prepared case: CasADi Jacobians, interconnected without any FMU."""

import numpy as np

from fmus.grid.network import Network
from fmus.toolchain.catalogue import build_model
from fmus.toolchain.model import Model
from orchestrator.cases.case import Case
from orchestrator.cases.prepare import PreparedScenario


def network_of(case: Case, scenario: str, overrides: dict | None = None) -> Network:
    """The network for which a case's grid is built."""
    preparer = case._preparer(scenario, overrides, ())
    preparer.assemble()
    assert preparer.draft.network is not None
    return preparer.draft.network


def exact_continuous(prepared: PreparedScenario, network: Network | None = None) -> tuple[np.ndarray, list[str]]:
    """Matrix A of ẋ = A·x, and the names of the states; ``network`` is that of a grid built for the case."""
    parts = {}
    for name, plan in prepared.system.components.items():
        own = network is not None and plan.description.model_name == network.name
        model = build_model("grid", network=network) if own else build_model(plan.description.model_name)
        p = np.array([float(plan.parameters.get(v.name, v.start)) for v in model.parameters])
        c, x = model.initialise(p)
        parts[name] = (model, p, c, x)
    inputs = _inputs(prepared, parts)
    blocks = {}
    for name, (model, p, c, x) in parts.items():
        blocks[name] = [np.array(block) for block in model.jacobians()(x, inputs[name], p, c)]
        rates = np.array(model.derivatives(x, inputs[name], p, c))
        assert np.abs(rates).max(initial=0) < 1e-6, f"{name} is not in steady state"  # [1/s]
    return _interconnect(prepared, parts, blocks)


def _inputs(prepared: PreparedScenario, parts: dict) -> dict[str, np.ndarray]:
    """Values of all inputs in steady state, by passing outputs on until nothing changes."""
    inputs = {
        name: np.array([prepared.system.components[name].inputs.get(i.name, i.start) for i in model.inputs])
        for name, (model, *_) in parts.items()
    }
    for _ in range(3):
        outputs = {
            name: np.array(model.outputs_function(x, inputs[name], p, c)).ravel()
            for name, (model, p, c, x) in parts.items()
        }
        for wire in prepared.system.connections:
            source, target = parts[wire.source.component][0], parts[wire.target.component][0]
            value = outputs[wire.source.component][_index(source.outputs, wire.source.variable)]
            inputs[wire.target.component][_index(target.inputs, wire.target.variable)] = value
    return inputs


def _interconnect(prepared: PreparedScenario, parts: dict, blocks: dict) -> tuple[np.ndarray, list[str]]:
    """ẋ = A x + B u, y = C x + D u, u = W y, with everything stacked: A + B (I − W D)⁻¹ W C."""
    models: dict[str, Model] = {name: part[0] for name, part in parts.items()}
    first_u = dict(zip(models, np.cumsum([0, *(len(m.inputs) for m in models.values())]), strict=False))
    first_y = dict(zip(models, np.cumsum([0, *(len(m.outputs) for m in models.values())]), strict=False))
    A, B, C, D = (_block_diagonal([blocks[n][k] for n in models]) for k in range(4))
    W = np.zeros((B.shape[1], C.shape[0]))
    for wire in prepared.system.connections:
        row = first_u[wire.target.component] + _index(models[wire.target.component].inputs, wire.target.variable)
        column = first_y[wire.source.component] + _index(models[wire.source.component].outputs, wire.source.variable)
        W[row, column] = 1.0
    names = [f"{name}.{state.name}" for name, model in models.items() for state in model.states]
    return A + B @ np.linalg.solve(np.eye(len(W)) - W @ D, W @ C), names


def _block_diagonal(blocks: list[np.ndarray]) -> np.ndarray:
    whole = np.zeros((sum(b.shape[0] for b in blocks), sum(b.shape[1] for b in blocks)))
    row = column = 0
    for block in blocks:
        whole[row : row + block.shape[0], column : column + block.shape[1]] = block
        row, column = row + block.shape[0], column + block.shape[1]
    return whole


def _index(variables: tuple, name: str) -> int:
    return [v.name for v in variables].index(name)
