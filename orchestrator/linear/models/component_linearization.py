"""Linear model of one running FMU over one communication step, by perturbation of its states and inputs.

Where an FMU gives directional derivatives, these give the same model in an independent way."""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from orchestrator.core.arrays import Matrix
from orchestrator.core.errors import AnalysisError
from orchestrator.core.options import Option
from orchestrator.devices.fmi.component import Component, RealBatch
from orchestrator.devices.fmi.linear_model import EmbeddedModel
from orchestrator.linear.models.differences import PerturbedStep
from orchestrator.linear.models.held_inputs import over_held_inputs
from orchestrator.linear.models.limits_close_by import without_curvature
from orchestrator.linear.models.linear_model import DIRECTIONAL, PACKED, PERTURBED
from orchestrator.linear.models.perturbation import PerturbationResult, perturb, perturb_alike
from orchestrator.linear.models.response_check import ContinuousModel, check_response
from orchestrator.linear.models.state_access import (
    StateAccess,
    check_operating_point,
    embedded_model,
    obstacle,
)
from orchestrator.systems.coupling.turns import Exchange


class StepMap(NamedTuple):
    A: Matrix
    B: Matrix
    C: Matrix
    D: Matrix


@dataclass(frozen=True)
class ComponentLinearization:
    """x⁺ = A·x + B·u over one communication step with u held, y = C·x + D·u; and ẋ = A_c·x + B_c·u."""

    name: str
    # states, inputs, outputs: Names. The connected inputs and outputs come first, then the requested inputs.
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    # A, B, C, D: of the step map, shapes (n, n), (n, m), (p, n), (p, m)
    A: Matrix
    B: Matrix
    C: Matrix
    D: Matrix
    observed: tuple[str, ...]  # names of the requested outputs
    # C_o, D_o: rows of C and D for the requested outputs, shapes (q, n), (q, m)
    C_o: Matrix
    D_o: Matrix
    # A_c, B_c: a and B of the continuous model, from the FMU's own derivatives; None if the FMU declares no derivatives
    # or they were not requested
    A_c: Matrix | None
    B_c: Matrix | None
    # largest difference of an element of A, B, C or D between the two perturbation sizes
    disagreement: float
    # origin of the model: ``perturbed``, ``directional``, ``packed`` or ``identified``
    source: str = PERTURBED
    # The same matrices, computed in other ways, which should hardly differ: with the other perturbation size, and with
    # perturbations of both sizes to one side only, their curvature taken out. Where some columns have a smaller size,
    # also with twice the usual size. Empty for a model that was not perturbed.
    variants: tuple[StepMap, ...] = ()
    # size of the perturbation, relative to max(1, |value|), by the name of each state or input that needed a smaller
    # size than usual
    narrow: Mapping[str, float] = field(default_factory=dict)
    # states and inputs for which no two sizes agreed, or whose differences upwards and downwards deviate
    doubtful: tuple[str, ...] = ()

    def connected_alone(self, count: int) -> "ComponentLinearization":
        """The same with the first inputs alone, as many as are connected, and without the requested outputs."""
        own = {*self.states, *self.inputs[:count]}
        narrow = {name: size for name, size in self.narrow.items() if name in own}
        variants = tuple(
            one._replace(B=one.B[:, :count], D=one.D[:, :count]) for one in self.variants
        )
        return replace(
            self,
            inputs=self.inputs[:count],
            B=self.B[:, :count],
            D=self.D[:, :count],
            observed=(),
            C_o=self.C_o[:0],
            D_o=self.D_o[:0, :count],
            B_c=None if self.B_c is None else self.B_c[:, :count],
            variants=variants,
            narrow=narrow,
            doubtful=tuple(name for name in self.doubtful if name in own),
        )


def linearize_component(
    exchange: Exchange,
    time: float,
    step_size: float,
    inputs: Sequence[str] = (),
    observed: Sequence[str] = (),
    *,
    derivatives: bool = False,
    idle: Collection[str] = (),
    once: bool = False,
) -> ComponentLinearization:
    """Perturb one component around its present state, and restore that state.

    Where its states cannot be set, the linear model inside its FMU is taken, if that is of this operating point.

    ``derivatives``: also difference the FMU's own derivatives, if it declares them; it costs a third more.
    ``idle``: connected inputs that nothing moves: they are not perturbed, and their columns of B and D are 0."""
    component = exchange.component
    # refuses a component that can neither be perturbed nor has a model inside
    StateAccess(component)
    inside = embedded_model(component)
    if inside is not None:
        return _from_inside(exchange, inside, time, step_size, inputs, observed)
    rates = component.description.rates if derivatives else ()
    entries = (*exchange.inputs.names, *inputs)
    exits = (*exchange.outputs.names, *observed)
    moved = [k for k, name in enumerate(entries) if name not in idle]
    found = perturb(
        PerturbedStep(component, [entries[k] for k in moved], exits, time, step_size),
        rates,
        once=once,
    )
    return _from_perturbation(exchange, found, entries, moved, observed, derivatives=derivatives)


