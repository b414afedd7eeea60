"""Comparison of an FMU's directional derivatives with differences of its variables."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from orchestrator.arrays import Matrix
from orchestrator.errors import AnalysisError
from orchestrator.fmi.component import Component, RealBatch

SIZES = (1e-5, 2e-5)
"""Two sizes of central differences, relative to max(1, |value|). The difference between both results shows their
accuracy."""

AGREES = 1e-4
"""Largest difference of an element from its central difference, relative to it: a hundredth of a point of damping."""

_NEARBY = (1e-7, 1e-9, 1e-11)  # smaller sizes, which are tried if a limit lies within the first ones
_BENT, _FITS = 0.1, 0.01
"""A difference quotient that changes by more than the first part depends on the size. A quotient that differs by less
than the second part confirms the derivative."""

_ROUNDING = 1e-8
"""Accepted difference relative to the largest element of the row, caused by rounding in the row's terms, divided by the
size of the difference."""


def check_derivatives(component: Component, given: Matrix, unknowns: Sequence[str], knowns: Sequence[str]) -> None:
    """Compare partial derivatives that an FMU gives with differences of its variables, and put the FMU back."""
    one, two = _central_differences(component, unknowns, knowns)
    allowed = AGREES * np.abs(one) + 3 * np.abs(one - two) + _ROUNDING * np.abs(one).max(axis=1, initial=0.0)[:, None]
    differs = np.abs(given - one)
    wrong = ~(differs <= allowed)
    if wrong.any():
        wrong &= ~_right_nearby(component, given, one, unknowns, knowns, wrong)
    if not wrong.any():
        return
    part = np.where(wrong, differs / np.maximum(np.abs(one), np.finfo(float).tiny), 0.0)
    i, k = divmod(int(np.nanargmax(part)), part.shape[1])
    raise AnalysisError(
        f"component {component.name!r}: its FMU's directional derivatives are wrong in {wrong.sum()} of {wrong.size} "
        f"elements: that of {unknowns[i]} by {knowns[k]} is given as {given[i, k]:.6g}, but changing {knowns[k]} by "
        f"{SIZES[0]:g} changes {unknowns[i]} by {one[i, k]:.6g} per unit; linearise by perturbation (without "
        "--directional), and have the FMU's derivatives corrected"
    )


def _right_nearby(
    component: Component, given: Matrix, far: Matrix, unknowns: Sequence[str], knowns: Sequence[str],
    doubted: NDArray[np.bool_],
) -> NDArray[np.bool_]:  # fmt: skip
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
    component: Component, unknowns: Sequence[str], knowns: Sequence[str], sizes: Sequence[float] = SIZES
) -> list[Matrix]:
    before = RealBatch(component, knowns).read().copy()
    perturbed, follows = [RealBatch(component, [name]) for name in knowns], RealBatch(component, unknowns)
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
