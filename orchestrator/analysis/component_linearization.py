"""Linear model of one running FMU over one communication step, by perturbation of its states and inputs."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg

from orchestrator.analysis.embedded_model import check_operating_point, embedded_model
from orchestrator.analysis.linear_model import Matrix
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


def obstacle(component: Component) -> str | None:
    """Why a component can neither be perturbed and put back, nor has a linear model inside; None where it can."""
    description = component.description
    if not description.can_save_state:
        return (
            f"component {component.name!r}: its FMU cannot save and restore its state (canGetAndSetFMUstate), "
            "so it cannot be perturbed and put back; ask for an export that can"
        )
    if description.states and not description.states_are_settable and embedded_model(component) is None:
        return (
            f"component {component.name!r}: its FMU does not let a master set its continuous states, which "
            "linearisation by perturbation needs, and has no linear model inside; our FMUs declare the one under "
            "VendorAnnotations, and `gfor build --with-linear-model` packs the other"
        )
    return None


class StateAccess:
    """Reads and sets the continuous states of one component; those that cannot be set stay as they are.

    Raises
    ------
    AnalysisError
        If the component can neither be perturbed and put back, nor has a linear model inside.
    """

    def __init__(self, component: Component) -> None:
        if reason := obstacle(component):
            raise AnalysisError(reason)
        self._settable = component.description.states_are_settable
        self.batch = RealBatch(component, component.description.states)
        self._buffer = RealBatch(component, component.description.states)

    def read(self) -> Matrix:
        return self.batch.read().copy()

    def write(self, values: Matrix) -> None:
        if self._settable:
            self._buffer.values[:] = values
            self._buffer.write()


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
    n, m, p = len(model.states), len(columns), len(exchange.outputs.names)
    A_c, B_c = model.A, model.B[:, columns]
    over_step = scipy.linalg.expm(step_size * np.block([[A_c, B_c], [np.zeros((m, n + m))]]))
    C, D = model.C[rows], model.D[np.ix_(rows, columns)]
    return ComponentLinearization(
        component.name,
        tuple(model.states),
        entries,
        exchange.outputs.names,
        A=over_step[:n, :n],
        B=over_step[:n, n:],
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
