"""Modes and steady state of systems with sampled controllers, over the period after which they repeat.

Each state is perturbed, and the whole system is run for a period: delays and held values are in its map as they are.
The multiplier μ of a mode over a period T gives λ = ln μ/T, but for a multiple of 2π/T in its frequency. The mode's
own motion during the period tells which multiple it is (Floquet's theorem)."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from orchestrator.core.arrays import Matrix
from orchestrator.core.errors import AnalysisError
from orchestrator.linear.models.blocks import Blocks
from orchestrator.linear.models.coupled_state import CoupledState
from orchestrator.linear.models.linear_model import DELAYED, HELD, LinearModel
from orchestrator.linear.models.linearization import compose
from orchestrator.linear.models.sampled import steps_of_period
from orchestrator.systems.coupling.master import Master
from orchestrator.systems.coupling.schedule import Schedule, gauss_seidel

_SIZE = 1e-6  # of a perturbation, relative to the state's scale
# at a perturbed system in a period: modes up to 20 times the period's frequency are told
_LOOKS = 40
_ALIVE = 1e-4  # multipliers over a period below this belong to what decays within it
# largest imaginary part of the map that is put together from its modes again, relative to the map
_REAL = 1e-6
# a state that changes by more than this part of its scale in a period may count
_MOVING = 1e-4
# part of its scale to which a period from the changed value must then be the same, in all states
_SAME = 1e-9

_SHIFT = (
    1e-7  # above the rounding in an eigenvalue 1, as in `orchestrator.linear.models.steady_state`
)

Complex = NDArray[np.complex128]
Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class PeriodicPoint:
    """A state that repeats after a period."""

    # of all states; outputs that are held over a step follow those of the components
    names: tuple[str, ...]
    x: Matrix  # values of all states, shape (n,)
    # of all states over a period, relative to their scale, 0 for those that count, shape (n,)
    change: Matrix
    first: float  # the largest one at the start
    iterations: int  # of Newton's method
    # whether a state grows by the same in each period without any effect, such as a clock, or an angle by whole turns,
    # shape (n,)
    counting: Mask

    @property
    def residual(self) -> float:
        return _largest(self.change)


def model_of(master: Master, blocks: Blocks) -> LinearModel:
    """The step map of a system, or that over the period after which it repeats."""
    return compose(blocks, master.schedule) if blocks.period == 1 else period_model(master, blocks)


def period_model(master: Master, blocks: Blocks) -> LinearModel:
    """A map per communication step whose power over the whole period is that of the running system."""
    names, scale = _names_and_scales(blocks, master.schedule)
    maps = _Period(master, blocks.period, names, scale).maps()
    per_step = _per_step(maps, blocks.period)
    made = LinearModel.from_matrix(per_step, names, blocks.step_size, blocks.disagreement)
    return replace(made, sources=blocks.how, period=blocks.period)


def _names_and_scales(blocks: Blocks, schedule: Schedule) -> tuple[tuple[str, ...], Matrix]:
    """All states, held outputs among them, and what is 1 to each: at least 1, or what a change of another one by 1 does
    to it in one step."""
    model = compose(blocks, schedule, within_period=True)
    delayed = [name for name in model.names if DELAYED in name]
    if delayed:
        raise AnalysisError(
            f"sampled controllers that repeat after {blocks.period} communication steps have modes only where nothing "
            f"is on its way between components; here {delayed[0]} is: leave the delays of connections out"
        )
    scales: Matrix = np.maximum(1.0, np.abs(model.A).max(axis=1, initial=0.0))
    return tuple(model.names), scales


class _Period:
    """Runs a system over a period from states beside the present one; it is put back each time."""

    def __init__(self, master: Master, steps: int, names: tuple[str, ...], scale: Matrix) -> None:
        self._master, self._steps, self._state = master, steps, CoupledState(master)
        held = [name.removesuffix(HELD) for name in names if name.endswith(HELD)]
        self._held = [master.output_names.index(name) for name in held]
        self._first_held = len(names) - len(held)
        self.x = self._read()
        self.scale = np.maximum(scale, np.abs(self.x))
        looks = min(_LOOKS, steps)
        ends = np.unique(np.round(np.linspace(0, steps, looks + 1)).astype(int))
        self._parts = np.diff(ends)

    def _read(self) -> Matrix:
        return np.concatenate([self._state.read(), self._master.y[self._held]])

    def _write(self, x: Matrix) -> None:
        """Set all states; an output that is held keeps what it is given, though other outputs follow the states."""
        self._state.write(x[: self._first_held])
        self._master.y[self._held] = x[self._first_held :]

    def change(self, x: Matrix) -> Matrix:
        """Change of all states over a period from ``x``, shape (n,)."""
        return self._run(x, [self._steps])[-1] - x

    def _run(self, x: Matrix, parts: list[int]) -> list[Matrix]:
        found = []
        with self._state.put_back():
            self._write(x)
            for part in parts:
                self._master.advance(part)
                found.append(self._read())
        return found

    def take(self, x: Matrix) -> None:
        self._write(x)
        self.x = x

    def maps(self) -> NDArray[np.float64]:
        """From the period's begin to each of the times at which it is looked, shape (times, n, n)."""
        parts = [int(part) for part in self._parts]
        maps = np.empty((len(parts), len(self.x), len(self.x)))
        for k, scale in enumerate(self.scale):
            size = _SIZE * scale
            sides = []
            for sign in (1, -1):
                x = self.x.copy()
                x[k] += sign * size
                sides.append(np.array(self._run(x, parts)))
            maps[:, :, k] = (sides[0] - sides[1]) / (2 * size)
        return maps


