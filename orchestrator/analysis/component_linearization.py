"""Linear model of one running FMU over one communication step, by perturbation of its states and inputs."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from orchestrator.coupling.loop import Exchange
from orchestrator.errors import AnalysisError
from orchestrator.fmi.component import Component, RealBatch

Matrix = NDArray[np.float64]

PERTURBATIONS = (1e-5, 2e-5)
"""Central differences are taken with both, relative to max(1, |value|); they should agree."""


@dataclass(frozen=True)
class ComponentLinearization:
    """x⁺ = A·x + B·u over one communication step with u held, y = C·x + D·u; and ẋ = A_c·x + B_c·u.

    Attributes
    ----------
    states, inputs, outputs
        Names; inputs and outputs are the connected ones.
    A, B, C, D
        Of the step map, shapes (n, n), (n, m), (p, n), (p, m).
    A_c, B_c
        Of the continuous model, from the FMU's own derivatives; None where it declares none.
    disagreement
        Largest difference of an element of A, B, C or D between the two perturbation sizes.
    """

    name: str
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    A: Matrix
    B: Matrix
    C: Matrix
    D: Matrix
    A_c: Matrix | None
    B_c: Matrix | None
    disagreement: float


class StateAccess:
    """Reads and sets the continuous states of one component.

    Raises
    ------
    AnalysisError
        If the FMU does not let a master set its states, or cannot save and restore its state.
    """

    def __init__(self, component: Component) -> None:
        description = component.description
        if not description.can_save_state:
            raise AnalysisError(
                f"component {component.name!r}: its FMU cannot save and restore its state (canGetAndSetFMUstate), "
                "so it cannot be perturbed and put back; ask for an export that can"
            )
        if description.states and not description.states_are_settable:
            raise AnalysisError(
                f"component {component.name!r}: its FMU does not let a master set its continuous states, which "
                "linearisation by perturbation needs; our FMUs declare it under VendorAnnotations"
            )
        self.batch = RealBatch(component, description.states)
        self._buffer = RealBatch(component, description.states)

    def read(self) -> Matrix:
        return self.batch.read().copy() if self.batch.names else np.zeros(0)

    def write(self, values: Matrix) -> None:
        if self.batch.names:
            self._buffer.values[:] = values
            self._buffer.write()


def linearize_component(exchange: Exchange, time: float, step_size: float) -> ComponentLinearization:
    """Perturb one component around where it is, and put it back."""
    component = exchange.component
    results = [_differences(exchange, time, step_size, size) for size in PERTURBATIONS]
    names = component.description.states
    n = len(names)
    has_derivatives = all(f"der({s})" in component.description.variables for s in names)
    (after, outputs, rates), p = results[0], len(exchange.outputs.names)
    pairs = list(zip(*results, strict=True))[:2]
    disagreement = max(float(np.abs(a - b).max(initial=0.0)) for a, b in pairs)
    return ComponentLinearization(
        component.name,
        names,
        exchange.inputs.names,
        exchange.outputs.names,
        A=after[:, :n],
        B=after[:, n:],
        C=outputs[:, :n].reshape(p, n),
        D=outputs[:, n:],
        A_c=rates[:, :n] if has_derivatives else None,
        B_c=rates[:, n:] if has_derivatives else None,
        disagreement=disagreement,
    )


def _differences(exchange: Exchange, time: float, step_size: float, size: float) -> tuple[Matrix, Matrix, Matrix]:
    """Columns of d(x⁺), d(y), d(ẋ) by every state, then every coupled input."""
    component = exchange.component
    states = StateAccess(component)
    declared = [f"der({s})" for s in component.description.states]
    rates = RealBatch(component, declared if all(d in component.description.variables for d in declared) else [])
    x_0, u_0 = states.read(), exchange.inputs.values.copy()
    outputs = RealBatch(component, exchange.outputs.names)
    single = [RealBatch(component, [name]) for name in (*component.description.states, *exchange.inputs.names)]
    n = len(x_0)
    z_0 = np.concatenate([x_0, u_0])
    columns: list[tuple[Matrix, Matrix, Matrix]] = []
    saved = component.save_state()
    try:
        for k, value in enumerate(z_0):
            step = size * max(1.0, abs(value))
            ends = []
            for sign in (+1.0, -1.0):
                single[k].values[0] = value + sign * step
                single[k].write()
                y = outputs.read().copy() if outputs.names else np.zeros(0)
                rate = rates.read().copy() if rates.names else np.zeros(n)
                component.step(time, step_size)
                ends.append((states.read(), y, rate))
                component.restore_state(saved)
            columns.append(tuple((a - b) / (2 * step) for a, b in zip(*ends, strict=True)))
    finally:
        component.restore_state(saved)
        component.free_state(saved)
    widths = (n, len(outputs.names), n)
    return tuple(  # type: ignore[return-value]
        np.column_stack([c[i] for c in columns]) if columns else np.zeros((width, 0)) for i, width in enumerate(widths)
    )
