"""Implicit equations F(ẋ, x) = 0: their steady state and their linearisation, with NumPy and SciPy alone.

Components write their equations as a textbook prints them, one residual each, in any order; nothing is solved for
a derivative by hand. The Jacobians E = ∂F/∂ẋ and A = −∂F/∂x come from complex steps, so they are exact to rounding;
the modes are the finite eigenvalues of E·ẋ = A·x.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from scipy.linalg import eig

STEP = 1e-30
"""Size of the complex step: no difference is taken, so there is no rounding error to balance against."""

FINITE = 1e7
"""An eigenvalue above this belongs to an algebraic equation [1/s]; the fastest real one is of the order 1e4."""


class Unknowns:
    """Values and derivatives by name, as the equations read them; residuals in the order in which they are written.

    Parameters
    ----------
    names
        Of the unknowns.
    x, rate
        Values and time derivatives, of shape (n,), or (n, m) for m points at once.
    """

    def __init__(self, names: Iterable[str], x: np.ndarray, rate: np.ndarray) -> None:
        self._x = dict(zip(names, x, strict=True))
        self._rate = dict(zip(self._x, rate, strict=True))
        self._residuals: list[complex | np.ndarray] = []

    def __getitem__(self, name: str) -> complex:
        return self._x[name]

    def dot(self, name: str) -> complex:
        """Time derivative of an unknown [1/s]."""
        return self._rate[name]

    def equate(self, left: complex, right: complex) -> None:
        """One equation: both sides are equal."""
        self._residuals.append(left - right)

    def residuals(self) -> np.ndarray:
        """Of all equations so far."""
        return np.array(np.broadcast_arrays(*self._residuals))


Equations = Callable[[Unknowns], None]


@dataclass(frozen=True)
class Linearised:
    """E·ẋ = A·x around a steady state, with the names of the unknowns and the steady state itself."""

    E: np.ndarray
    A: np.ndarray
    names: tuple[str, ...]
    values: dict[str, float]

    def eigenvalues(self) -> np.ndarray:
        """The finite ones [1/s]."""
        above, below = eig(self.A, self.E, right=False, homogeneous_eigvals=True)
        finite = np.abs(above) < FINITE * np.abs(below)
        return above[finite] / below[finite]

    def oscillations(self, lowest_hz: float, highest_hz: float) -> np.ndarray:
        """Eigenvalues with a frequency Im λ/2π in the range, slowest first."""
        values = self.eigenvalues()
        hz = values.imag / (2 * np.pi)
        found = values[(hz >= lowest_hz) & (hz <= highest_hz)]
        return found[np.argsort(found.imag)]


def jacobian(function: Callable[[np.ndarray], np.ndarray], point: np.ndarray) -> np.ndarray:
    """∂f/∂x by complex steps: Im f(x + jh)/h, with no subtraction; every column is one of the points at once."""
    moved = point[:, None] + 1j * STEP * np.eye(len(point))
    return function(moved).imag / STEP


def steady_state(
    equations: Equations, conditions: Equations, start: dict[str, float]
) -> dict[str, float]:
    """Solve F(0, x) = 0 and the power flow's conditions together, by Newton's method.

    Parameters
    ----------
    equations
        Of the system; references (a voltage set-point, a mechanical power) are unknowns among ``start``.
    conditions
        As many as there are references: the powers and voltages that the power flow prescribes.
    start
        First guess of every unknown.
    """
    x = np.array(list(start.values()))

    def both(values: np.ndarray) -> np.ndarray:
        unknowns = Unknowns(start, values, np.zeros_like(values))
        equations(unknowns)
        conditions(unknowns)
        return unknowns.residuals()

    for _ in range(50):
        error = both(x)
        assert error.shape == x.shape, f"{len(error)} equations for {len(x)} unknowns"
        change = np.linalg.solve(jacobian(both, x), error)
        # no unknown by more than 0.5 pu at once
        x = x - change * min(1.0, 0.5 / np.abs(change).max(initial=1e-30))
        if np.abs(change).max() < 1e-13:
            return dict(zip(start, x.tolist(), strict=True))
    raise ArithmeticError(f"no steady state: the last change was {np.abs(change).max():.3g}")


def linearise(
    equations: Equations, references: tuple[str, ...], values: dict[str, float]
) -> Linearised:
    """E and A at a steady state; references are held, everything else moves."""
    moving = [k for k, name in enumerate(values) if name not in references]
    point, rest = np.array(list(values.values())), np.zeros(len(values))

    def residuals(x: np.ndarray, rate: np.ndarray) -> np.ndarray:
        unknowns = Unknowns(values, *np.broadcast_arrays(x, rate))
        equations(unknowns)
        return unknowns.residuals()

    E = jacobian(lambda rate: residuals(point[:, None], rate), rest)[:, moving]
    A = -jacobian(lambda x: residuals(x, rest[:, None]), point)[:, moving]
    return Linearised(E, A, tuple(name for name in values if name not in references), values)
