"""Linear model of one running FMU over one communication step, by perturbation of its states and inputs.

Where an FMU gives directional derivatives, they are the independent way to the same.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from orchestrator.analysis.derivative_check import check_derivatives
from orchestrator.analysis.embedded_model import check_operating_point, embedded_model
from orchestrator.analysis.held_inputs import over_held_inputs
from orchestrator.analysis.linear_model import DIRECTIONAL, PACKED, PERTURBED
from orchestrator.analysis.response_check import ContinuousModel, check_response
from orchestrator.analysis.state_access import StateAccess
from orchestrator.arrays import Matrix
from orchestrator.coupling.loop import Exchange
from orchestrator.errors import AnalysisError
from orchestrator.fmi.component import Component, RealBatch
from orchestrator.fmi.linear_model import EmbeddedModel

PERTURBATIONS = (1e-5, 1e-6, 1e-7, 1e-8)
"""Central differences are taken with the first and with twice of it, relative to max(1, |value|), and should agree. A
column where they do not, as a limit or a dead band is close by, is taken anew with the next size."""

_AGREE, _SMALL = 5e-3, 1e-2
"""Two sizes agree where every element differs by less than this part of its size, and of this rate [1/s]. In smooth
systems, up to the IEEE 118-bus one, the part is at most 3e-4; where a signal runs into its limit it is a half."""

_EVEN = 0.1
"""An element whose answers up and down differ by more than this part belongs to a limit on one side; in smooth systems
it is at most 0.05."""


class StepMap(NamedTuple):
    """A, B, C and D of one component over one communication step."""

    A: Matrix
    B: Matrix
    C: Matrix
    D: Matrix


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
    source
        How it was found: ``perturbed``, ``directional``, ``packed`` or ``identified``.
    variants
        Other answers to the same question, which should hardly differ: from the other perturbation size, and from
        perturbing to one side only; where some took a smaller size, from twice the usual one. Empty where nothing was
        perturbed.
    narrow
        The perturbation, relative to max(1, |value|), of states and inputs that took a smaller one than usual.
    doubtful
        States and inputs for which no two sizes agreed, or that are answered differently up and down.
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
    source: str = PERTURBED
    variants: tuple[StepMap, ...] = ()
    narrow: Mapping[str, float] = field(default_factory=dict)
    doubtful: tuple[str, ...] = ()


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
    exchange
        The component, at its operating point, with its connected inputs and outputs.
    time
        Of the operating point [s].
    step_size
        Communication step to linearise over [s].
    inputs, observed
        Tunable parameters or open inputs, and outputs, that matter beside the connected ones.
    derivatives
        Also difference the FMU's own derivatives, if it declares them; it costs a third more.
    """
    component = exchange.component
    StateAccess(component)  # refuses what can be neither perturbed nor looked up
    if (inside := embedded_model(component)) is not None:
        return _from_inside(exchange, inside, time, step_size, inputs, observed)
    names = component.description.states
    rates = component.description.rates if derivatives else ()
    n, p = len(names), len(exchange.outputs.names)
    entries = (*exchange.inputs.names, *inputs)
    exits = (*exchange.outputs.names, *observed)
    small, large, usual, narrow, doubtful = _two_sizes(component, entries, exits, time, step_size, rates)

    def step_map(after: Matrix, outputs: Matrix) -> StepMap:
        return StepMap(after[:, :n], after[:, n:], outputs[:p, :n], outputs[:p, n:])

    found, other = step_map(small.after, small.outputs), step_map(large.after, large.outputs)
    return ComponentLinearization(
        component.name,
        names,
        entries,
        exchange.outputs.names,
        *found,
        observed=tuple(observed),
        C_o=small.outputs[p:, :n],
        D_o=small.outputs[p:, n:],
        A_c=small.slopes[:, :n] if len(rates) == n and derivatives else None,
        B_c=small.slopes[:, n:] if len(rates) == n and derivatives else None,
        disagreement=max(float(np.abs(a - b).max(initial=0.0)) for a, b in zip(found, other, strict=True)),
        variants=(
            other,
            step_map(small.after_up, small.outputs_up),
            *([step_map(usual.after, usual.outputs)] if narrow else []),
        ),
        narrow=narrow,
        doubtful=doubtful,
    )


