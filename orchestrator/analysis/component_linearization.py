"""Linear model of one running FMU over one communication step, by perturbation of its states and inputs.

Where an FMU gives directional derivatives, they are the independent way to the same.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg

from orchestrator.analysis.embedded_model import check_operating_point, embedded_model
from orchestrator.analysis.linear_model import Matrix
from orchestrator.analysis.state_access import StateAccess
from orchestrator.coupling.loop import Exchange
from orchestrator.errors import AnalysisError
from orchestrator.fmi.component import Component, RealBatch
from orchestrator.fmi.linear_model import EmbeddedModel

PERTURBATIONS = (1e-5, 2e-5)
"""Central differences are taken with both, relative to max(1, |value|); they should agree."""


@dataclass(frozen=True)
class ComponentLinearization:
    """x⁺ = A·x + B·u over one communication step with u held, y = C·x + D·u; and ẋ = A_c·x + B_c·u.

    Attributes
    ----------
    states, inputs, outputs
        Names; inputs and outputs are the connected ones, and after them the inputs that were asked for.
    A, B, C, D
        Of the step map, shapes (n, n), (n, m), (p, n), (p, m).
    observed
        Names of the outputs that were asked for.
    C_o, D_o
        Their rows, shapes (q, n), (q, m).
    A_c, B_c
        Of the continuous model, from the FMU's own derivatives; None where it declares none or they were not asked for.
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
    observed: tuple[str, ...]
    C_o: Matrix
    D_o: Matrix
    A_c: Matrix | None
    B_c: Matrix | None
    disagreement: float


def linearize_component(
    exchange: Exchange,
    time: float,
    step_size: float,
    inputs: Sequence[str] = (),
    observed: Sequence[str] = (),
    *,
    derivatives: bool = False,
) -> ComponentLinearization:
    """Perturb one component around where it is, and put it back.

    Where its states cannot be set, the linear model inside its FMU is taken, if that is of this operating point.

    Parameters
    ----------
    inputs, observed
        Tunable parameters or open inputs, and outputs, that matter beside the connected ones.
    derivatives
        Also difference the FMU's own derivatives, if it declares them; it costs a third more.
    """
    component = exchange.component
    StateAccess(component)  # refuses what can be neither perturbed nor looked up
    if (inside := embedded_model(component)) is not None:
        return _from_inside(exchange, inside, step_size, inputs, observed)
    names = component.description.states
    rates = [f"der({s})" for s in names] if derivatives else []
    rates = rates if all(r in component.description.variables for r in rates) else []
    n, p = len(names), len(exchange.outputs.names)
    entries = (*exchange.inputs.names, *inputs)
    exits = (*exchange.outputs.names, *observed)
    # The derivatives need no second size: they are differenced over no step.
    (after, outputs, slopes), (after_2, outputs_2, _) = (
        _differences(component, entries, exits, time, step_size, size, rates if size == PERTURBATIONS[0] else [])
        for size in PERTURBATIONS
    )
    pairs = ((after, after_2), (outputs, outputs_2))
    return ComponentLinearization(
        component.name,
        names,
        entries,
        exchange.outputs.names,
        A=after[:, :n],
        B=after[:, n:],
        C=outputs[:p, :n],
        D=outputs[:p, n:],
        observed=tuple(observed),
        C_o=outputs[p:, :n],
        D_o=outputs[p:, n:],
        A_c=slopes[:, :n] if len(rates) == n and derivatives else None,
        B_c=slopes[:, n:] if len(rates) == n and derivatives else None,
        disagreement=max(float(np.abs(a - b).max(initial=0.0)) for a, b in pairs),
    )


