"""Examination of a linear model's verdict: comparison with the FMUs, their perturbation and the communication step.

Every command that linearises uses this examination, and so all of them give the same warnings.

Inputs are held over a communication step. This delays every coupling by half a step or more and moves the modes, in
proportion to the step; with one that is far too long, the step map's modes have no relation to the system. The
continuous system, from the components' own derivatives, has the true modes."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.sparse.linalg as spla
from numpy.typing import NDArray

from orchestrator.core.errors import CosimError, InputError
from orchestrator.core.options import Option, command
from orchestrator.linear.doubts.coupled_response import confirmed
from orchestrator.linear.doubts.linearity import Doubt, doubts, tell
from orchestrator.linear.doubts.slow_modes import tell_slow_modes
from orchestrator.linear.models.apart import standing_apart
from orchestrator.linear.models.delays import (
    LARGEST_ERROR,
    doubtful_delays,
    representation_error,
    too_long,
    warnings_of,
)
from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.linear.models.linearization import Blocks, compose
from orchestrator.linear.spectra.critical_modes import DENSE, nearest_eigenvalue
from orchestrator.linear.spectra.modes import (
    ELECTROMECHANICAL_HZ,
    Mode,
    Spectrum,
    damping_percent,
    eigenvalues,
    find_spectrum,
)
from orchestrator.linear.spectra.slowest_decay import Decay
from orchestrator.linear.spectra.stability import (
    WHOLE,
    Cause,
    Stability,
    judge,
    whole_spectrum,
    zeros_in_words,
)
from orchestrator.systems.coupling.master import Master

MOVED = 0.01  # part of its size by which a step may move a mode before a warning
LOST = 0.1  # part of its size from which on a moved mode is lost

SWINGING = 0.5  # largest damping ratio of a compared mode; a mode with more damping does not swing
SLOW_HZ = 5.0
"""Frequency below which a lost mode is an error [Hz]. A faster lost mode, which only a wide range shows, gives a
warning."""

_SLOWEST_HZ = 0.01
# the coupling is unstable if the step map grows faster than the continuous system by more [1/s]
_GROWTH = 1.0
# modes of a large system that are compared, least damped first: each costs a factorisation
_COMPARED = 6

_ADVISED = (
    5e-2,
    2e-2,
    1e-2,
    5e-3,
    2e-3,
    1e-3,
    5e-4,
    2e-4,
    1e-4,
    5e-5,
    2e-5,
    1e-5,
    5e-6,
    2e-6,
    1e-6,
)
"""Steps [s] that are tried to advise a shorter one, longest first, and the largest number of tried steps."""
_TRIALS = 9


@dataclass(frozen=True)
class Pair:
    """One mode in the step map and in the continuous system [rad/s]."""

    seen: complex
    exact: complex

    @property
    def error(self) -> float:
        """Distance by which the step moves the mode, as a part of its size."""
        return abs(self.seen - self.exact) / abs(self.exact)

    @property
    def is_lost(self) -> bool:
        """Return whether the step map's mode has no relation to the true one: it is far away, or on the other side of
        stability."""
        return self.error > LOST or (self.error > MOVED and self.seen.real * self.exact.real < 0)


def check_resolution(
    master: Master,
    model: LinearModel,
    system: LinearModel | None,
    modes: Sequence[Mode],
    frequency_range: tuple[float, float],
    stability: Stability,
    *,
    of_model: Spectrum | None = None,
    of_system: Spectrum | None = None,
) -> tuple[str, ...]:
    """Warn of an unstable coupling, and compare the modes of a step map with those of the continuous system.

    The warnings name a step that is short enough; it is computed, not estimated. Without a continuous model nothing is
    compared. Raises `InputError` if a slow mode is lost, because the mode in its place would give a wrong verdict.

    ``stability``: Where the coupling is unstable, a step at which it is stable is looked for even if the modes are
    resolved.
    ``of_model``, ``of_system``: All eigenvalues of both models, where they are known already."""
    said = verdict_warnings(stability)
    if model.step_size is None or system is None:
        return said
    pairs = _pairs(
        _Eigenvalues(model, of_model), _Eigenvalues(system, of_system), modes, frequency_range
    )
    return (*said, *_step_warnings(master, model.step_size, system, pairs, stability))


def verdict_warnings(stability: Stability) -> tuple[str, ...]:
    """Warnings before a run: the coupling itself is unstable, or the FMUs do not confirm the verdict."""
    if stability.stable is None and stability.reason:
        return (f"whether the system is stable is not known: {stability.reason}",)
    rate, growth = stability.largest_growth_rate, stability.continuous_growth_rate
    several = stability.of_zeros
    zeros = (zeros_in_words(stability.zeros, several),) if several else ()
    if stability.cause is not Cause.COUPLING or growth is None:
        return zeros
    return (
        *zeros,
        f"the coupling is numerically unstable: with a communication step of {stability.step_size:g} s the step map "
        f"grows at {rate:.3g} 1/s where the continuous system has at most {growth:.3g} 1/s",
    )


def _step_warnings(
    master: Master, step: float, system: LinearModel, pairs: Sequence[Pair], stability: Stability
) -> tuple[str, ...]:
    """Warnings on the mode that a step [s] moves most, and on a coupling that is unstable at this step."""
    worst = max(pairs, key=lambda pair: (_is_slow(pair) and pair.is_lost, pair.error), default=None)
    moved = worst is not None and worst.error > MOVED
    if worst is None or not moved:
        return (
            (_advice(master, system, pairs, stability),)
            if stability.cause is Cause.COUPLING
            else ()
        )
    short = _short_step(master, system, pairs, stability)
    text = (
        f"the communication step of {step:g} s {'does not resolve' if worst.is_lost else 'moves'} a mode: the step map "
        f"has {_in_words(worst.seen)} where the system without a communication step has {_in_words(worst.exact)}"
    )
    if short is None:
        return (
            (
                f"{text}; no shorter step that was tried comes nearer, so that the "
                "derivatives which the components give disagree with their steps, or the "
                "coupling is unstable at all of them: compare with "
                + command("export linear", Option.CONTINUOUS)
            ),
        )
    if worst.is_lost and _is_slow(worst):
        raise InputError(f"{text}; " + _take(short))
    return (f"{text}; {_take(short)}",)


def _advice(
    master: Master, system: LinearModel, pairs: Sequence[Pair], stability: Stability
) -> str:
    short = _short_step(master, system, pairs, stability)
    if short is None:
        return "no shorter step that was tried has a stable coupling; see that the schedule has devices before the grid"
    return f"against the unstable coupling, {_take(short)}"


def _take(step: float) -> str:
    return (
        f"take a step of {step:g} s (`"
        + Option.STEP
        + f" {step:g}`, or the case's solver.step_size): there the coupling is stable "
        f"and no mode that was compared is moved by more than {100 * MOVED:g} %"
    )


def _in_words(value: complex) -> str:
    return f"{abs(value.imag) / (2 * np.pi):.4g} Hz with {damping_percent(value):.3g} % damping"


def _is_slow(pair: Pair) -> bool:
    return min(abs(pair.seen.imag), abs(pair.exact.imag)) < 2 * np.pi * SLOW_HZ


class _Eigenvalues:
    """The eigenvalues of a model [rad/s]: all, computed where they are not known, or the one nearest to a given one."""

    def __init__(self, model: LinearModel, known: Spectrum | None = None) -> None:
        self._model, self._known = model, known

    @property
    def are_few(self) -> bool:
        return len(self._model.names) <= DENSE

    @cached_property
    def all(self) -> NDArray[np.complex128]:
        return eigenvalues(self._model) if self._known is None else self._known.eigenvalues

    def nearest(self, wanted: complex) -> complex:
        if not self.are_few:
            return nearest_eigenvalue(self._model, wanted)
        return complex(self.all[np.argmin(np.abs(self.all - wanted))])


def _pairs(
    of_step: _Eigenvalues,
    of_system: _Eigenvalues,
    modes: Sequence[Mode],
    frequency_range: tuple[float, float],
) -> list[Pair]:
    """The oscillations of the step map, each paired with the nearest one of the continuous system; in a small system
    also the reverse pairs.

    The reverse pairs show modes that the step map has lost altogether."""
    low, high = max(frequency_range[0], _SLOWEST_HZ), frequency_range[1]
    seen = [mode.eigenvalue for mode in modes if _swings(mode.eigenvalue, low, high)]
    if not of_system.are_few:
        return [Pair(value, of_system.nearest(value)) for value in seen[:_COMPARED]]
    exact = [complex(value) for value in of_system.all if _swings(value, low, high)]
    return [Pair(value, of_system.nearest(value)) for value in seen] + [
        Pair(of_step.nearest(value), value) for value in exact
    ]


def _swings(value: complex, low: float, high: float) -> bool:
    return low <= value.imag / (2 * np.pi) <= high and -value.real <= SWINGING * abs(value)


def _short_step(
    master: Master, system: LinearModel, pairs: Sequence[Pair], stability: Stability
) -> float | None:
    """The longest step tried [s] that moves no mode and leaves the coupling stable; None if every step fails."""
    exact = list(dict.fromkeys(pair.exact for pair in pairs))
    if len(system.names) > WHOLE:  # too large for all eigenvalues; what grows has been searched
        fastest = stability.continuous_growth_rate or 0.0
    else:
        fastest = float(eigenvalues(system).real.max(initial=0.0))
    limit = max(0.0, fastest) + _GROWTH
    shorter = [step for step in _ADVISED if step <= 0.51 * master.clock.step_size]
    for step in shorter[:_TRIALS]:
        try:
            model = compose(Blocks(master, step), master.schedule)
        except CosimError:  # an FMU may refuse a step; others are left to try
            continue
        nearest = _Eigenvalues(model).nearest
        if (
            all(Pair(nearest(value), value).error <= MOVED for value in exact)
            and _growth(model) <= limit
        ):
            return step
    return None


def _growth(model: LinearModel) -> float:
    """Largest growth rate in a step map [1/s]; 0 if no mode stands out from the slow ones."""
    if model.step_size is None or len(model.names) <= DENSE:
        return float(eigenvalues(model).real.max())
    n = len(model.names)
    step = spla.LinearOperator((n, n), matvec=model.apply, dtype=float)
    start = np.random.default_rng(0).standard_normal(n)
    try:
        largest = spla.eigs(
            step, k=2, ncv=20, maxiter=50, tol=1e-6, v0=start, return_eigenvectors=False
        )
    except spla.ArpackNoConvergence:
        return 0.0
    return float(np.log(np.abs(largest).max()) / model.step_size)


@dataclass(frozen=True)
class Examination:
    stability: Stability
    warnings: tuple[str, ...]


def examine(
    master: Master,
    blocks: Blocks,
    model: LinearModel,
    system: LinearModel | None,
    *,
    spectrum: Spectrum | None = None,
    of_system: Spectrum | Decay | None = None,
    modes: Sequence[Mode] | None = None,
    shown: Sequence[Mode] | None = None,
    frequency_range: tuple[float, float] = ELECTROMECHANICAL_HZ,
) -> Examination:
    """Judge a step map, and look for what would make the verdict wrong; say what it leaves out of the connections.

    ``spectrum`` and ``of_system``: all eigenvalues of both models, where they are known already; of the continuous one,
    that none of its modes grows will do.
    ``modes``: oscillations that must not depend on the perturbation; by default those of the range. If a component is
    doubtful, all oscillations from 0.1 to 2 Hz are added.
    ``shown``: modes that must not depend on the communication step; by default the same."""
    if spectrum is None:
        small = len(model.names) <= WHOLE
        spectrum = (
            find_spectrum(model, *frequency_range)
            if small and modes is None
            else whole_spectrum(model)
        )
    if modes is None:
        modes = [] if spectrum is None else [mode for mode in spectrum.modes if mode.is_oscillation]
    elif (
        any(component.doubtful for component in blocks.components.values())
        and len(model.names) <= WHOLE
    ):
        modes = [*modes, *(mode for mode in find_spectrum(model).modes if mode.is_oscillation)]
    rightmost = (
        [spectrum.rightmost] if spectrum is not None and spectrum.rightmost is not None else []
    )
    stability = confirmed(master, blocks, model, judge(model, spectrum, system, of_system))
    if model.period > 1:
        told = (
            f"sampled controllers repeat after {model.period} communication steps "
            f"({model.period * master.clock.step_size:g} s): the modes are those of the map over this period"
        )
        apart = standing_apart(master, model, stability.zeros)
        return Examination(
            stability, (told, *verdict_warnings(stability), *apart, *warnings_of(master))
        )
    found = doubts(blocks, master.schedule, model, [*modes, *rightmost])
    shown = modes if shown is None else shown
    eigenvalues = [mode.eigenvalue for mode in [*shown, *rightmost]]
    links = blocks.links.values()
    long = too_long(links, frequency_range[1], model.step_size)
    wires = (
        *standing_apart(master, model, stability.zeros),
        *warnings_of(master),
        *long,
        *doubtful_delays(links, eigenvalues, model.step_size),
    )
    if long and not (stability.stable is False and _has_delays(blocks, model, rightmost)):
        stability = replace(stability, stable=None, reason="; ".join(long))
    turning = _turning(blocks, master, model, stability, found, rightmost)
    if turning:
        stability = replace(stability, stable=None, reason="; ".join(tell(turning)))
        found = [doubt for doubt in found if doubt not in turning]
        return Examination(stability, (*verdict_warnings(stability), *tell(found), *wires))
    step = check_resolution(
        master,
        model,
        system,
        shown,
        frequency_range,
        stability,
        of_model=spectrum,
        of_system=of_system if isinstance(of_system, Spectrum) else None,
    )
    slow = tell_slow_modes(model, system, shown)
    return Examination(stability, (*step, *slow, *tell(found), *wires))


def _has_delays(blocks: Blocks, model: LinearModel, modes: Sequence[Mode]) -> bool:
    return all(
        representation_error(link, mode.eigenvalue, model.step_size) <= LARGEST_ERROR
        for link in blocks.links.values()
        if link.delay
        for mode in modes
    )


def _turning(
    blocks: Blocks,
    master: Master,
    model: LinearModel,
    stability: Stability,
    found: list[Doubt],
    rightmost: list[Mode],
) -> list[Doubt]:
    """Doubts that leave the verdict open. If a mode grows, only doubts about this mode count."""
    turning = [doubt for doubt in found if doubt.turns]
    if not turning or stability.stable is None:
        return []
    if stability.stable is False:
        return [doubt for doubt in doubts(blocks, master.schedule, model, rightmost) if doubt.turns]
    return turning