ALIKE = 64
"""Components alike that are perturbed at once: what NumPy keeps of them stays in the processor's cache."""


def linearize_alike(
    exchanges: Iterable[Exchange], time: float, step_size: float, *, derivatives: bool = False
) -> Iterator[ComponentLinearization]:
    """`linearize_component` for many, with the same bits; components whose variables have the same names at once.

    Those are left out that are the only ones of their kind, that cannot be perturbed, or that need a smaller
    perturbation than usual."""
    kinds: dict[tuple[tuple[str, ...], ...], list[Exchange]] = {}
    for exchange in exchanges:
        names = exchange.inputs.names, exchange.outputs.names
        description = exchange.component.description
        kind = (description.states, description.rates, *names)
        kinds.setdefault(kind, []).append(exchange)
    for (_, rates, entries, exits), members in kinds.items():
        some = [] if len(members) == 1 else [e for e in members if _is_perturbed(e.component)]
        asked = rates if derivatives else ()
        for first in range(0, len(some), ALIKE):
            part = some[first : first + ALIKE]
            steps = [PerturbedStep(e.component, entries, exits, time, step_size) for e in part]
            for exchange, found in zip(part, perturb_alike(steps, asked), strict=True):
                if found is not None:
                    moved = range(len(entries))
                    yield _from_perturbation(
                        exchange, found, entries, moved, (), derivatives=derivatives
                    )


def _is_perturbed(component: Component) -> bool:
    """Return whether a component's linear model comes from perturbing it."""
    return obstacle(component) is None and embedded_model(component) is None


def _from_perturbation(
    exchange: Exchange,
    found: PerturbationResult,
    entries: tuple[str, ...],
    moved: Sequence[int],
    observed: Sequence[str],
    *,
    derivatives: bool,
) -> ComponentLinearization:
    """The model of what a component answered; ``moved``: the places of the entries that were perturbed."""
    names, rates = exchange.component.description.states, exchange.component.description.rates
    n, p = len(names), len(exchange.outputs.names)

    def by_input(answers: Matrix) -> Matrix:
        if len(moved) == len(entries):
            return answers[:, n:]
        whole = np.zeros((len(answers), len(entries)))
        whole[:, moved] = answers[:, n:]
        return whole

    def step_map(after: Matrix, outputs: Matrix) -> StepMap:
        return StepMap(after[:, :n], by_input(after), outputs[:p, :n], by_input(outputs[:p]))

    small, large = found.small, found.large
    one = other = step_map(small.after, small.outputs)
    if large.after is not small.after or large.outputs is not small.outputs:
        other = step_map(large.after, large.outputs)
    disagreement = max(
        0.0 if a is b else float(np.abs(a - b).max(initial=0.0))
        for a, b in zip(one, other, strict=True)
    )
    one_sided = without_curvature(
        (small.after_up, small.outputs_up), (large.after_up, large.outputs_up)
    )
    variants = [other, step_map(*one_sided)]
    if found.narrow:
        variants.append(step_map(found.usual.after, found.usual.outputs))
    A_c = B_c = None
    if derivatives and len(rates) == n:
        A_c, B_c = small.slopes[:, :n], by_input(small.slopes)
    return ComponentLinearization(
        exchange.component.name,
        names,
        entries,
        exchange.outputs.names,
        *one,
        observed=tuple(observed),
        C_o=small.outputs[p:, :n],
        D_o=by_input(small.outputs[p:]),
        A_c=A_c,
        B_c=B_c,
        disagreement=disagreement,
        variants=tuple(variants),
        narrow=found.narrow,
        doubtful=found.doubtful,
    )


