"""How large a perturbation is: two sizes that agree, for each state and each input.

A limit or a dead band close to the operating point answers one size otherwise than another, and upwards otherwise than
downwards."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from orchestrator.core.arrays import Matrix, Vector
from orchestrator.linear.models.differences import Differences, PerturbedStep
from orchestrator.linear.models.held_response import differences_by_rates

PERTURBATIONS = (1e-5, 1e-6, 1e-7, 1e-8)
"""Central differences are taken with the first and with twice of it, relative to max(1, |value|), and should agree. A
column where they do not, as a limit or a dead band is close by, is taken anew with the next size."""

_AGREE = 5e-3
"""Two sizes agree if every element differs by less than this part of its size. In smooth systems, up to IEEE 118-bus
systems, the part is at most 3e-4; if a signal runs into its limit it is a half."""

_SMALL = 1e-2
"""Rate [1/s] of which an element may differ by the same part as well: smaller elements are rounding."""

_EVEN = 0.1
"""An element whose answers up and down differ by more than this part belongs to a limit on one side; in smooth systems
it is at most 0.05."""

_FAR = 1e-3
"""Movement of a state [pu] in a step, or of an output, by which a limit that it meets is not at the operating point:
the perturbation is multiplied by a large gain, such as that of a stabiliser before a regulator with a derivative."""


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
    names, h = step.names, step.step_size
    columns: Sequence[int] = range(len(names))
    if once:
        alone = step.differences(columns, PERTURBATIONS[0], rates)
        return PerturbationResult(alone, alone, alone, {}, step.names)
    found: tuple[Differences, Differences] | None = None
    first = differences_by_rates(step, PERTURBATIONS[0], with_slopes=bool(rates))
    one_sided = np.zeros(len(names), dtype=bool)
    narrow: dict[str, float] = {}
    for size in PERTURBATIONS:
        # The derivatives need no second size: they are differenced over no step.
        pair = first or (
            step.differences(columns, size, rates),
            step.differences(columns, 2 * size),
        )
        first = None
        floor = _SMALL * PERTURBATIONS[0] / size
        at_rest = np.eye(len(step.states), len(names))[:, columns]
        one, other = ((d.after - at_rest, d.outputs) for d in pair)
        apart = _apart(one, other, _AGREE, floor * h, floor)
        if found is None:
            found, usual = pair, Differences(*(part.copy() for part in pair[1]))
            upwards = pair[0].after_up - at_rest, pair[0].outputs_up
            one_sided = _apart(one, upwards, _EVEN, floor * h, floor)
            distant = one_sided & (_movement(one) * size > _FAR)
        else:
            upwards = pair[0].after_up - at_rest, pair[0].outputs_up
            even = ~_apart(one, upwards, _EVEN, floor * h, floor) & ~apart
            one_sided[columns] &= ~(even & distant[columns])
            for kept, new in zip(found, pair, strict=True):
                _take_over(kept, new, columns, ~apart, one_sided)
            narrow |= {
                names[k]: size for k, disagree in zip(columns, apart, strict=True) if not disagree
            }
        columns = [k for k, disagree in zip(columns, apart, strict=True) if disagree]
        if not columns:
            break
    assert found is not None
    doubtful = tuple(name for k, name in enumerate(names) if k in columns or one_sided[k])
    return PerturbationResult(*found, usual, narrow, doubtful)


def _movement(answer: tuple[Matrix, Matrix]) -> Vector:
    """Return the largest movement per unit in each column of an answer, of the states or of the outputs."""
    return np.asarray(np.abs(np.vstack(answer)).max(axis=0, initial=0.0))


def without_curvature(
    once: tuple[Matrix, Matrix], twice: tuple[Matrix, Matrix]
) -> tuple[Matrix, Matrix]:
    """Answers to one side without their curvature, from two sizes of which the second is twice the first.

    The curvature of something smooth adds a part that grows with the size, and it is gone here; a corner, or a limit
    within the sizes, stays."""
    after, outputs = (2 * a - b for a, b in zip(once, twice, strict=True))
    return after, outputs


def _take_over(
    kept: Differences,
    new: Differences,
    columns: Sequence[int],
    agreeing: NDArray[np.bool_],
    one_sided: NDArray[np.bool_],
) -> None:
    for part in Differences._fields:
        taken = [k for k in range(len(columns)) if agreeing[k]]
        if part.endswith("_up"):
            taken = [k for k in taken if not one_sided[columns[k]]]
        whole, again = getattr(kept, part), getattr(new, part)
        if whole.size:
            whole[:, [columns[k] for k in taken]] = again[:, taken]


def _apart(
    one: tuple[Matrix, Matrix], other: tuple[Matrix, Matrix], share: float, *floors: float
) -> NDArray[np.bool_]:
    """Columns in which two answers, each the states' change and d(y), differ by more than a share of what is there."""
    far = [
        (np.abs(a - b) > share * (np.abs(a) + floor)).any(axis=0)
        for a, b, floor in zip(one, other, floors, strict=True)
    ]
    return np.asarray(far[0] | far[1])
