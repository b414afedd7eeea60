"""The verdict on the stability of a coupled system over its whole spectrum, with the growing modes and the cause.

The step map is what a simulation runs, the continuous model is the system itself. Both are judged: a coupling may
destabilise a stable system, and a long communication step may damp a mode that grows in the system."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from itertools import zip_longest
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestrator.core.errors import few
from orchestrator.core.options import Option
from orchestrator.core.truth import NoTruth
from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.linear.spectra.critical_modes import nearest_pairs
from orchestrator.linear.spectra.growth_search import find_growing_modes
from orchestrator.linear.spectra.modes import (
    LOCAL_HZ,
    ZERO,
    Mode,
    Spectrum,
    damping_percent,
    damping_ratio,
    eigenvalues,
    find_spectrum,
    index_of_rightmost,
    make_mode,
    oscillations,
)
from orchestrator.linear.spectra.slowest_decay import Decay
from orchestrator.linear.spectra.zero_space import ZeroSpace, zero_space

# up to so many states, all eigenvalues are computed; in larger systems growing ones are searched
# for
WHOLE = 4000
# A real part above this [1/s], and above 1e-8 of the eigenvalue's size, is growth and not rounding
_GROWING = 1e-6

SLOW = 0.05
"""Eigenvalues of a step map up to this size [rad/s] are judged by the continuous model if there is one. No usual step
moves them. The step map has larger errors here: an error of the perturbation is divided by the step, and a double zero
splits by the root of the error."""

# the coupling is the cause of growth if the step map's rate exceeds the continuous system's rate
# times this factor, plus the rate below
_COUPLING_FACTOR = 2.0
_COUPLING_RATE = 1.0  # [1/s]

# up to this number of states, all eigenvectors cost less than a search for one
_DENSE_VECTORS = 200
_STATES_NAMED = 3
_STATES_KEPT = 6  # in JSON, those that take part most
_SWINGS_SHOWN = 3
_NEAR_RATED = 0.02
"""Part of the rated frequency by which a mode may be off it and be of direct currents: in the network's frame, which
turns with that frequency, they swing with it."""


class Cause(StrEnum):
    SYSTEM = "system"
    COUPLING = "coupling"
    UNKNOWN = "not known"


@dataclass(frozen=True)
class Hidden:
    """Oscillatory modes outside of a frequency range [Hz]: how many, the least damped of them, those of which it is
    known that generators swing in them [rad/s], and the rated frequency of the network [Hz], None where not known."""

    frequency_range: tuple[float, float]
    count: int
    least_damped: complex | None
    electromechanical: tuple[complex, ...] = ()
    rated_hz: float | None = None
    who: tuple[str, ...] = ()  # the components that take part most in each of those

    def sentence(self, *, remedy: bool = True) -> str:
        low, high = self.frequency_range
        words = "oscillatory mode lies" if self.count == 1 else "oscillatory modes lie"
        text = f"{self.count} {words} outside {low:g} to {high:g} Hz"
        if self.least_damped is None:
            return text
        text += f"; the least damped of them: {self._hertz:.4g} Hz, {self._percent:.2f} %"
        if self._is_of_direct_currents:
            text += ", near the rated frequency, where direct currents of the network die away: no swing of machines"
        if not self.electromechanical:
            return text
        shown = [
            f"{z.imag / (2 * np.pi):.3f} Hz, {damping_percent(z):.2f} %{f' ({who})' * bool(who)}"
            for z, who in zip_longest(self.electromechanical, self.who)
        ]
        text += f"; electromechanical: {few(shown, _SWINGS_SHOWN, '; ')}"
        return (f"{text}: show them by " + Option.RANGE + f" {self.wide}") if remedy else text

    @property
    def wide(self) -> str:
        """The range [Hz], as it is typed, that holds all swings of generators as well."""
        low, high = self.frequency_range
        if not self.electromechanical:
            return f"{low:g}:{high:g}"
        highest = max(z.imag for z in self.electromechanical) / (2 * np.pi)
        above = LOCAL_HZ if highest <= LOCAL_HZ else np.ceil(10 * highest) / 10
        return f"{min(low, self._lowest_swing):.2g}:{above if highest > high else high:g}"

    @property
    def least_swing(self) -> complex | None:
        """The least damped mode [rad/s] in which generators swing; None where none is known."""
        return min(self.electromechanical, key=damping_percent, default=None)

    def as_json(self) -> dict[str, Any]:
        """The number and the least damped of the hidden modes as JSON's types."""
        known = self.least_damped is not None
        least = {"frequency_hz": self._hertz, "damping_percent": self._percent} if known else None
        swings = [
            {"frequency_hz": z.imag / (2 * np.pi), "damping_percent": damping_percent(z)}
            for z in self.electromechanical
        ]
        return {
            "range_hz": list(self.frequency_range),
            "oscillatory_modes": self.count,
            "least_damped": least,
            "electromechanical": swings,
        }

    @property
    def _is_of_direct_currents(self) -> bool:
        """Return whether the least damped mode is one of the network at its rated frequency."""
        least = self.least_damped
        return least not in self.electromechanical and _is_of_direct_currents(least, self.rated_hz)

    @property
    def _lowest_swing(self) -> float:
        return float(min(z.imag for z in self.electromechanical) / (2 * np.pi))

    @property
    def _hertz(self) -> float:
        return 0.0 if self.least_damped is None else self.least_damped.imag / (2 * np.pi)

    @property
    def _percent(self) -> float:
        return 0.0 if self.least_damped is None else damping_percent(self.least_damped)