def linearize_by_derivatives(
    exchange: Exchange, time: float, step_size: float, inputs: Sequence[str] = (), observed: Sequence[str] = ()
) -> ComponentLinearization:
    """The same from the FMU's own directional derivatives, without a perturbation and without a step.

    The map over one communication step is the exact one of the continuous model; an FMU's integrator comes close.
    The derivatives are compared with differences of the FMU's own variables, or where its states cannot be set with
    its response to small steps of its inputs.

    Parameters
    ----------
    exchange, time, step_size
        As `linearize_component`.
    inputs, observed
        As `linearize_component`.

    Raises
    ------
    AnalysisError
        If the FMU gives no directional derivatives, or wrong ones.
    """
    component = exchange.component
    states = component.description.states
    rates = component.description.rates
    if not component.description.gives_directional_derivatives:
        raise AnalysisError(
            f"component {component.name!r}: its FMU gives no directional derivatives; native FMUs do (--native), "
            "or linearise by perturbation"
        )
    n = len(states)
    entries = (*exchange.inputs.names, *inputs)
    exits = (*exchange.outputs.names, *observed)
    whole = component.jacobian([*rates, *exits], [*states, *entries])
    blocks = whole[:n, :n], whole[:n, n:], whole[n:, :n], whole[n:, n:]
    if component.description.states_are_settable:
        check_derivatives(component, whole, (*rates, *exits), (*states, *entries))
    else:
        model = ContinuousModel(states, rates, entries, exits, *blocks)
        check_response(component, model, "what its FMU gives as directional derivatives", time, step_size)
    return _over_step(exchange, step_size, DIRECTIONAL, states, entries, observed, *blocks)


def _from_inside(
    exchange: Exchange,
    model: EmbeddedModel,
    time: float,
    step_size: float,
    inputs: Sequence[str],
    observed: Sequence[str],
) -> ComponentLinearization:
    """The model inside an FMU, compared with the FMU and taken over one communication step with its inputs held."""
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
    states, rates = component.description.states, component.description.rates
    compared = ContinuousModel(states, rates, entries, exits, *blocks)
    check_response(component, compared, "the linear model inside its FMU", time, step_size)
    return _over_step(exchange, step_size, PACKED, states, entries, observed, *blocks)


def _over_step(
    exchange: Exchange,
    step_size: float,
    source: str,
    states: tuple[str, ...],
    entries: tuple[str, ...],
    observed: Sequence[str],
    A_c: Matrix,
    B_c: Matrix,
    C: Matrix,
    D: Matrix,
) -> ComponentLinearization:
    """A continuous model, and its exact map over a communication step with the inputs held."""
    p = len(exchange.outputs.names)
    A, B = over_held_inputs(A_c, B_c, step_size)
    return ComponentLinearization(
        exchange.component.name,
        states,
        entries,
        exchange.outputs.names,
        A=A,
        B=B,
        C=C[:p],
        D=D[:p],
        observed=tuple(observed),
        C_o=C[p:],
        D_o=D[p:],
        A_c=A_c,
        B_c=B_c,
        disagreement=0.0,
        source=source,
    )


class _Differences(NamedTuple):
    """Columns of d(x⁺), d(y) and d(ẋ) by every state, then every input; ``_up`` from the perturbation upwards only."""

    after: Matrix
    outputs: Matrix
    slopes: Matrix
    after_up: Matrix
    outputs_up: Matrix