def linearize_by_derivatives(
    exchange: Exchange,
    time: float,
    step_size: float,
    inputs: Sequence[str] = (),
    observed: Sequence[str] = (),
) -> ComponentLinearization:
    """The component's linear model from the FMU's own directional derivatives, without a perturbation and without a
    step.

    The map over one communication step is the exact one of the continuous model; an FMU's integrator comes close.
    The derivatives are compared with differences of the FMU's own variables, or where its states cannot be set with
    its response to small steps of its inputs."""
    component = exchange.component
    states = component.description.states
    rates = component.description.rates
    if not component.description.gives_directional_derivatives:
        raise AnalysisError(
            f"component {component.name!r}: its FMU gives no directional derivatives; "
            "native FMUs do (" + Option.NATIVE + "), or linearise by perturbation"
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
        check_response(
            component, model, "what its FMU gives as directional derivatives", time, step_size
        )
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
    missing = [v for v in entries if v not in model.inputs] + [
        v for v in exits if v not in model.outputs
    ]
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


SIZES = (1e-5, 2e-5)
"""Two sizes of central differences, relative to max(1, |value|). The difference between both results shows their
accuracy."""

# largest relative difference of an element from its central one: a hundredth of a point of damping
AGREES = 1e-4
# smaller sizes, which are tried if a limit lies within the first ones
_NEARBY = (1e-7, 1e-9, 1e-11)
# a difference quotient that changes by more than this part of itself depends on the size
_BENT = 0.1
# a difference quotient that differs by less than this part confirms the derivative
_FITS = 0.01

_ROUNDING = 1e-8
"""Accepted difference relative to the largest element of the row, caused by rounding in the row's terms, divided by the
size of the difference."""


def check_derivatives(
    component: Component, given: Matrix, unknowns: Sequence[str], knowns: Sequence[str]
) -> None:
    """Compare partial derivatives that an FMU gives with differences of its variables, and put the FMU back."""
    one, two = _central_differences(component, unknowns, knowns)
    allowed = (
        AGREES * np.abs(one)
        + 3 * np.abs(one - two)
        + _ROUNDING * np.abs(one).max(axis=1, initial=0.0)[:, None]
    )
    differs = np.abs(given - one)
    wrong = ~(differs <= allowed)
    if wrong.any():
        wrong &= ~_right_nearby(component, given, one, unknowns, knowns, wrong)
    if not wrong.any():
        return
    part = np.where(wrong, differs / np.maximum(np.abs(one), np.finfo(float).tiny), 0.0)
    i, k = divmod(int(np.nanargmax(part)), part.shape[1])
    raise AnalysisError(
        f"component {component.name!r}: its FMU's directional derivatives are wrong "
        f"in {wrong.sum()} of {wrong.size} elements: that of {unknowns[i]} by "
        f"{knowns[k]} is given as {given[i, k]:.6g}, but changing {knowns[k]} by "
        f"{SIZES[0]:g} changes {unknowns[i]} by {one[i, k]:.6g} per unit; linearise "
        "by perturbation (without "
        + Option.DIRECTIONAL
        + "), and have the FMU's derivatives corrected"
    )


def _right_nearby(
    component: Component,
    given: Matrix,
    far: Matrix,
    unknowns: Sequence[str],
    knowns: Sequence[str],
    doubted: NDArray[np.bool_],
) -> NDArray[np.bool_]:
    """The doubted elements that are right for smaller changes; the larger change has run into a limit.

    Only an element whose difference quotient depends on the size is looked at again: a wrong derivative of something
    linear stays wrong."""
    right = np.zeros_like(doubted)
    columns = np.flatnonzero(doubted.any(axis=0))
    some = [knowns[k] for k in columns.tolist()]
    for size in _NEARBY:
        (near,) = _central_differences(component, unknowns, some, (size,))
        bent = np.abs(near - far[:, columns]) > _BENT * np.abs(near)
        fits = np.abs(given[:, columns] - near) <= _FITS * np.abs(near)
        right[:, columns] |= bent & fits
    return right


def _central_differences(
    component: Component,
    unknowns: Sequence[str],
    knowns: Sequence[str],
    sizes: Sequence[float] = SIZES,
) -> list[Matrix]:
    before = RealBatch(component, knowns).read().copy()
    perturbed, follows = (
        [RealBatch(component, [name]) for name in knowns],
        RealBatch(component, unknowns),
    )
    found = [np.zeros((len(unknowns), len(knowns))) for _ in sizes]
    saved = component.save_state()
    try:
        for k, value in enumerate(before):
            for size, columns in zip(sizes, found, strict=True):
                step = size * max(1.0, abs(value))
                for sign in (+1.0, -1.0):
                    perturbed[k].values[0] = value + sign * step
                    perturbed[k].write()
                    columns[:, k] += sign * follows.read() / (2 * step)
            perturbed[k].values[0] = value
            perturbed[k].write()
    finally:
        component.restore_state(saved)
        component.free_state(saved)
    return found