def _is_of_direct_currents(value: complex | None, rated_hz: float | None) -> bool:
    """Return whether an eigenvalue [rad/s] is of the network near its rated frequency [Hz], and does not grow."""
    if value is None or rated_hz is None or damping_percent(value) < 0:
        return False
    return abs(value.imag / (2 * np.pi) - rated_hz) <= _NEAR_RATED * rated_hz


@dataclass(frozen=True)
class Stability(NoTruth):
    """The verdict on a system, and what it rests on.

    Attributes
    ----------
    stable
        Whether no mode grows; None if this is not known.
    mode
        The mode of the largest real part.
    growing
        Number of growing modes; a conjugate pair counts once.
    zeros
        Eigenvalues taken for zero, such as that of the free angle; not those of states that nothing moves.
    eigenvalues
        Number of all eigenvalues.
    cause
        Why a mode grows: the system, the coupling, or not known; None if no mode grows.
    continuous_growth_rate
        Largest real part of the system without a communication step [1/s]; None where a component gives no derivatives.
    step_size
        Communication step [s]; None of a continuous model.
    reason
        Why the verdict is not known, or which region was not searched.
    common_speed
        The machines' speeds where what grows fastest is the drift of all of them alike; none otherwise.
    of_zeros
        States that take part most where several eigenvalues are zero; none where no component gives derivatives.
    hidden_by_step
        The communication step [s] with which nothing grows, though the system grows without one; None elsewhere.
    rated_hz
        The rated frequency of the network [Hz]; None where it is not known.

    Examples
    --------
    >>> import orchestrator as gfor
    >>> verdict = gfor.load("two_area").scenario("base").modes().stability
    >>> verdict.stable, verdict.growing
    (False, 1)
    """

    stable: bool | None  # whether no mode grows; None if this is not known
    # the mode of the largest real part: of the step map, or of the continuous system if only this one grows
    mode: Mode | None = None
    growing: int = 0  # number of growing modes of the same model; a conjugate pair counts once
    # eigenvalues taken for zero (`orchestrator.linear.spectra.modes.ZERO`), those of states that nothing
    # moves left out: the free angle
    zeros: int = 0
    eigenvalues: int = 0
    cause: Cause | None = None  # the cause of growth; None if no mode grows
    # largest real part [1/s] of the continuous system; None where a component gives no derivatives
    continuous_growth_rate: float | None = None
    step_size: float | None = None  # communication step [s]; None for a continuous model
    reason: str = ""  # why the verdict is not known, or the region that was not searched
    common_speed: tuple[str, ...] = ()  # the machines' speeds where they drift alike
    of_zeros: tuple[str, ...] = ()  # states that take part most in several zeros
    hidden_by_step: float | None = None  # step [s] with which nothing grows, though the system does
    rated_hz: float | None = None  # rated frequency of the network [Hz]

    @property
    def only_common_speed(self) -> bool:
        """Return whether the drift of the common speed is all that grows, so that every swing is damped."""
        return bool(self.common_speed) and self.growing == 1

    @property
    def largest_growth_rate(self) -> float | None:
        """Largest real part [1/s] of the whole spectrum, zeros left out."""
        return None if self.mode is None else self.mode.eigenvalue.real

    @property
    def participation(self) -> tuple[tuple[str, float], ...]:
        """State and participation factor in the mode, the largest first.

        In the drift of the common speed these are the machines' speeds alone: all angles and network states follow
        them, and their factors, of a mode close to that of the free angle, tell of no cause."""
        if self.mode is None:
            return ()
        told = self.mode.participation
        if self.common_speed:
            return tuple(one for one in told if one[0] in self.common_speed)
        return told

    def doubted(self, misfits: Iterable[str]) -> "Stability":
        """Not known to be stable where something does not fit between devices and bindings; growth stays growth."""
        what = "; ".join(misfits)
        return replace(self, stable=None, reason=what) if what and self.stable else self

    @property
    def verdict(self) -> str:
        """The verdict in one word or two: stable, UNSTABLE, not known."""
        return {True: "stable", False: "UNSTABLE", None: "not known"}[self.stable]

    def sentence(self) -> str:
        """The verdict, and the figures behind it."""
        return f"{self.verdict}: {self.because()}"

    def because(self) -> str:
        """The figures behind the verdict's word."""
        if self.mode is None or self.stable is None:
            told = self.reason or "there is no eigenvalue but zeros"
            return f"{told}; {zeros_in_words(self.zeros, self.of_zeros)}" if self.of_zeros else told
        tail = f"; {self.reason}" if self.reason else ""
        if self.zeros:
            tail += f"; {zeros_in_words(self.zeros, self.of_zeros)}"
        if self.stable:
            where = self._where(self.mode)
            largest = (
                f"the largest real part of all {self.eigenvalues} eigenvalues is {where}{tail}"
            )
            if not _is_of_direct_currents(self.mode.eigenvalue, self.rated_hz):
                return largest
            return f"direct currents of the network die away last, no swing of machines: {largest}"
        return f"{self.growth(self.mode)}; cause: {self._why()}{tail}"

    def growth(self, mode: Mode) -> str:
        """How fast a growing ``mode`` grows, who takes part in it, and how many modes grow."""
        more = f"; {self.growing} modes grow" if self.growing > 1 else ""
        if not self.common_speed:
            return f"a mode grows at {self._where(mode)}{more}"
        swings = "every swing is damped, and " if self.only_common_speed else ""
        speeds = few(self.common_speed, _STATES_NAMED)
        return f"{swings}the common speed drifts at {mode.eigenvalue.real:+.4g} 1/s without a governor ({speeds}){more}"

    def _where(self, mode: Mode) -> str:
        states = ", ".join(
            f"{name} {factor:.2f}" for name, factor in mode.participation[:_STATES_NAMED]
        )
        value = mode.eigenvalue
        return f"{value.real:+.4g} 1/s ({place(value, self.step_size)}; {states})"

    def _why(self) -> str:
        rate = self.continuous_growth_rate
        if self.cause is Cause.UNKNOWN:
            return "not known, as a component gives no derivatives"
        beside = "" if rate is None else f" (without a communication step: {rate:+.4g} 1/s)"
        return f"the {self.cause}{beside}"

    def as_json(self) -> dict[str, Any]:
        """Figures and sentence as JSON's types; rates in 1/s, frequencies in Hz."""
        mode = self.mode
        participation = [{"state": s, "factor": f} for s, f in self.participation[:_STATES_KEPT]]
        return {
            "stable": self.stable,
            "largest_growth_rate": self.largest_growth_rate,
            "frequency_hz": None if mode is None else mode.frequency_hz,
            "participation": participation,
            "growing_modes": self.growing,
            "common_speed": list(self.common_speed),
            "zero_eigenvalues": self.zeros,
            "eigenvalues": self.eigenvalues,
            "cause": None if self.cause is None else str(self.cause),
            "continuous_growth_rate": self.continuous_growth_rate,
            "reason": self.reason,
            "sentence": self.sentence(),
        }


