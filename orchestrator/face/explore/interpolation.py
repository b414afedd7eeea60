"""Between the computed values of a saved page: which modes belong together, and how far a straight line is off."""

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from orchestrator.core.arrays import Complex, Numbers
from orchestrator.core.errors import CosimError
from orchestrator.core.late import optimize

_FAR = (
    0.3  # a mode that moves by more than this part of itself from corner to corner is not followed
)
_DRAWN = 75.0  # damping up to which the map shows a mode without a zoom [%]

Point = dict[str, float]
Answer = Mapping[str, Any]


def cells_of(grid: Mapping[str, Sequence[float]]) -> list[dict[str, tuple[float, float]]]:
    """The cells between neighbours of a grid: of each value its lower and its upper end."""
    sides = [[*itertools.pairwise(axis)] for axis in grid.values()]
    return [dict(zip(grid, ends, strict=True)) for ends in itertools.product(*sides)]


def corners_of(cell: Mapping[str, tuple[float, float]]) -> list[Point]:
    """The corners in the order of the page: the last value moves first."""
    return [dict(zip(cell, chosen, strict=True)) for chosen in itertools.product(*cell.values())]


def middle_of(cell: Mapping[str, tuple[float, float]]) -> Point:
    return {key: (low + high) / 2 for key, (low, high) in cell.items()}


def judged_cell(
    cell: Mapping[str, tuple[float, float]],
    places: Sequence[int],
    answers: Sequence[Answer],
    computed: Callable[[Point], Answer],
) -> dict[str, Any] | None:
    """Compare a cell's middle, computed, with the straight line between its corners.

    Parameters
    ----------
    cell
        Lower and upper end of each value.
    places
        Of each corner, in the order of `corners_of`, its place among the answers.
    answers
        What was computed at the corners, each with ``modes``.
    computed
        Computes the middle.

    Returns
    -------
    dict or None
        ``at`` the cell, ``corners`` the places, ``modes`` of each followed mode its place at every corner, ``least`` by
        how many points of damping the least damped mode is off in the middle, ``hertz`` by how many Hz, ``most`` by how
        many points any mode that the map shows.
        None where the middle has no answer, or no mode can be followed.
    """
    modes = followed_modes([eigenvalues_of(answers[place]) for place in places])
    if not modes:
        return None
    try:
        right = eigenvalues_of(computed(middle_of(cell)))
    except CosimError:
        return None
    if not right.size:
        return None
    drawn = np.array(
        [
            np.mean([eigenvalues_of(answers[p])[k] for p, k in zip(places, one, strict=True)])
            for one in modes
        ]
    )
    least, most = errors(drawn, right)
    shown, true = drawn[np.argmin(_damping(drawn))], right[np.argmin(_damping(right))]
    hertz = float(abs(shown.imag - true.imag)) / math.tau
    return {
        "at": {key: list(ends) for key, ends in cell.items()},
        "corners": list(places),
        "modes": modes,
        "least": float(f"{least:.2g}"),
        "hertz": float(f"{hertz:.2g}"),
        "most": float(f"{most:.2g}"),
    }


def eigenvalues_of(answer: Answer) -> Complex:
    found = answer["modes"]["scenarios"][0]["modes"]
    return np.array([complex(mode["real"], mode["imag"]) for mode in found], dtype=np.complex128)


def followed_modes(corners: Sequence[Complex]) -> list[list[int]]:
    """Pair the modes of the corners: each that has a partner at every corner, with its places there."""
    first, *others = corners
    followed = [[k] for k in range(len(first))]
    for other in others:
        places = _partners(first, other)
        followed = [[*one, places[one[0]]] for one in followed if one[0] in places]
    return followed


def _partners(one: Complex, other: Complex) -> dict[int, int]:
    if not one.size or not other.size:
        return {}
    apart = np.abs(one[:, None] - other[None]) / np.maximum(np.abs(one[:, None]), 1e-9)
    rows, columns = optimize.linear_sum_assignment(apart)
    pairs = zip(rows.tolist(), columns.tolist(), strict=True)
    return {k: j for k, j in pairs if apart[k, j] < _FAR}


def errors(drawn: Complex, right: Complex) -> tuple[float, float]:
    """Points of damping by which the least damped mode is off, and at most any drawn mode from its nearest one."""
    shown, true = _damping(drawn), _damping(right)
    nearest = true[np.argmin(np.abs(drawn[:, None] - right[None]), axis=1)]
    off = np.abs(shown - nearest)[shown < _DRAWN]
    return float(abs(shown.min() - true.min())), float(off.max(initial=0.0))


def _damping(eigenvalues: Complex) -> Numbers:
    return np.asarray(-100 * eigenvalues.real / np.maximum(np.abs(eigenvalues), 1e-12))
