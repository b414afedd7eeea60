"""Differences of a component with very many inputs, without a step for each of them.

With inputs that are held, a state in which nothing moves stays where it is, however the FMU integrates. So to first
order a step's answer to inputs follows from its answer to states, and from the rates:

    x⁺ = A·x + B·u  with  B = (A − I)·A_c⁻¹·B_c,  where  ẋ = A_c·x + B_c·u

Where the states are many as well, no step is made for each of them either. Every integrator whose inputs are held makes
a polynomial of its rates, A = I + h·A_c·(c₁ + c₂·h·A_c + …), whose few coefficients one step with all states moved at
once gives; B is h·(c₁ + c₂·h·A_c + …)·B_c then.

Steps in which all inputs are moved at once then prove it; where they do not, each input has its own steps. With twice
the size likewise: all states and inputs are moved at once, and where that gives what the single answers add up to, no
element disagrees with itself at another size."""

from collections.abc import Sequence

import numpy as np

from orchestrator.core.arrays import Matrix
from orchestrator.linear.models.differences import Differences, PerturbedStep

MANY_MOVED = 1_000
"""Inputs from which on they are not stepped one by one; in a network of 2,869 buses a step costs 0.8 ms."""

MANY_STATES = 100
"""States from which on they are not stepped one by one; in a network of 9,241 buses, which has 1,736, a step costs
4 ms."""

_MOST_TERMS = 12
"""Coefficients of the polynomial; each makes its remainder smaller by the part of its slowest state that passes in a
step, and four are exact for one step of Runge-Kutta."""

_FITS = 1e-9
"""Part of the sum of single answers by which a step with all states moved may differ from the polynomial."""

_BETTER = 0.5  # part of what is left over that one more coefficient must leave, or it is none

_DIRECTIONS = 3  # random directions in which all inputs are moved at once
# part of the sum of the single answers by which the answer to all at once may differ
_HOLDS = 1e-8
_ROUNDING = 1e-15  # part of max(1, |state|) by which it may differ as well


def differences_by_rates(
    step: PerturbedStep, size: float, *, with_slopes: bool
) -> tuple[Differences, Differences] | None:
    """Central differences with a size and with twice that size; None where every input needs steps of its own.

    ``with_slopes``: keep d(ẋ) of the first size."""
    rates, n = step.component.description.rates, len(step.states)
    if len(step.inputs) < MANY_MOVED or len(rates) != n or step.moves_at_rest():
        return None
    small = _by_rates(step, size, rates)
    if small is None or not _is_right(step, small.after[:, n:], size):
        return None
    none = np.zeros((0, len(step.names)))
    rest = small._replace(slopes=none, slopes_up=none)
    large: Differences | None = rest
    if not _holds_for_twice(step, small, size):
        large = _by_rates(step, 2 * size, rates)
    if large is None:
        return None
    return (small if with_slopes else rest), large._replace(slopes=none, slopes_up=none)


def _by_rates(step: PerturbedStep, size: float, rates: Sequence[str]) -> Differences | None:
    unstepped = _unstepped(step, size, rates) if len(step.states) >= MANY_STATES else None
    if unstepped is not None:
        return unstepped
    n, columns = len(step.states), range(len(step.names))
    found = step.differences(columns, size, rates, columns[n:])
    try:
        over = np.linalg.solve(found.slopes[:, :n].T, (found.after[:, :n] - np.eye(n)).T).T
    except np.linalg.LinAlgError:
        return None
    found.after[:, n:] = over @ found.slopes[:, n:]
    found.after_up[:, n:] = over @ found.slopes_up[:, n:]
    return found


def _unstepped(step: PerturbedStep, size: float, rates: Sequence[str]) -> Differences | None:
    """The same without a step for each state; None where steps do not prove it."""
    n, columns = len(step.states), range(len(step.names))
    found = step.differences(columns, size, rates, columns)
    over = _over_step_by_rates(step, found.slopes[:, :n], size)
    if over is None:
        return None
    for after, slopes in ((found.after, found.slopes), (found.after_up, found.slopes_up)):
        after[:] = over @ slopes
        after[:, :n] += np.eye(n)
    return found


def _over_step_by_rates(step: PerturbedStep, A_c: Matrix, size: float) -> Matrix | None:
    """Return h·(c₁ + c₂·h·A_c + …), by which rates become changes over a step; None where steps do not prove it."""
    h, n = step.step_size, len(step.states)
    Z, sizes, random = h * A_c, step.all_sizes(size)[:n], np.random.default_rng(2)
    turns = random.choice([-1.0, 1.0], n) * sizes
    coefficients = _coefficients(Z, turns, step.response_to_states(turns) - turns)
    over = np.zeros_like(Z)
    for coefficient in coefficients[::-1].tolist():
        over = Z @ over if over.any() else over
        over[np.diag_indices(n)] += coefficient
    A = np.eye(n) + over @ Z
    allowed = _FITS * (np.abs(A) @ sizes) + _ROUNDING * n
    for _ in range(_DIRECTIONS):
        turns = random.choice([-1.0, 1.0], n) * sizes
        if not (np.abs(step.response_to_states(turns) - A @ turns) <= allowed).all():
            return None
    return h * over


def _coefficients(Z: Matrix, turns: Matrix, change: Matrix) -> Matrix:
    """Fit c₁, c₂, … of the change c₁·Z·t + c₂·Z²·t + … by a step; one more leaves over what fewer do, its rounding."""
    powers, last = np.zeros((len(Z), 0)), turns
    found, left = np.zeros(0), float(np.linalg.norm(change))
    for _ in range(_MOST_TERMS):
        last = Z @ last
        powers = np.column_stack([powers, last])
        scale = np.maximum(np.linalg.norm(powers, axis=0), np.finfo(float).tiny)
        more = np.linalg.lstsq(powers / scale, change)[0] / scale
        rest = float(np.linalg.norm(powers @ more - change))
        if not rest <= _BETTER * left:
            break
        found, left = more, rest
    return found


def _holds_for_twice(step: PerturbedStep, found: Differences, size: float) -> bool:
    """Return whether all variables moved at once by twice the size are answered by the sum of the single answers."""
    random, sizes = np.random.default_rng(1), step.all_sizes(2 * size)
    for _ in range(_DIRECTIONS):
        turns = random.choice([-1.0, 1.0], len(sizes)) * sizes
        answers = step.answer_to_all(turns)
        for answer, matrix in zip(answers, (found.after, found.outputs), strict=True):
            allowed = _HOLDS * (np.abs(matrix) @ sizes) + _ROUNDING * len(sizes)
            if not (np.abs(answer - matrix @ turns) <= allowed).all():
                return False
    return True


def _is_right(step: PerturbedStep, B: Matrix, size: float) -> bool:
    """Return whether steps with all inputs moved at once give what their single answers add up to."""
    random, sizes = np.random.default_rng(0), step.sizes(size)
    floor = _ROUNDING * len(step.inputs)
    for _ in range(_DIRECTIONS):
        turns = random.choice([-1.0, 1.0], len(sizes)) * sizes
        apart = np.abs(step.response(turns) - B @ turns)
        if not (apart <= _HOLDS * (np.abs(B) @ sizes) + floor).all():
            return False
    return True