def drift_in_words(rate: float) -> str:
    """Return what is said where the drift of the common speed is all that grows; ``rate`` in 1/s."""
    return f"swings damped; the common speed drifts ({rate:+.2g} 1/s, no governor)"


def zeros_in_words(zeros: int, states: Sequence[str] = ()) -> str:
    """Return what several zeros are, and the states in which they lie where these are known."""
    if zeros == 1:
        return "one eigenvalue is zero, taken for that of the free angle, and left out"
    text = f"{zeros} eigenvalues are zero, one of them may be the free angle: nothing restores the others"
    if not states:
        return text
    return (
        f"{text}, which lie in {few(states, _STATES_NAMED)}; where these are of regulators that hold one voltage "
        "without droop, what each of them feeds is undefined: give them a compensation of their currents, or a droop"
    )


def place(value: complex, step_size: float | None = None) -> str:
    """The frequency of an eigenvalue [rad/s] in words: ``37.4 Hz``, ``no oscillation``."""
    if not oscillations(np.array([value]))[0]:
        return "no oscillation"
    hertz = value.imag / (2 * np.pi)
    if step_size is not None and hertz > 0.25 / step_size:
        return f"{hertz:.4g} Hz, or an alias of it, as the step shows no more than {0.5 / step_size:.4g} Hz"
    return f"{hertz:.4g} Hz"


