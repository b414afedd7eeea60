"""The solution that a RAW file holds, VM and VA: at which buses it fits the machines' reactive powers QG.

PSS/E solves with the limits of the machines' reactive power, and saves what came out: a machine at a limit has
QG = QT or QB and another VM than VS.  Its dynamics start from VM and QG.  If both fit, VM tells the machine's operating
point, and VS does not."""

import cmath
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix, diags_array
from scipy.sparse.linalg import spsolve

from orchestrator.core.arrays import Matrix

_VM = 7  # column of the voltage's magnitude [pu] in the table of buses
_VA = 8  # column of its angle [°]
_DIGITS = 16  # of a number, at most
_LEAST = 1.0  # reactive power that rounded voltages and a loose tolerance may leave at a bus [Mvar]
_PART = 0.02  # part of a bus' reactive power that they may leave


@dataclass(frozen=True, slots=True)
class ReactiveNeed:
    """Reactive power that machines must feed into a bus for the file's voltages, and what rounding moves [Mvar]."""

    mvar: float
    rounding_mvar: float = 0.0

    def fits(self, fed_mvar: float) -> bool:
        """Return whether the machines at the bus feed it."""
        most = max(_LEAST, _PART * abs(self.mvar), self.rounding_mvar)
        return abs(fed_mvar - self.mvar) <= most


def reactive_needs(
    rows: Mapping[int, Sequence[float]],
    branches: Sequence[Sequence[float]],
    to_earth: Sequence[tuple[complex, complex]],
    base_mva: float,
) -> dict[int, ReactiveNeed]:
    """Return the reactive power that machines must feed into each bus for the file's voltages.

    ``rows``, ``branches``: MATPOWER's tables of buses, by number, and of branches; ``to_earth``: admittances at both
    ends of each branch [pu of ``base_mva``].  A bus without a voltage is a star point, which feeds nothing.  Empty if
    the file is not solved, that is if all angles are 0."""
    table = np.array(list(rows.values()))
    if not len(branches) or not table[:, _VA].any():
        return {}
    place = {number: k for k, number in enumerate(rows)}
    matrix = _admittances(np.array(branches), np.array(to_earth), place)
    matrix += diags_array((table[:, 4] + 1j * table[:, 5]) / base_mva).tocsr()
    voltages = table[:, _VM] * np.exp(1j * np.radians(table[:, _VA]))
    inner, outer = np.flatnonzero(table[:, _VM] == 0), np.flatnonzero(table[:, _VM])
    if inner.size:
        drawn = -matrix[np.ix_(inner, outer)] @ voltages[outer]
        voltages[inner] = np.atleast_1d(spsolve(matrix[np.ix_(inner, inner)].tocsc(), drawn))
    needed = base_mva * (voltages * (matrix @ voltages).conj()).imag + table[:, 3]
    rounding = half_digit(table[:, _VM]) + math.radians(half_digit(table[:, _VA]))
    moved = base_mva * rounding * abs(voltages) * (abs(matrix) @ np.ones(len(table)))
    needs = map(ReactiveNeed, map(float, needed), map(float, moved))
    return dict(zip(rows, needs, strict=True))


def half_digit(values: np.ndarray) -> float:
    """Return half of the last digit to which numbers are given."""
    digits = range(_DIGITS - 1)
    found = (d for d in digits if not (np.round(values, d) - values).any())
    return 0.5 * 10.0 ** -next(found, _DIGITS - 1)


@dataclass(frozen=True, slots=True)
class HeldPower:
    """Reactive power QG of a machine, its limits QB and QT [Mvar], and VM - VS at its bus [pu]."""

    fed: float
    least: float
    most: float
    above: float


@dataclass(frozen=True)
class SolvedBuses:
    """Buses at which the file's voltages fit the machines' QG, and others at which they fit all limits on one side.

    A machine at its least reactive power leaves VM above VS, and one at its most below."""

    fitting: frozenset[int]
    at_limit: frozenset[int]

    @property
    def all(self) -> frozenset[int]:
        """Return the buses of both kinds."""
        return self.fitting | self.at_limit


def sort_buses(
    needed: Mapping[int, ReactiveNeed],
    fed_mvar: Mapping[int, float],
    machines: Mapping[int, Sequence[HeldPower]],
) -> SolvedBuses:
    """Sort the buses with machines or devices by what the file's voltages fit there.

    ``fed_mvar``: what devices feed, by bus."""
    fitting, at_limit = set[int](), set[int]()
    for bus in {*fed_mvar, *machines}:
        own, others = machines.get(bus, ()), fed_mvar.get(bus, 0.0)
        least = sum(x.least for x in own) + others
        most = sum(x.most for x in own) + others
        if needed[bus].fits(sum(x.fed for x in own) + others):
            fitting.add(bus)
        elif own and (
            (all(x.above > 0 for x in own) and needed[bus].fits(least))
            or (all(x.above < 0 for x in own) and needed[bus].fits(most))
        ):
            at_limit.add(bus)
    return SolvedBuses(frozenset(fitting), frozenset(at_limit))


def stated_voltages(rows: Sequence[Sequence[float]] | Matrix) -> dict[int, complex]:
    """Return the file's voltages [pu] by bus, from MATPOWER's table of buses; a star point has none."""
    return {int(row[0]): cmath.rect(row[7], math.radians(row[8])) for row in rows if row[7] > 0}


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
