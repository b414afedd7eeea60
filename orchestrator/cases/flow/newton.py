"""Newton's method for a power flow, in polar voltages, with a sparse Jacobian and a shortened step where a whole one
goes too far."""

import pickle
import warnings
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.linalg import MatrixRankWarning, spsolve

from orchestrator.cases.flow.equations import FlowEquations

CONVERGED = 1e-9  # largest mismatch of a bus [pu, 100 MVA] of a solution

_ITERATIONS = 30
_HALVINGS = 8
_POLISHING = 4
"""Most iterations after convergence: with the mismatch in extended precision they end at the nearest double, so that
the solution does not depend on where it was begun."""

LOWEST_VOLTAGE = 0.5
"""Magnitude [pu] of the lowest voltage of a solution. The equations have others, with collapsed voltages, at which no
network is run: at the end of one line from a source of 1 pu the usual solution is never below 0.5 pu."""

_LEAST_VOLTAGE = 0.01  # magnitude [pu] below which no step goes


@dataclass(frozen=True)
class NewtonResult:
    voltages: NDArray[np.complex128]  # complex bus voltages [pu]
    # whether the mismatch is below `CONVERGED`, and no voltage below `LOWEST_VOLTAGE`
    converged: bool
    # largest mismatch [pu, 100 MVA] before the first and after each iteration, and its bus
    history: tuple[tuple[float, str], ...]


_KEPT = 32
"""Solutions that are kept, the latest ones."""

_LARGEST_KEPT = 500
"""Buses of the largest network whose solution is kept: a larger one takes longer to compare."""

_solved: dict[bytes, NewtonResult] = {}


def solve_once(equations: FlowEquations) -> NewtonResult:
    """Solve equations that are equal to the last digit once, as `solve` does: a controller's gain moves no flow."""
    if len(equations.buses) > _LARGEST_KEPT:
        return solve(equations)
    key = pickle.dumps(equations)
    if key not in _solved:
        if len(_solved) >= _KEPT:
            _solved.clear()
        _solved[key] = solve(equations)
    found = _solved[key]
    return replace(found, voltages=found.voltages.copy())


def solve(equations: FlowEquations) -> NewtonResult:
    """Solve from the DC angles, or else from a flat start, or else from the voltages of the network without load, or
    else step by step from a network without load and generation; the first of these that converges."""
    failed: list[NewtonResult] = []
    for begin in (_with_dc_angles, _flat, _unloaded):
        found = _newton(equations, begin(equations))
        if found.converged:
            return found
        failed.append(found)
    share, grown = grow(equations)
    if grown is not None and share == 1:
        return grown
    return min(failed, key=lambda result: result.history[-1][0])


def solve_from(equations: FlowEquations, voltages: NDArray[np.complex128]) -> NewtonResult:
    """Solve from voltages that are near the solution, such as those of almost the same equations."""
    angles = voltages / np.abs(voltages)
    return _newton(equations, np.where(equations.held, equations.magnitudes * angles, voltages))


def grow(equations: FlowEquations) -> tuple[float, NewtonResult | None]:
    """The largest share of all given powers, loads and units alike, with a solution that is reached from no power at
    all, and this solution; (0, None) where there is none without power."""
    empty = scaled(equations, 0.0)
    found = _newton(empty, _flat(equations))
    if not found.converged:
        found = _newton(empty, _unloaded(equations))
    if not found.converged:
        return 0.0, None
    share = 0.0
    step = 0.25
    while step > 0.002 and share < 1:
        wanted = min(1.0, share + step)
        further = _newton(scaled(equations, wanted), found.voltages)
        if further.converged:
            share, found = wanted, further
        else:
            step /= 2
    return share, found


def scaled(equations: FlowEquations, share: float) -> FlowEquations:
    return replace(
        equations,
        fed=share * equations.fed,
        drawn_as_current=share * equations.drawn_as_current,
        drawn_as_impedance=share * equations.drawn_as_impedance,
    )


def _start(equations: FlowEquations, angles: NDArray[np.float64]) -> NDArray[np.complex128]:
    usable = angles if np.isfinite(angles).all() else np.zeros(len(angles))
    start: NDArray[np.complex128] = equations.magnitudes * np.exp(1j * usable)
    return start


def _with_dc_angles(equations: FlowEquations) -> NDArray[np.complex128]:
    return _start(equations, equations.dc_angles())


