"""Growth of what components exchange from one communication step to the next, beside black boxes.

A device whose current follows its voltage at once, such as i = (E − v)/Z, closes a loop with the network's voltage
that goes around once in a communication step. With a gain above 1 it diverges within milliseconds, and another
component is the first to fail. A black box cannot be perturbed where it is, so instances of their own are stepped, with
the inputs as they are and with each of them moved; all others are linearised as always."""

from collections.abc import Mapping, Sequence
from contextlib import ExitStack

import numpy as np

from orchestrator.core.arrays import Matrix, Numbers
from orchestrator.devices.fmi.component import RealBatch
from orchestrator.devices.fmi.instance import open_component
from orchestrator.linear.models.component_linearization import ComponentLinearization
from orchestrator.linear.models.linear_model import IDENTIFIED, LinearModel
from orchestrator.linear.models.linearization import Blocks, compose
from orchestrator.systems.coupling.master import Master

# communication steps of a response: what grows as below does not ask for what came before them
_STEPS = 20
# factor in a communication step: what grows less is left to the run, where it can be seen growing
_GROWS = 1.1
_MOVED = 1e-3  # by how much an input is moved, of 1 or of its value
_TURNS = 300  # steps of the linear model
_LATE = 100  # steps at the end over which growth is measured


def coupling_growth(master: Master, boxes: Sequence[str]) -> list[str]:
    """Which black boxes make the exchange grow, in words; nothing where it does not."""
    known = {name: _responding(master, name) for name in boxes}
    blocks = Blocks(master, known=known)
    growth = _growth(compose(blocks, master.schedule))
    if not growth > _GROWS:
        return []
    guilty = [name for name in boxes if not _without(blocks, master, known, name) > _GROWS] or list(
        boxes
    )
    micro = master.clock.step_size * 1e6
    return [
        f"component {name!r}: {_gain_in_words(known[name])}, and the network answers at the next step: at {micro:g} µs "
        f"what they exchange grows {growth:.3g} times with every communication step, and the run cannot last. An error "
        "of another component follows from it. Give its current a state of its own: L·di/dt = E − v − R·i in place of "
        "i = (E − v)/Z"
        for name in guilty
    ]


def _responding(master: Master, name: str) -> ComponentLinearization:
    """A component as its response to steps of its inputs, over a few communication steps.

    Its states are past inputs."""
    exchange = master.exchanges[name]
    rest, m, p = (
        exchange.inputs.values.copy(),
        len(exchange.inputs.names),
        len(exchange.outputs.names),
    )
    before = _run(master, name, rest)
    responses = np.zeros((_STEPS, p, m))
    for j in range(m):
        size = _MOVED * max(1.0, abs(rest[j]))
        moved = rest.copy()
        moved[j] += size
        responses[:, :, j] = (_run(master, name, moved) - before) / size
    pulses = np.diff(responses, axis=0, prepend=np.zeros((1, p, m)))
    n = m * _STEPS
    A, B = np.eye(n, k=-m), np.eye(n, m)
    C: Matrix = pulses.transpose(1, 0, 2).reshape(p, n)
    states = tuple(f"past.{k + 1}.{i}" for k in range(_STEPS) for i in exchange.inputs.names)
    none = np.zeros((0, n)), np.zeros((0, m))
    inputs, outputs = tuple(exchange.inputs.names), tuple(exchange.outputs.names)
    return ComponentLinearization(
        name,
        states,
        inputs,
        outputs,
        A,
        B,
        C,
        np.zeros((p, m)),
        (),
        *none,
        None,
        None,
        0.0,
        IDENTIFIED,
    )


def _run(master: Master, name: str, inputs: Numbers) -> Numbers:
    """Coupled outputs of a new instance after each step with inputs held, shape (steps, p)."""
    plan, exchange, h = (
        master.system.components[name],
        master.exchanges[name],
        master.clock.step_size,
    )
    with ExitStack() as release:
        component = open_component(name, plan.description, isolated=plan.isolated)
        release.enter_context(component)
        component.setup(0.0, None)
        component.set(plan.parameters)
        component.enter_initialization_mode()
        component.set(plan.inputs)
        into = RealBatch(component, exchange.inputs.names)
        out = RealBatch(component, exchange.outputs.names)
        into.values[:] = exchange.inputs.values
        into.write()
        component.exit_initialization_mode()
        rows = []
        for k in range(_STEPS):
            into.values[:] = inputs
            into.write()
            component.step(k * h, h)
            rows.append(out.read().copy())
    return np.array(rows)


def _without(
    blocks: Blocks, master: Master, known: Mapping[str, ComponentLinearization], name: str
) -> float:
    box = known[name]
    kept, blocks.components[name] = blocks.components[name], _deaf(box)
    try:
        return _growth(compose(blocks, master.schedule))
    finally:
        blocks.components[name] = kept


def _deaf(box: ComponentLinearization) -> ComponentLinearization:
    return ComponentLinearization(
        box.name,
        box.states,
        inputs=box.inputs,
        outputs=box.outputs,
        A=box.A,
        B=box.B,
        C=0 * box.C,
        D=box.D,
        observed=(),
        C_o=box.C_o,
        D_o=box.D_o,
        A_c=None,
        B_c=None,
        disagreement=0.0,
        source=IDENTIFIED,
    )


def _growth(model: LinearModel) -> float:
    """By which factor the largest motion grows in a step, by following one of all states."""
    z = np.random.default_rng(1).standard_normal(model.F.shape[0])
    logs = []
    for _ in range(_TURNS):
        z = model.apply(z)
        size = float(np.linalg.norm(z))
        if not size:
            return 0.0
        logs.append(np.log(size))
        z /= size
    return float(np.exp(np.mean(logs[-_LATE:])))


def _gain_in_words(box: ComponentLinearization) -> str:
    """The largest answer of an output after one step, the first entries of C."""
    first = np.abs(box.C[:, : len(box.inputs)])
    p, m = np.unravel_index(int(first.argmax()), first.shape)
    return f"{box.outputs[p]} follows {box.inputs[m]} by {first[p, m]:.3g} pu per pu within one communication step"