def whole_spectrum(model: LinearModel) -> Spectrum | None:
    """All eigenvalues with the rightmost mode, but no other mode; None for a system too large for that."""
    if len(model.names) > WHOLE:
        return None
    if len(model.names) <= _DENSE_VECTORS:
        return find_spectrum(model, np.inf, np.inf)
    return spectrum_of(model, eigenvalues(model))


def spectrum_of(model: LinearModel, values: NDArray[np.complex128]) -> Spectrum:
    """The spectrum of a large model whose eigenvalues [rad/s] are all known, with the rightmost mode alone."""
    k = index_of_rightmost(values)
    if k is None:
        return Spectrum(values, [], None)
    value, left, right = min(
        nearest_pairs(model, values[k], 2), key=lambda pair: abs(pair[0] - values[k])
    )
    return Spectrum(values, [], make_mode(value, left, right, model.names))


def grows(values: NDArray[np.complex128]) -> NDArray[np.bool_]:
    """Mask of the eigenvalues [rad/s] that grow, one of each pair, zeros left out."""
    size = np.abs(values)
    mask: NDArray[np.bool_] = (
        (values.real > np.maximum(_GROWING, 1e-8 * size)) & (size > ZERO) & (values.imag >= 0)
    )
    return mask


def fastest_growth(values: NDArray[np.complex128], *, step_map: bool) -> complex | None:
    """The fastest growing eigenvalue [rad/s]; None if no eigenvalue grows. Slow eigenvalues of a step map are left out
    (`SLOW`)."""
    growing = values[grows(values)]
    if step_map:
        growing = growing[np.abs(growing) > SLOW]
    return complex(growing[np.argmax(growing.real)]) if len(growing) else None


def hidden(values: NDArray[np.complex128], lowest_hz: float, highest_hz: float) -> Hidden:
    swinging = values[oscillations(values)]
    hertz = swinging.imag / (2 * np.pi)
    outside = swinging[(hertz < lowest_hz) | (hertz > highest_hz)]
    least = min(outside.tolist(), key=damping_ratio, default=None)
    return Hidden((lowest_hz, highest_hz), len(outside), least)


