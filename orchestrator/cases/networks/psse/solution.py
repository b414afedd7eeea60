"""The solution that a RAW file holds, VM and VA: at which buses it fits the machines' reactive powers QG.

PSS/E solves with the limits of the machines' reactive power, and saves what came out: a machine at a limit has
QG = QT or QB and another VM than VS.  Its dynamics start from VM and QG.  If both fit, VM tells the machine's operating
point, and VS does not."""

import cmath
import math
from collections.abc import Mapping, Sequence

import numpy as np
from scipy.sparse import coo_matrix, diags_array
from scipy.sparse.linalg import spsolve

from orchestrator.core.arrays import Matrix

_LEAST = 1.0  # reactive power that rounded voltages and a loose tolerance may leave at a bus [Mvar]
_PART = 0.02  # part of a bus' reactive power that they may leave


def reactive_needs(
    rows: Mapping[int, Sequence[float]],
    branches: Sequence[Sequence[float]],
    to_earth: Sequence[tuple[complex, complex]],
    base_mva: float,
) -> dict[int, float]:
    """Return the reactive power that machines must feed into each bus for the file's voltages [Mvar].

    ``rows``, ``branches``: MATPOWER's tables of buses, by number, and of branches; ``to_earth``: admittances at both
    ends of each branch [pu of ``base_mva``].  A bus without a voltage is a star point, which feeds nothing.  Empty if
    the file is not solved, that is if all angles are 0."""
    table = np.array(list(rows.values()))
    if not len(branches) or not table[:, 8].any():
        return {}
    place = {number: k for k, number in enumerate(rows)}
    matrix = _admittances(np.array(branches), np.array(to_earth), place)
    matrix += diags_array((table[:, 4] + 1j * table[:, 5]) / base_mva).tocsr()
    voltages = table[:, 7] * np.exp(1j * np.radians(table[:, 8]))
    inner, outer = np.flatnonzero(table[:, 7] == 0), np.flatnonzero(table[:, 7])
    if inner.size:
        drawn = -matrix[np.ix_(inner, outer)] @ voltages[outer]
        voltages[inner] = np.atleast_1d(spsolve(matrix[np.ix_(inner, inner)].tocsc(), drawn))
    needed = base_mva * (voltages * (matrix @ voltages).conj()).imag + table[:, 3]
    return dict(zip(rows, map(float, needed), strict=True))


def stated_voltages(rows: Sequence[Sequence[float]] | Matrix) -> dict[int, complex]:
    """Return the file's voltages [pu] by bus, from MATPOWER's table of buses; a star point has none."""
    return {int(row[0]): cmath.rect(row[7], math.radians(row[8])) for row in rows if row[7] > 0}


def fits(fed_mvar: float, needed_mvar: float) -> bool:
    """Return whether the machines at a bus feed what the file's voltages need there."""
    return abs(fed_mvar - needed_mvar) <= max(_LEAST, _PART * abs(needed_mvar))


def _admittances(branches: Matrix, to_earth: np.ndarray, place: Mapping[int, int]) -> coo_matrix:
    """Return the admittance matrix of the branches in service [pu]."""
    closed = branches[:, 10] != 0
    branches, to_earth = branches[closed], to_earth[closed]
    start, end = (np.array([place[int(n)] for n in branches[:, k]], dtype=int) for k in (0, 1))
    y = 1 / (branches[:, 2] + 1j * branches[:, 3])
    size = np.where(branches[:, 8] == 0, 1.0, branches[:, 8])
    ratio = size * np.exp(1j * np.radians(branches[:, 9]))
    entries = [
        (start, start, (y + to_earth[:, 0]) / size**2),
        (start, end, -y / ratio.conj()),
        (end, start, -y / ratio),
        (end, end, y + to_earth[:, 1]),
    ]
    row, column, value = (np.concatenate(parts) for parts in zip(*entries, strict=True))
    return coo_matrix((value, (row, column)), shape=(len(place), len(place))).tocsr()
