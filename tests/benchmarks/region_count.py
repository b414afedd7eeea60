"""How many eigenvalues lie in a region, from the turns of the determinant around it: no search is asked.

The determinant of a model with a hub is that of its blocks, which is cheap, times that of the dense rest. Each is
followed around the region on its own, with as many points as it needs.
"""

from collections.abc import Callable, Iterator
from functools import cache
from itertools import pairwise

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from orchestrator.linear.models.hub_elimination import DenseHub, HubFactors, hub_equations
from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.linear.spectra.shifted_equations import Factors

STEP = 0.7
"""Largest change of a logarithm between two points, and from one half of the way to the other."""


def count_within(
    model: LinearModel, lowest_hz: float, highest_hz: float, damping: float
) -> tuple[int, int]:
    """Number of eigenvalues with damping ratios from −0.1 to a given one, and of points at which all was factorised.

    Parameters
    ----------
    model
        Step map with a hub.
    lowest_hz, highest_hz
        Range of Im λ/2π [Hz].
    damping
        Largest damping ratio.
    """
    hub = hub_equations(model.F, model.G, model.H, model.K)
    assert hub is not None
    assert model.step_size is not None
    P, at_rest = hub.quadrants[0], sp.diags_array((hub.rest < hub.states).astype(float))

    @cache
    def of_blocks(point: complex) -> complex:
        lu = spla.splu(
            (P - np.exp(point * model.step_size) * at_rest).tocsc(), options={"Equil": False}
        )
        return Factors(lu, 0).log_determinant

    @cache
    def of_rest(point: complex) -> complex:
        factors = hub.at(np.exp(point * model.step_size))
        if factors is None:
            raise ArithmeticError(f"{point:.6g} rad/s is too close to an eigenvalue of a block")
        return _of_port(factors)

    line = list(_around(2 * np.pi * lowest_hz, 2 * np.pi * highest_hz, damping))
    turns = _turns(line, of_blocks) + _turns(line, of_rest)
    return turns, of_rest.cache_info().currsize


def _of_port(factors: HubFactors) -> complex:
    assert isinstance(factors.port, DenseHub)
    matrix, pivots = factors.port.lu
    swaps = int((pivots != np.arange(len(pivots))).sum()) % 2
    return complex(np.log(np.diag(matrix).astype(complex)).sum() + 1j * np.pi * swaps)


def _around(low: float, high: float, damping: float) -> Iterator[complex]:
    """Corners and points between, against the clock."""

    def at(ratio: float, omega: float) -> complex:
        return complex(-ratio / np.sqrt(1 - ratio**2) * omega, omega)

    rises, ratios = np.geomspace(low, high, 40), np.linspace(damping, -0.1, 5)
    yield from (at(ratio, low) for ratio in ratios)
    yield from (at(-0.1, omega) for omega in rises[1:])
    yield from (at(ratio, high) for ratio in ratios[::-1][1:])
    yield from (at(damping, omega) for omega in rises[::-1][1:])


def _turns(line: list[complex], logarithm: Callable[[complex], complex]) -> int:
    turn = 0.0
    for ends in pairwise(line):
        waiting = [ends]
        while waiting:
            a, b = waiting.pop()
            middle = (a + b) / 2
            first, second = (
                _wrapped(logarithm(y) - logarithm(x)) for x, y in ((a, middle), (middle, b))
            )
            if max(abs(first), abs(second)) <= STEP and abs(second - first) <= STEP:
                turn += (first + second).imag
            else:
                waiting += [(middle, b), (a, middle)]
    return round(turn / (2 * np.pi))


def _wrapped(change: complex) -> complex:
    return complex(change.real, (change.imag + np.pi) % (2 * np.pi) - np.pi)