def judge(
    model: LinearModel,
    spectrum: Spectrum | None = None,
    system: LinearModel | None = None,
    of_system: Spectrum | Decay | None = None,
) -> Stability:
    """The verdict on a step map, or on a continuous model.

    ``spectrum``: all eigenvalues of the model where they are known already.
    ``system``: the continuous model of the same system; None where a component gives no derivatives.
    ``of_system``: all eigenvalues of ``system`` where they are known already, or that none of its modes grows."""
    spectrum = spectrum or whole_spectrum(model)
    own = _look_at(model, spectrum)
    if model.step_size is None:
        return own
    if system is None:
        return replace(own, cause=Cause.UNKNOWN) if own.stable is False else own
    if isinstance(of_system, Decay):
        if own.stable:
            return replace(
                own, continuous_growth_rate=of_system.rate, of_zeros=_where_zero(system, own.zeros)
            )
        of_system = None  # what grows is told beside the mode of the system, which is to be found
    continuous = _look_at(system, of_system or whole_spectrum(system))
    rate = continuous.largest_growth_rate
    if spectrum is None:  # its zeros are looked for in the continuous model alone
        own = replace(own, zeros=continuous.zeros)
    own = replace(own, of_zeros=continuous.of_zeros if own.zeros > 1 else ())
    if own.stable is False and continuous.stable is not None and _only_slow(spectrum, own):
        slow = f"eigenvalues of up to {SLOW:g} rad/s are those without a communication step"
        return replace(
            continuous, step_size=own.step_size, continuous_growth_rate=rate, reason=slow
        )
    if own.stable is False:
        return replace(own, cause=_cause(own, rate), continuous_growth_rate=rate)
    if continuous.stable is False:
        rate_of_map = own.largest_growth_rate
        seen = "" if rate_of_map is None else f", at most {rate_of_map:+.2g} 1/s"
        text = f"the communication step of {model.step_size:g} s hides it: nothing grows in the step map{seen}"
        return replace(
            continuous,
            continuous_growth_rate=rate,
            hidden_by_step=model.step_size,
            reason="; ".join(t for t in (own.reason, text) if t),
        )
    return replace(own, continuous_growth_rate=rate)


def _where_zero(model: LinearModel, zeros: int) -> tuple[str, ...]:
    """Return the states that take part most where several eigenvalues of a continuous model are zero."""
    return zero_space(model).states if zeros > 1 and model.step_size is None else ()


def _only_slow(spectrum: Spectrum | None, own: Stability) -> bool:
    """Return whether the only growing eigenvalues are those that the perturbation cannot distinguish from zero."""
    if spectrum is None:
        return own.mode is not None and own.growing == 1 and abs(own.mode.eigenvalue) <= SLOW
    return bool(np.all(np.abs(spectrum.eigenvalues[grows(spectrum.eigenvalues)]) <= SLOW))


def _cause(own: Stability, rate: float | None) -> Cause:
    """The cause of a step map's growth, by comparison with the largest real part [1/s] of the continuous system."""
    coupled, alone = own.largest_growth_rate or 0.0, rate or 0.0
    if alone <= _GROWING or coupled > _COUPLING_FACTOR * alone + _COUPLING_RATE:
        return Cause.COUPLING
    return Cause.SYSTEM


def _look_at(model: LinearModel, spectrum: Spectrum | None) -> Stability:
    """The verdict on one model alone."""
    if spectrum is None:
        search = find_growing_modes(model)
        mode = search.fastest
        n = len(model.names)
        resting = ZeroSpace(0, ()) if model.step_size else zero_space(model)
        return Stability(
            mode is None,
            mode,
            growing=len(search.eigenvalues),
            zeros=resting.count,
            of_zeros=resting.states,
            eigenvalues=n,
            cause=Cause.SYSTEM if mode else None,
            continuous_growth_rate=None,
            step_size=model.step_size,
            reason=f"too large for all {n} eigenvalues: the right half-plane was searched, {search.not_searched}",
        )
    growing = int(grows(spectrum.eigenvalues).sum())
    zeros = int((np.abs(spectrum.eigenvalues) <= ZERO).sum()) - len(model.unmoved)
    cause = Cause.SYSTEM if growing and model.step_size is None else None
    return Stability(
        growing == 0,
        spectrum.rightmost,
        growing=growing,
        zeros=zeros,
        of_zeros=_where_zero(model, zeros),
        eigenvalues=len(spectrum.eigenvalues),
        cause=cause,
        continuous_growth_rate=None,
        step_size=model.step_size,
    )
