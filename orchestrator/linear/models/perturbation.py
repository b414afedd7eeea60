"""How large a perturbation is: two sizes that agree, for each state and each input.

A limit or a dead band close to the operating point answers one size otherwise than another, and upwards otherwise than
downwards (`limits_close_by`)."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from orchestrator.linear.models.differences import (
    Differences,
    PerturbedStep,
    differences_of_alike,
)
from orchestrator.linear.models.held_response import differences_by_rates
from orchestrator.linear.models.limits_close_by import AnswersOfSize, Columns, OneSidedColumns

PERTURBATIONS = (1e-5, 1e-6, 1e-7, 1e-8)
"""Central differences are taken with the first and with twice of it, relative to max(1, |value|), and should agree. A
column where they do not, as a limit or a dead band is close by, is taken anew with the next size."""

_SMALL = 1e-2
"""Rate [1/s] of which an element may differ by the same part as well: smaller elements are rounding."""


@dataclass(frozen=True)
class PerturbationResult:
    # small, large: with one size for each column, and with twice that size; only ``small`` has the time derivatives
    small: Differences
    large: Differences
    usual: Differences  # with twice the usual size for all columns
    narrow: dict[str, float]  # sizes of the columns that took a smaller one than usual, by name
    # names of states and inputs for which no two sizes agreed, or that are answered differently up and down
    doubtful: tuple[str, ...]


def perturb(step: PerturbedStep, rates: Sequence[str], *, once: bool = False) -> PerturbationResult:
    """Perturb every state and input, with smaller sizes where two sizes disagree.

    What answers differently up and down keeps the answer upwards of the usual size: a limit is that close. Where a gain
    carries the usual size to a limit that is far away, a smaller one tells that both sides are alike.

    ``once``: with the usual size alone, for a direction to search in; nothing is known to agree then."""
    names = step.names
    if once:
        alone = step.differences(range(len(names)), PERTURBATIONS[0], rates)
        return PerturbationResult(alone, alone, alone, {}, step.names)
    columns: Sequence[int] = range(len(names))
    # The derivatives need no second size: they are differenced over no step.
    found = differences_by_rates(step, PERTURBATIONS[0], with_slopes=bool(rates)) or _with_both(
        step, columns, PERTURBATIONS[0], rates
    )
    answers = _answers(step, found, columns, PERTURBATIONS[0])
    one_sided = OneSidedColumns(answers, PERTURBATIONS[0])
    columns = _those_of(columns, answers.disagree)
    usual = Differences(*(part.copy() for part in found[1])) if columns else found[1]
    narrow: dict[str, float] = {}
    for size in PERTURBATIONS[1:]:
        if not columns:
            break
        again = _with_both(step, columns, size, rates)
        answers = _answers(step, again, columns, size)
        one_sided.take_back(columns, answers)
        disagree = answers.disagree
        better = ~disagree
        if size == PERTURBATIONS[-1]:
            better &= _is_another(step, answers, found[0], columns)
        for kept, new in zip(found, again, strict=True):
            _take_over(kept, new, columns, better, one_sided.now)
        narrow |= {names[k]: size for k in _those_of(columns, better)}
        columns = _those_of(columns, disagree)
    doubtful = tuple(name for k, name in enumerate(names) if k in columns or one_sided.now[k])
    return PerturbationResult(*found, usual, narrow, doubtful)


def perturb_alike(
    steps: Sequence[PerturbedStep], rates: Sequence[str]
) -> list[PerturbationResult | None]:
    """`perturb` for components whose variables have the same names, all at once; None where a smaller size is needed.

    What NumPy has to do for one of them takes longer than its moves, and hardly longer for all of them."""
    first, size = steps[0], PERTURBATIONS[0]
    columns = range(len(first.names))
    if rates:
        (small,) = differences_of_alike(steps, (size,), rates)
        (large,) = differences_of_alike(steps, (2 * size,))
    else:
        small, large = differences_of_alike(steps, (size, 2 * size))
    answers = _answers(first, (small, large), columns, size)
    uneven = OneSidedColumns(answers, size).now
    found: list[PerturbationResult | None] = []
    disagree = answers.disagree
    for k in range(len(steps)):
        one, other = (Differences(*(part[k] for part in pair)) for pair in (small, large))
        doubtful = tuple(first.names[place] for place in np.flatnonzero(uneven[k]).tolist())
        alone = PerturbationResult(one, other, other, {}, doubtful)
        found.append(None if disagree[k].any() else alone)
    return found


def _with_both(
    step: PerturbedStep, columns: Sequence[int], size: float, rates: Sequence[str]
) -> tuple[Differences, Differences]:
    """Differences with a size and with twice that size; rates are read with the first alone."""
    if rates:
        return step.differences(columns, size, rates), step.differences(columns, 2 * size)
    small, large = step.differences_of_sizes(columns, (size, 2 * size))
    return small, large


def _answers(
    step: PerturbedStep, pair: tuple[Differences, Differences], columns: Sequence[int], size: float
) -> AnswersOfSize:
    """Return the answers to a size and to twice it, from the differences of some columns."""
    small, large = pair
    at_rest = np.eye(len(step.states), len(step.names))[:, columns]
    floor = _SMALL * PERTURBATIONS[0] / size
    change = small.after - at_rest
    return AnswersOfSize(
        once=(change, small.outputs),
        twice=(change if large.after is small.after else large.after - at_rest, large.outputs),
        upwards=(small.after_up - at_rest, small.outputs_up),
        floors=(floor * step.step_size, floor),
    )


def _is_another(
    step: PerturbedStep, smallest: AnswersOfSize, usual: Differences, columns: Sequence[int]
) -> Columns:
    """Return the columns of which the smallest size tells another answer than the usual one, rounding apart.

    Elsewhere the two usual sizes differ by rounding that a large gain multiplies, and the smallest has more of it."""
    at_rest = np.eye(len(step.states), len(step.names))[:, columns]
    before = (usual.after[:, columns] - at_rest, usual.outputs[:, columns])
    return replace(smallest, twice=before).disagree


def _those_of(columns: Sequence[int], chosen: Columns) -> list[int]:
    return [k for k, is_chosen in zip(columns, chosen, strict=True) if is_chosen]


def _take_over(
    kept: Differences,
    new: Differences,
    columns: Sequence[int],
    agreeing: Columns,
    one_sided: Columns,
) -> None:
    """Put the columns that agree with a smaller size into what is kept, one-sided ones without their side upwards."""
    for part in Differences._fields:
        taken = [k for k in range(len(columns)) if agreeing[k]]
        if part.endswith("_up"):
            taken = [k for k in taken if not one_sided[columns[k]]]
        whole, again = getattr(kept, part), getattr(new, part)
        if whole.size:
            whole[:, [columns[k] for k in taken]] = again[:, taken]