def _flat(equations: FlowEquations) -> NDArray[np.complex128]:
    return _start(equations, np.zeros(len(equations.buses)))


def _unloaded(equations: FlowEquations) -> NDArray[np.complex128]:
    """Return the voltages that the held ones, at their DC angles, give elsewhere without any current drawn.

    They have the ratios and shifts of all transformers, which near reactances of 0 no step of Newton's finds."""
    voltages = _with_dc_angles(equations)
    free = np.flatnonzero(~equations.held)
    held = np.flatnonzero(equations.held)
    if not len(free):
        return voltages
    rows = equations.matrix.tocsr()[free]
    drawn = -rows[:, held] @ voltages[held]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", MatrixRankWarning)
        found = np.atleast_1d(spsolve(rows[:, free].tocsc(), drawn))
    if np.isfinite(found).all() and (np.abs(found) > _LEAST_VOLTAGE).all():
        voltages[free] = found
    return voltages


def _newton(equations: FlowEquations, start: NDArray[np.complex128]) -> NewtonResult:
    angle, magnitude = np.angle(start), np.abs(start)
    mismatch = equations.mismatch(start)
    history = [_largest(equations, mismatch)]
    for _ in range(_ITERATIONS):
        if history[-1][0] <= CONVERGED:
            return _polished(equations, angle, magnitude, history)
        step = _newton_step(equations, angle, magnitude, mismatch)
        if step is None:
            break
        norm, length = np.linalg.norm(mismatch), 1.0
        for _ in range(_HALVINGS):
            trial = _take_step(equations, angle, magnitude, length * step)
            left = equations.mismatch(_voltages(*trial))
            if (
                np.isfinite(left).all()
                and trial[1].min() > _LEAST_VOLTAGE
                and np.linalg.norm(left) < norm
            ):
                break
            length /= 2
        else:
            break
        (angle, magnitude), mismatch = trial, left
        history.append(_largest(equations, mismatch))
    converged = history[-1][0] <= CONVERGED
    if converged:
        return _polished(equations, angle, magnitude, history)
    return NewtonResult(_voltages(angle, magnitude), False, tuple((m, bus) for m, bus in history))


def _polished(
    equations: FlowEquations,
    angle: np.ndarray,
    magnitude: np.ndarray,
    history: list[tuple[float, str]],
) -> NewtonResult:
    """The solution as exact as it gets."""
    angle, magnitude = angle.astype(np.longdouble), magnitude.astype(np.longdouble)
    mismatch = equations.mismatch(_voltages(angle, magnitude))
    for _ in range(_POLISHING):
        step = _newton_step(equations, angle, magnitude, mismatch)
        if step is None:
            break
        trial = _take_step(equations, angle, magnitude, step)
        left = equations.mismatch(_voltages(*trial))
        if not np.abs(left).max(initial=0) < np.abs(mismatch).max(initial=0):
            break
        (angle, magnitude), mismatch = trial, left
    voltages = _voltages(angle, magnitude).astype(np.complex128)
    return NewtonResult(voltages, bool(np.abs(voltages).min() >= LOWEST_VOLTAGE), tuple(history))


def _newton_step(
    equations: FlowEquations, angle: np.ndarray, magnitude: np.ndarray, mismatch: np.ndarray
) -> NDArray[np.float64] | None:
    """Steps of the angles and the magnitudes; None where the Jacobian is singular."""
    if not len(mismatch):
        return None
    jacobian = equations.jacobian(_voltages(angle, magnitude).astype(np.complex128))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", MatrixRankWarning)
        step: NDArray[np.float64] = np.atleast_1d(spsolve(jacobian, -mismatch.astype(np.float64)))
    return step if np.isfinite(step).all() else None


def _take_step(
    equations: FlowEquations, angle: np.ndarray, magnitude: np.ndarray, step: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    angle, magnitude, count = angle.copy(), magnitude.copy(), len(equations.angle_buses)
    angle[equations.angle_buses] += step[:count]
    magnitude[equations.free_buses] += step[count:]
    return angle, magnitude


def _voltages(angle: np.ndarray, magnitude: np.ndarray) -> np.ndarray:
    voltages: np.ndarray = magnitude * (np.cos(angle) + 1j * np.sin(angle))
    return voltages


def _largest(equations: FlowEquations, mismatch: np.ndarray) -> tuple[float, str]:
    if not len(mismatch):
        return 0.0, equations.buses[equations.slack]
    bus, size = equations.worst(mismatch)
    return size, bus