def _per_step(maps: NDArray[np.float64], steps: int) -> Matrix:
    """The map per step with the same modes: of each multiplier that root which turns as the mode does."""
    values, left, right = scipy.linalg.eig(maps[-1], left=True, right=True)
    alive = np.abs(values) > _ALIVE
    values, left, right = values[alive], left[:, alive], right[:, alive]
    # so that leftᴴ·right is the identity
    left = left @ np.linalg.inv(left.conj().T @ right).conj().T
    exponents = np.log(values.astype(complex))
    exponents = exponents + 2j * np.pi * _turns(right, left, exponents, maps)
    made = (right * np.exp(exponents / steps)) @ left.conj().T
    if not np.abs(made.imag).max(initial=0.0) <= _REAL * np.abs(made).max(initial=1.0):
        raise AnalysisError(
            "two modes over the period of the sampled controllers coincide, or one turns by half a turn in it, so that "
            "they cannot be told apart; `gfor run` shows how the system answers"
        )
    return np.asarray(made.real)


def _turns(right: Complex, left: Complex, exponents: Complex, maps: NDArray[np.float64]) -> Matrix:
    """Whole turns that each mode makes during a period, beside the angle of its multiplier, shape (modes,).

    A mode's motion is e^(λt)·p(t) with a periodic p. Its turns are those of p's largest harmonic; each state counts
    with its weight in the left eigenvector."""
    looks = len(maps)
    shares = np.arange(looks) / looks
    motions = (
        np.stack([right, *(A @ right for A in maps[:-1])])
        * np.exp(-np.multiply.outer(shares, exponents))[:, None, :]
    )
    content = np.einsum("kim,im->km", np.abs(np.fft.fft(motions, axis=0)), np.abs(left))
    turns = content.argmax(axis=0)
    turns = np.where(turns > looks // 2, turns - looks, turns)
    swinging = np.abs(exponents.imag) > _REAL
    # a real multiplier of a real system has no partner to turn the other way
    turns = np.where(swinging, turns, 0)
    for k in np.flatnonzero(exponents.imag > _REAL):  # rounding must not tell conjugate modes apart
        partner = int(np.argmin(np.abs(exponents - exponents[k].conjugate())))
        turns[partner] = -turns[k]
    return turns


def find_periodic_point(master: Master, accept: float, most: int) -> PeriodicPoint:
    """A state from which the system repeats after a period, by Newton's method on the map of a period."""
    schedule = gauss_seidel(master.schedule.groups)
    blocks = Blocks(master, schedule=schedule)
    steps = steps_of_period(master, master.clock.step_size)
    names, scale = _names_and_scales(blocks, schedule)
    period = _Period(master, steps, names, scale)
    x = period.x
    change, counting = _without_counts(period, x)
    first = _largest(change)
    correction: Callable[[Matrix], Matrix] | None = None
    iterations = 0
    while _largest(change) > accept and iterations < most:
        correction = correction or _correction(period, counting)
        candidate = x + correction(change * period.scale)
        new, counts = _without_counts(period, candidate)
        if not _largest(new) < 0.9 * _largest(change):
            break
        x, change, counting, iterations = candidate, new, counts, iterations + 1
    period.take(x)
    return PeriodicPoint(names, x, change, first, iterations, counting)


def _without_counts(period: _Period, x: Matrix) -> tuple[Matrix, Mask]:
    """The change over a period relative to the states' scales, 0 where a state counts; and which these are."""
    change = period.change(x)
    counting = np.zeros(len(x), dtype=bool)
    for k in np.flatnonzero(np.abs(change) > _MOVING * period.scale):
        moved = x.copy()
        moved[k] += change[k]
        counting[k] = bool(
            (
                np.abs(period.change(moved) - change)
                <= _SAME * np.maximum(period.scale, np.abs(moved))
            ).all()
        )
    return np.where(counting, 0.0, change / period.scale), counting


def _correction(period: _Period, counting: Mask) -> Callable[[Matrix], Matrix]:
    """Return what solves (I − A)·dx = change, and leaves alone what counts."""
    free = np.flatnonzero(~counting)
    A = period.maps()[-1][np.ix_(free, free)]
    d = period.scale[free]
    factors = scipy.linalg.lu_factor((1 + _SHIFT) * np.eye(len(free)) - A * d / d[:, None])

    def solve(change: Matrix) -> Matrix:
        found = np.zeros(len(change))
        found[free] = d * scipy.linalg.lu_solve(factors, change[free] / d)
        return found

    return solve


def _largest(change: Matrix) -> float:
    return float(np.abs(change).max(initial=0.0))