def linearize_by_derivatives(
    exchange: Exchange, step_size: float, inputs: Sequence[str] = (), observed: Sequence[str] = ()
) -> ComponentLinearization:
    """The same from the FMU's own directional derivatives, without a perturbation and without a step.

    The map over one communication step is the exact one of the continuous model; an FMU's integrator comes close.

    Parameters
    ----------
    inputs, observed
        As `linearize_component`.

    Raises
    ------
    AnalysisError
        If the FMU gives no directional derivatives, or none of its states.
    """
    component = exchange.component
    states = component.description.states
    rates = [f"der({s})" for s in states]
    if not component.description.gives_directional_derivatives:
        raise AnalysisError(
            f"component {component.name!r}: its FMU gives no directional derivatives; native FMUs do (--native), "
            "or linearise by perturbation"
        )
    n = len(states)
    entries = (*exchange.inputs.names, *inputs)
    whole = component.jacobian([*rates, *exchange.outputs.names, *observed], [*states, *entries])
    blocks = whole[:n, :n], whole[:n, n:], whole[n:, :n], whole[n:, n:]
    return _over_step(exchange, step_size, states, entries, observed, *blocks)


def _from_inside(
    exchange: Exchange, model: EmbeddedModel, step_size: float, inputs: Sequence[str], observed: Sequence[str]
) -> ComponentLinearization:
    """The model inside an FMU, taken over one communication step with its inputs held."""
    component = exchange.component
    check_operating_point(component, model)
    entries, exits = (*exchange.inputs.names, *inputs), (*exchange.outputs.names, *observed)
    missing = [v for v in entries if v not in model.inputs] + [v for v in exits if v not in model.outputs]
    if missing:
        raise AnalysisError(
            f"component {component.name!r}: the linear model inside its FMU has no {', '.join(map(repr, missing))}; it "
            f"has the inputs {', '.join(model.inputs)} and the outputs {', '.join(model.outputs)}"
        )
    columns = [list(model.inputs).index(v) for v in entries]
    rows = [list(model.outputs).index(v) for v in exits]
    blocks = model.A, model.B[:, columns], model.C[rows], model.D[np.ix_(rows, columns)]
    return _over_step(exchange, step_size, tuple(model.states), entries, observed, *blocks)


def _over_step(
    exchange: Exchange,
    step_size: float,
    states: tuple[str, ...],
    entries: tuple[str, ...],
    observed: Sequence[str],
    A_c: Matrix,
    B_c: Matrix,
    C: Matrix,
    D: Matrix,
) -> ComponentLinearization:
    """A continuous model, and its exact map over a communication step with the inputs held."""
    (n, m), p = B_c.shape, len(exchange.outputs.names)
    step_map = scipy.linalg.expm(step_size * np.block([[A_c, B_c], [np.zeros((m, n + m))]]))
    return ComponentLinearization(
        exchange.component.name,
        states,
        entries,
        exchange.outputs.names,
        A=step_map[:n, :n],
        B=step_map[:n, n:],
        C=C[:p],
        D=D[:p],
        observed=tuple(observed),
        C_o=C[p:],
        D_o=D[p:],
        A_c=A_c,
        B_c=B_c,
        disagreement=0.0,
    )


def _differences(
    component: Component,
    inputs: Sequence[str],
    exits: Sequence[str],
    time: float,
    step_size: float,
    size: float,
    rates: Sequence[str],
) -> tuple[Matrix, Matrix, Matrix]:
    """Columns of d(x⁺), d(y) and d(ẋ) by every state, then every input."""
    names = (*component.description.states, *inputs)
    z_0 = RealBatch(component, names).read().copy()
    perturbed = [RealBatch(component, [name]) for name in names]
    after, outputs, slopes = (RealBatch(component, group) for group in (component.description.states, exits, rates))
    columns = tuple(np.zeros((len(z_0), len(batch.names))) for batch in (after, outputs, slopes))
    saved = component.save_state()
    try:
        for k, value in enumerate(z_0):
            step = size * max(1.0, abs(value))
            for sign in (+1.0, -1.0):
                perturbed[k].values[0] = value + sign * step
                perturbed[k].write()
                for batch, column in zip((outputs, slopes), columns[1:], strict=True):
                    column[k] += sign * batch.read()
                component.step(time, step_size)
                columns[0][k] += sign * after.read()
                component.restore_state(saved)
            for column in columns:
                column[k] /= 2 * step
    finally:
        component.restore_state(saved)
        component.free_state(saved)
    after_columns, output_columns, slope_columns = (column.T for column in columns)
    return after_columns, output_columns, slope_columns
