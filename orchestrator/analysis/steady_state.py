"""The operating point: the fixed point of the coupled step map, verified and where needed solved for.

An unstable equilibrium can be solved for but never waited for, so nothing is simulated here beyond
single communication steps.
"""

from dataclasses import dataclass

import numpy as np

from orchestrator.analysis.coupled_state import CoupledState
from orchestrator.analysis.linearization import Blocks, compose
from orchestrator.arrays import Matrix
from orchestrator.coupling.master import Master
from orchestrator.coupling.schedule import gauss_seidel
from orchestrator.errors import AnalysisError

_SHIFT = 1e-7
"""Far above the rounding in a computed eigenvalue 1, and far below 1 − |μ| of the slowest mode."""

_SHORT = 1e-4
"""Over steps shorter than this [s] what may change is judged per second."""


@dataclass(frozen=True)
class OperatingPoint:
    """A steady state of the coupled system.

    Attributes
    ----------
    residual
        Largest change of any state over one communication step [the state's unit, mostly pu].
    drift
        The same per second.
    initial_residual
        What the power flow alone gave.
    iterations
        Newton iterations that were needed; 0 where the power flow's point already holds.
    states
        By name ``component.state``.
    """

    residual: float
    drift: float
    initial_residual: float
    iterations: int
    states: dict[str, float]


def find_operating_point(
    master: Master, tolerance: float = 1e-9, accept: float = 1e-12, max_iterations: int = 20
) -> OperatingPoint:
    """Verify that the initialised system stands still, or move it to where it does.

    Parameters
    ----------
    master
        Initialised; it is left at the operating point.
    tolerance
        Largest accepted change of a state over one communication step of 100 µs or more; over a shorter one,
        accordingly less.
    accept
        Below this nothing is solved for; between the two a better point is looked for and kept if it is one.
    max_iterations
        Of Newton's method on the step map.

    Raises
    ------
    AnalysisError
        If no fixed point is found; the message names the states that move most.
    """
    state = CoupledState(master)
    x = state.read()
    change = state.step_from(x) - x
    first = residual = _largest(change)
    iterations = 0
    while residual > accept and iterations < max_iterations:
        candidate = x + _newton_correction(master, len(x), change)
        state.write(candidate)
        new_change = state.step_from(candidate) - candidate
        if not _largest(new_change) < residual:
            state.write(x)
            break
        x, change, residual = candidate, new_change, _largest(new_change)
        iterations += 1
    names = [f"{name}.{s}" for name, c in master.components.items() for s in c.description.states]
    tolerance *= min(1.0, master.clock.step_size / _SHORT)  # however short the step is, the same drift counts
    if not residual <= tolerance:
        worst = ", ".join(f"{names[i]} ({change[i]:+.3g})" for i in np.argsort(-np.abs(change))[:3])
        raise AnalysisError(
            f"no steady state found: after {iterations} Newton iterations a communication step still changes "
            f"{worst}, more than {tolerance:g}; check that generation and load balance at rated frequency"
        )
    values = dict(zip(names, x.tolist(), strict=True))
    return OperatingPoint(residual, residual / master.clock.step_size, first, iterations, values)


def _largest(change: Matrix) -> float:
    return float(np.abs(change).max(initial=0.0))


def _newton_correction(master: Master, n: int, change: Matrix) -> Matrix:
    """Solve (I − A)·dx = change; what the exchange remembers follows from the states."""
    model = compose(Blocks(master), gauss_seidel(master.schedule.groups))
    right = np.zeros(len(model.names))
    right[:n] = change
    # A turn of all angles changes nothing, so I − A is singular. The shift keeps the solution from moving along it.
    solution: Matrix = -model.shifted(1 + _SHIFT).solve(right)[:n]
    return solution
