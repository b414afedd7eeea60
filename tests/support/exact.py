"""The exact continuous linear model of a prepared case: CasADi Jacobians, interconnected without any FMU."""

from collections.abc import Callable
from functools import cache, lru_cache

import numpy as np
from scipy.linalg import expm

from fmus.grid.network import Network
from fmus.toolchain.catalogue import build_model
from fmus.toolchain.model import Model
from orchestrator.cases.case import Case
from orchestrator.cases.scenario.prepare import PreparedScenario
from tests.support.jacobians import jacobians
from tests.support.written_out import written_out


def network_of(case: Case, scenario: str, overrides: dict | None = None) -> Network:
    """The network for which a case's grid is built."""
    preparer = case._preparer(scenario, overrides, ())
    preparer.assemble()
    assert preparer.draft.network is not None
    return preparer.draft.network


def exact_continuous(
    prepared: PreparedScenario, network: Network | None = None
) -> tuple[np.ndarray, list[str]]:
    """Matrix A of ẋ = A·x, and the names of the states; ``network`` is that of a grid built for the case."""
    parts = _parts(prepared, network)
    inputs = _inputs(prepared, parts)
    blocks = {}
    for name, (model, p, c, x) in parts.items():
        blocks[name] = [np.array(block) for block in _jacobians(model)(x, inputs[name], p, c)]
        rates = np.array(model.derivatives(x, inputs[name], p, c))
        assert np.abs(rates).max(initial=0) < 1e-6, f"{name} is not in steady state"  # [1/s]
    return _interconnect(prepared, parts, blocks)


def _parts(prepared: PreparedScenario, network: Network | None) -> dict:
    """Model, parameters, constants and initial states of every component."""
    parts = {}
    for name, plan in prepared.system.components.items():
        own = network is not None and plan.description.model_name == network.name
        model = (
            written_out(build_model("grid", network=network))
            if own
            else _of_catalogue(build_model, plan.description.model_name)
        )
        p = np.array([float(plan.parameters.get(v.name, v.start)) for v in model.parameters])
        c, x = model.initialise(p)
        parts[name] = (model, p, c, x)
    return parts


@cache
def _of_catalogue(build: Callable[[str], Model], name: str) -> Model:
    """A model as functions of (x, u, p, c) alone; its equations are differentiated once, at whatever point they are.

    ``build``: a test may have models of its own built."""
    return written_out(build(name))


@lru_cache(maxsize=16)  # models: those of the catalogue in a file of tests, and some networks
def _jacobians(model: Model) -> Callable[..., list[np.ndarray]]:
    return jacobians(model)


def _inputs(prepared: PreparedScenario, parts: dict) -> dict[str, np.ndarray]:
    """Values of all inputs in steady state, by passing outputs on until nothing changes."""
    inputs = {
        name: np.array(
            [prepared.system.components[name].inputs.get(i.name, i.start) for i in model.inputs]
        )
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


def _interconnect(
    prepared: PreparedScenario, parts: dict, blocks: dict
) -> tuple[np.ndarray, list[str]]:
    """ẋ = A x + B u, y = C x + D u, u = W y, with everything stacked: A + B (I − W D)⁻¹ W C."""
    models: dict[str, Model] = {name: part[0] for name, part in parts.items()}
    first_u = dict(
        zip(models, np.cumsum([0, *(len(m.inputs) for m in models.values())]), strict=False)
    )
    first_y = dict(
        zip(models, np.cumsum([0, *(len(m.outputs) for m in models.values())]), strict=False)
    )
    A, B, C, D = (_block_diagonal([blocks[n][k] for n in models]) for k in range(4))
    W = np.zeros((B.shape[1], C.shape[0]))
    for wire in prepared.system.connections:
        row = first_u[wire.target.component] + _index(
            models[wire.target.component].inputs, wire.target.variable
        )
        column = first_y[wire.source.component] + _index(
            models[wire.source.component].outputs, wire.source.variable
        )
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


def exact_step_map(prepared: PreparedScenario, network: Network | None = None) -> np.ndarray:
    """One communication step of the linearised system, every device integrated exactly between its held inputs.

    By hand: a state vector and the inputs that are held, carried through the schedule's groups one after the other.
    """
    parts = _parts(prepared, network)
    inputs = _inputs(prepared, parts)
    step = {}
    for name, (model, p, c, x) in parts.items():
        A, B, C, D = (np.array(block) for block in _jacobians(model)(x, inputs[name], p, c))
        n, m = B.shape
        held = np.zeros((n + m, n + m))
        held[:n, :n], held[:n, n:] = A, B
        over = expm(held * prepared.step_size)
        step[name] = over[:n, :n], over[:n, n:], C, D
    first = dict(
        zip(parts, np.cumsum([0, *(len(part[0].states) for part in parts.values())]), strict=False)
    )
    size = sum(len(part[0].states) for part in parts.values())
    offset = dict(
        zip(
            parts,
            size + np.cumsum([0, *(len(part[0].inputs) for part in parts.values())]),
            strict=False,
        )
    )
    whole = size + sum(len(part[0].inputs) for part in parts.values())
    z, fed = np.eye(whole), set(range(size))
    for group in prepared.schedule.groups:
        outputs = {}
        for name in group:
            over_x, over_u, C, D = step[name]
            states = slice(first[name], first[name] + len(over_x))
            held = z[offset[name] : offset[name] + over_u.shape[1]]
            z[states] = over_x @ z[states] + over_u @ held
            outputs[name] = C @ z[states] + D @ held
        for wire in prepared.system.connections:
            if wire.source.component in outputs:
                source, target = parts[wire.source.component][0], parts[wire.target.component][0]
                row = offset[wire.target.component] + _index(target.inputs, wire.target.variable)
                fed.add(row)
                z[row] = outputs[wire.source.component][
                    _index(source.outputs, wire.source.variable)
                ]
    kept = sorted(fed)  # an input that nothing feeds is a constant, not a state
    return z[np.ix_(kept, kept)]