def _two_sizes(
    component: Component,
    inputs: Sequence[str],
    exits: Sequence[str],
    time: float,
    step_size: float,
    rates: Sequence[str],
) -> tuple[_Differences, _Differences, _Differences, dict[str, float], tuple[str, ...]]:
    """Differences of one size, of twice that size, and of twice the usual size, which is smaller for few; with these
    few's sizes by name, and the names of what is doubtful.

    What answers differently up and down keeps the answer upwards of the usual size: a limit is that close.
    """
    names = (*component.description.states, *inputs)
    columns: Sequence[int] = range(len(names))
    found: tuple[_Differences, _Differences] | None = None
    one_sided = np.zeros(len(names), dtype=bool)
    narrow: dict[str, float] = {}
    for size in PERTURBATIONS:
        # The derivatives need no second size: they are differenced over no step.
        pair = (
            _differences(component, names, columns, exits, time, step_size, size, rates),
            _differences(component, names, columns, exits, time, step_size, 2 * size, ()),
        )
        floor = _SMALL * PERTURBATIONS[0] / size
        at_rest = np.eye(len(component.description.states), len(names))[:, columns]
        one, other = ((d.after - at_rest, d.outputs) for d in pair)
        apart = _apart(one, other, _AGREE, floor * step_size, floor)
        if found is None:
            found, usual = pair, _Differences(*(part.copy() for part in pair[1]))
            upwards = pair[0].after_up - at_rest, pair[0].outputs_up
            one_sided = _apart(one, upwards, _EVEN, floor * step_size, floor)
        else:
            for kept, new in zip(found, pair, strict=True):
                for part in _Differences._fields:
                    agreeing = [k for k in range(len(columns)) if not apart[k]]
                    if part.endswith("_up"):
                        agreeing = [k for k in agreeing if not one_sided[columns[k]]]
                    whole, again = getattr(kept, part), getattr(new, part)
                    if whole.size:
                        whole[:, [columns[k] for k in agreeing]] = again[:, agreeing]
            narrow |= {names[k]: size for k, disagree in zip(columns, apart, strict=True) if not disagree}
        columns = [k for k, disagree in zip(columns, apart, strict=True) if disagree]
        if not columns:
            break
    assert found is not None
    return *found, usual, narrow, tuple(name for k, name in enumerate(names) if k in columns or one_sided[k])


def _apart(one: tuple[Matrix, Matrix], other: tuple[Matrix, Matrix], share: float, *floors: float) -> NDArray[np.bool_]:
    """Columns in which two answers, each the states' change and d(y), differ by more than a share of what is there.

    Parameters
    ----------
    floors
        Added to what is there, of the states' change and of the outputs.
    """
    far = [
        (np.abs(a - b) > share * (np.abs(a) + floor)).any(axis=0)
        for a, b, floor in zip(one, other, floors, strict=True)
    ]
    return np.asarray(far[0] | far[1])


def _differences(
    component: Component,
    names: Sequence[str],
    varied: Sequence[int],
    exits: Sequence[str],
    time: float,
    step_size: float,
    size: float,
    rates: Sequence[str],
) -> _Differences:
    """One column for each of ``varied``, which are places in ``names``."""
    z_0 = RealBatch(component, names).read().copy()
    after, outputs, slopes = (RealBatch(component, group) for group in (component.description.states, exits, rates))
    columns = tuple(np.zeros((len(varied), len(batch.names))) for batch in (after, outputs, slopes))
    upwards = tuple(np.zeros_like(column) for column in columns[:2])
    saved = component.save_state()
    try:
        outputs_0, slopes_0 = outputs.read().copy(), slopes.read().copy()
        component.step(time, step_size)
        after_0 = after.read().copy()
        component.restore_state(saved)
        for k, place in enumerate(varied):
            perturbed, value = RealBatch(component, [names[place]]), z_0[place]
            step = size * max(1.0, abs(value))
            signs = _allowed_signs(component, names[place], value, step)
            for sign in signs:
                perturbed.values[0] = value + sign * step
                perturbed.write()
                for batch, column in zip((outputs, slopes), columns[1:], strict=True):
                    column[k] += sign * batch.read()
                component.step(time, step_size)
                columns[0][k] += sign * after.read()
                if sign == signs[0]:
                    upwards[0][k], upwards[1][k] = sign * (after.values - after_0), sign * (outputs.values - outputs_0)
                component.restore_state(saved)
            if len(signs) == 1:
                for column, at_rest in zip(columns, (after_0, outputs_0, slopes_0), strict=True):
                    column[k] -= signs[0] * at_rest
            for column in columns:
                column[k] /= len(signs) * step
            for column in upwards:
                column[k] /= step
    finally:
        component.restore_state(saved)
        component.free_state(saved)
    return _Differences(*(column.T for column in (*columns, *upwards)))


def _allowed_signs(component: Component, name: str, value: float, step: float) -> tuple[float, ...]:
    """Directions of a perturbation that stay within a parameter's declared bounds; both, where none does."""
    info = component.description.variables[name]
    if info.causality != "parameter":
        return (+1.0, -1.0)
    above = info.maximum is None or value + step <= info.maximum
    below = info.minimum is None or value - step >= info.minimum
    return tuple(sign for sign, within in ((+1.0, above), (-1.0, below)) if within) or (+1.0, -1.0)
