"""The best places confirmed: a device is put there as an FMU, and the coupled system's mode is compared."""

import cmath
import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.core.errors import AnalysisError, CosimError
from orchestrator.core.options import Option
from orchestrator.linear.models.component_linearization import ComponentLinearization
from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.linear.models.linearization import Blocks
from orchestrator.linear.models.periodic import model_of
from orchestrator.linear.models.steady_state import (
    OperatingPoint,
    begin_at,
    find_operating_point,
)
from orchestrator.linear.spectra.continuation import Eigenpair, pairs_near
from orchestrator.linear.spectra.modes import (
    Mode,
    damping_percent,
    damping_ratio,
    make_mode,
    oscillations,
)
from orchestrator.linear.spectra.stability import WHOLE
from orchestrator.studies.modes.modes import SPARSE_BELOW, ModesResult, modes_from, running
from orchestrator.studies.pod_design.closed_loop import Placed, PodLoop, PodSetting
from orchestrator.studies.pod_design.lead_lag import LARGEST_TURN, NO_COMPENSATION, lead_lag_turning
from orchestrator.studies.points.under_way import tell_doing
from orchestrator.studies.siting.least_damping import GROWS, LeastDamping
from orchestrator.studies.siting.placing import STAGES, name_at, response_of
from orchestrator.studies.siting.residues import SeenMode
from orchestrator.systems.coupling.master import Master

# A coupled shift that is farther than this part from the predicted one confirms nothing
AGREES = 0.05
_SMALL = 2e-3  # part of |λ| by which the trial gain moves the mode

_TURNS, _PARTS = (-30.0, 0.0, 30.0), (1 / 16, 1 / 8, 1 / 4, 1 / 2, 1.0)
"""Settings that are tried: turns beside the residue's angle [°], as the POD sees the frequency that it changes itself;
and parts of the largest gain."""

_EQUAL = 2e-4  # damping ratios in the same part of this size are equally good
_GIVEN_UP = 1e-3
"""Least damping ratio that is given up for more damping of the followed mode: a mode that moves by no more is one that
the controller does not move."""

_AS_STILL = 2.0
"""With a device that feeds nothing a system moves by at most this many times as much as without it: what is no more
than that needs no Newton step."""

_STILL = 1e-12  # and this change of a state over a communication step is none

_LEAST_SEARCHED = 0.01
"""Damping ratio below which modes are searched at least, also where the mode that is followed grows."""

# least similarity with which a mode of the system with the device is taken for the one without it
_SAME = 0.5
_BESIDE = 3
"""Swings outside of the range that are followed to the system with the device, the least damped: each is searched."""

_ONE = 1e-6  # two eigenvalues that differ by less than this part are one, computed in two ways


@dataclass(frozen=True)
class SearchEnd:
    """Why a search among gains chose none that is larger.

    ``bound``: the largest gain [pu] that was allowed.
    ``next_gain``, ``next_mode``: the next larger gain that was tried, and the least damped mode with it [rad/s]; None
    for the mode if something grows. Both are None if the largest gain was chosen."""

    bound: float
    next_gain: float | None = None
    next_mode: complex | None = None


@dataclass(frozen=True)
class SmallerDevice:
    """A device of a small part of its bus's short-circuit power, tried where a larger one confirmed nothing.

    Attributes
    ----------
    rating_mva
        Rating of the smaller device [MVA].
    larger_mva
        Rating of the device that confirmed nothing [MVA].
    short_circuit_mva
        Short-circuit power of the bus without a device [MVA].
    found
        What coupled FMUs say of the smaller one.
    """

    rating_mva: float
    larger_mva: float
    short_circuit_mva: float
    found: "Confirmation"


@dataclass(frozen=True)
class Confirmation:
    """Results of the coupled FMUs at one bus: Δλ [rad/s] by a small gain of the tuned POD, or by a device without
    one, as predicted and as coupled; λ with the device, its POD off; the POD's setting and λ with it; the least
    damped mode then [rad/s], which may be another one; and the least damped then of the swings outside of the range.
    """

    bus: str
    predicted: complex = 0j
    coupled: complex = 0j
    with_device: complex = 0j
    setting: PodSetting | None = None
    tuned: complex | None = None
    least: complex | None = None
    stable: bool | None = None
    failure: str = ""
    search: SearchEnd | None = None  # for the gain of the POD
    beside: complex | None = None
    smaller: SmallerDevice | None = None  # tried at the bus where this one confirms nothing

    @property
    def error(self) -> float:
        return abs(self.predicted - self.coupled) / max(abs(self.coupled), 1e-12)

    @property
    def damping_predicted(self) -> float:
        """Damping of the mode with a device without a POD, as its own response predicts it [%]."""
        return damping_percent(self.with_device + self.predicted - self.coupled)

    @property
    def agrees(self) -> bool:
        return not self.failure and self.error <= AGREES

    @property
    def damping_alone(self) -> float:
        """Damping of the mode with the device, without its POD [%]."""
        return damping_percent(self.with_device)

    @property
    def reached(self) -> complex:
        """The mode with the device [rad/s], tuned where it has a POD."""
        return self.tuned if self.tuned is not None else self.with_device

    @property
    def damping(self) -> float:
        """Damping of the mode with the device, tuned where it has a POD [%]."""
        return damping_percent(self.reached)

    @property
    def least_damping(self) -> float | None:
        """Damping of the least damped mode then [%]; None if nothing was computed."""
        return None if self.least is None else damping_percent(self.least)

    @property
    def other(self) -> complex | None:
        """The least damped mode then [rad/s], if it is another one than that which was followed."""
        if self.least is None or abs(self.least - self.reached) <= _ONE * abs(self.least):
            return None
        return self.least

    @property
    def lower_beside(self) -> complex | None:
        """The least damped swing outside of the range then [rad/s], if it has less damping than the mode followed."""
        if self.beside is None or damping_ratio(self.beside) >= damping_ratio(self.reached):
            return None
        return self.beside


def in_turn(
    places: Sequence[str], confirm: Callable[[str], Confirmation], report: Callable[[int], None]
) -> tuple[Confirmation, ...]:
    """Confirm places one after another; an interrupt ends this, and what is confirmed by then stays.

    ``report``: told how many are done."""
    found: list[Confirmation] = []
    with suppress(KeyboardInterrupt):
        for place in places:
            found.append(confirm(place))
            report(len(found))
    return tuple(found)


def how_sure(sentences: Sequence[str], unconfirmed: Sequence[str]) -> list[str]:
    """Say what coupled FMUs found at the places, and before which of them it was interrupted."""
    if not unconfirmed:
        return [*sentences] or ["not confirmed by coupled FMUs"]
    return [*sentences, f"interrupted before coupled FMUs confirmed {', '.join(unconfirmed)}"]


def confirmed(
    prepared: PreparedScenario,
    bus: str,
    seen: SeenMode,
    frequency_range: tuple[float, float],
    controller: str | None,
    gain: float,
    *,
    without: ModesResult,
    outside: Sequence[Mode] = (),
) -> Confirmation:
    """Compare a mode's predicted shift with that of the coupled FMUs.

    ``prepared``: With the device at the bus.
    ``without``: the system without it; ``outside``: its swings outside of the range.
    ``controller``: ``pod_p`` or ``pod_q``, of at most a gain [pu of the rating]; None for a device as it is."""
    tell_doing(f"device at {bus}: steady state and linear model")
    try:
        with running(prepared) as master:
            rest = without.operating_point
            begin_at(master, rest.states)
            point = find_operating_point(master, accept=max(_STILL, _AS_STILL * rest.residual))
            if controller is None:
                return _as_it_is(
                    prepared, master, point, bus, seen, frequency_range, outside=outside
                )
            return _with_pod(
                master,
                bus,
                seen,
                frequency_range,
                controller=controller,
                gain=gain,
                known=without.modes,
                outside=outside,
            )
    except CosimError as error:
        return Confirmation(bus, failure=str(error))
    finally:
        tell_doing()


def _as_it_is(
    prepared: PreparedScenario,
    master: Master,
    point: OperatingPoint,
    bus: str,
    seen: SeenMode,
    frequency_range: tuple[float, float],
    *,
    outside: Sequence[Mode],
) -> Confirmation:
    blocks = Blocks(master, derivatives=True)
    tell_doing(f"device at {bus}: eigenvalues")
    critical = _below_followed(seen.mode, model_of(master, blocks))
    found = modes_from(prepared, master, point, blocks, frequency_range, critical)
    pair, eigenvalue = same_mode(seen.mode, found.model), seen.mode.eigenvalue
    predicted = _predicted(master, blocks.components[name_at(bus)], bus, seen) - eigenvalue
    coupled, least = pair.eigenvalue - eigenvalue, least_damped(found.modes, pair.eigenvalue)
    return Confirmation(
        bus,
        predicted,
        coupled,
        pair.eigenvalue,
        least=least,
        stable=found.stability.stable,
        beside=_least_beside(outside, found.model),
    )


def _below_followed(mode: Mode, model: LinearModel) -> float | None:
    """Damping ratio below which modes of a system too large for all its eigenvalues are searched; None in others.

    The least damped mode is the one that is followed, or has less damping than that."""
    if len(model.names) <= WHOLE:
        return None
    followed = damping_ratio(same_mode(mode, model).eigenvalue)
    return min(max(followed, _LEAST_SEARCHED), SPARSE_BELOW)


def _with_pod(
    master: Master,
    bus: str,
    seen: SeenMode,
    frequency_range: tuple[float, float],
    *,
    controller: str,
    gain: float,
    known: Sequence[Mode],
    outside: Sequence[Mode],
) -> Confirmation:
    name, eigenvalue = name_at(bus), seen.mode.eigenvalue
    loop = PodLoop(master, [name], controller)
    rest = _predicted(master, loop.block(name), bus, seen)
    off = PodSetting(0.0, NO_COMPENSATION)

    def shift(setting: PodSetting) -> complex:
        loop.model(setting)
        return _predicted(master, loop.block(name), bus, seen) - rest

    start = Placed(off, same_mode(seen.mode, loop.model(off)))
    by_gain = shift(PodSetting(1.0, NO_COMPENSATION))
    if not by_gain:
        raise AnalysisError("a POD there does not move the mode at all")
    tell_doing(f"device at {bus}: settings of its POD")
    looks = LeastDamping(loop, known, frequency_range)
    tuned, search = tuned_setting(loop, start, by_gain, eigenvalue, gain, looks=looks)
    trial = trial_of(tuned, by_gain, eigenvalue)
    predicted = shift(trial)
    coupled = loop.place(start, trial.gain, trial.filters).eigenvalue - start.eigenvalue
    reached = loop.place(start, tuned.gain, tuned.filters)
    least = least_of(looks.known_values(tuned), frequency_range, reached.eigenvalue)
    return Confirmation(
        bus,
        predicted,
        coupled=coupled,
        with_device=start.eigenvalue,
        setting=tuned,
        tuned=reached.eigenvalue,
        least=least,
        stable=looks.is_stable(tuned),
        search=search,
        beside=_least_beside(outside, loop.model(tuned)),
    )


def _predicted(master: Master, model: ComponentLinearization, bus: str, seen: SeenMode) -> complex:
    """λ with a component, whose answer is that at λ itself."""
    return seen.mode.eigenvalue + seen.final_shift(bus, lambda at: response_of(master, model, at))


def tuned_setting(
    loop: PodLoop,
    start: Placed,
    by_gain: complex,
    eigenvalue: complex,
    most: float,
    *,
    looks: LeastDamping | None = None,
) -> tuple[PodSetting, SearchEnd]:
    """The setting with the best least damping: around the angle that the residue asks for, with gains up to the most.

    Of those that come within a tenth of a point of it, as where another mode that the POD hardly moves is the least
    damped, that which damps the followed mode best; of several with the same damping that with the smallest gain."""
    angle = math.degrees(cmath.phase(-1 / by_gain))
    settings = [
        PodSetting(part * most, lead_lag_turning(angle + turn, eigenvalue.imag, STAGES))
        for part in _PARTS
        for turn in _TURNS
        if abs(angle + turn) < LARGEST_TURN * STAGES
    ]
    seen = looks or LeastDamping(loop)
    worth = {setting: seen.of(setting) for setting in settings}
    while True:
        top = max(worth.values())
        equal = [one for one in settings if worth[one] > max(top - _GIVEN_UP, GROWS)] or settings
        of_followed = {one: _of_followed(seen, start, one) for one in equal}
        best = min(equal, key=lambda one: (-round(of_followed[one] / _EQUAL), one.gain))
        deciding = [max(settings, key=lambda one: worth[one]), best, *_next_larger(best, settings)]
        unsure = [one for one in dict.fromkeys(deciding) if not seen.is_sure(one)]
        if unsure:
            worth |= {one: seen.surely(one) for one in unsure}
        elif seen.is_proved(best):
            return best, _search_end(best, settings, seen, most)
        else:
            worth = {one: seen.of(one) for one in settings}


def trial_of(tuned: PodSetting, by_gain: complex, eigenvalue: complex) -> PodSetting:
    """The setting with so small a gain that the mode [rad/s] moves as the residue ``by_gain`` [rad/s per pu] says."""
    small = _SMALL * abs(eigenvalue / (by_gain * tuned.filters.response(eigenvalue)))
    return replace(tuned, gain=min(tuned.gain, small))


def _of_followed(seen: LeastDamping, start: Placed, setting: PodSetting) -> float:
    """Damping ratio of the followed mode with a setting; −1 if it cannot be followed there."""
    try:
        return damping_ratio(seen.followed(start, setting))
    except AnalysisError:
        return -1.0


def _search_end(
    best: PodSetting, settings: Sequence[PodSetting], seen: LeastDamping, most: float
) -> SearchEnd:
    for following in _next_larger(best, settings):
        grows = seen.of(following) <= GROWS
        return SearchEnd(most, following.gain, None if grows else seen.weakest(following))
    return SearchEnd(most)


def _next_larger(best: PodSetting, settings: Sequence[PodSetting]) -> list[PodSetting]:
    """The setting with the next larger gain and the same lead/lag; none if the largest gain is the best."""
    larger = [one for one in settings if one.gain > best.gain and one.filters == best.filters]
    return sorted(larger, key=lambda one: one.gain)[:1]


def same_mode(mode: Mode, model: LinearModel) -> Eigenpair:
    """The mode in a model with further states: the most similar one among those near."""
    common = {name: k for k, name in enumerate(model.names) if name in mode.shape}
    left, right = (
        np.array([vector[name] for name in common]) for vector in (mode.left, mode.shape)
    )
    own, places = Eigenpair(mode.eigenvalue, left, right), list(common.values())
    pairs = pairs_near(model, mode.eigenvalue)
    alike = {k: own.similarity(pair.within(places)) for k, pair in enumerate(pairs)}
    best = max(alike, key=lambda k: alike[k])
    if alike[best] < _SAME:
        raise AnalysisError(
            f"with the device no mode is like that of {mode.frequency_hz:.3f} Hz any more "
            f"(at most {alike[best]:.2f} of 1): it changes too much; take a smaller "
            + Option.RATING
        )
    return pairs[best]


def swings_outside(found: ModesResult) -> list[Mode]:
    """The least damped of the swings outside of a study's range, with their shapes."""
    values = () if found.hidden is None else found.hidden.electromechanical
    return [_mode_at(found.model, value) for value in sorted(values, key=damping_ratio)[:_BESIDE]]


def _mode_at(model: LinearModel, eigenvalue: complex) -> Mode:
    pair = min(pairs_near(model, eigenvalue), key=lambda one: abs(one.eigenvalue - eigenvalue))
    return make_mode(pair.eigenvalue, pair.left, pair.right, model.names)


def _least_beside(outside: Sequence[Mode], model: LinearModel) -> complex | None:
    """The least damped of these modes in a model with further states [rad/s]; None where none is found again."""
    found = []
    for mode in outside:
        with suppress(AnalysisError):
            found.append(same_mode(mode, model).eigenvalue)
    return min(found, key=damping_ratio, default=None)


def least_damped(modes: Sequence[Mode], followed: complex) -> complex:
    """The least damped oscillation of a range's modes [rad/s]; the one that is followed always counts."""
    found = [mode.eigenvalue for mode in modes if mode.is_oscillation]
    return min([*found, followed], key=damping_ratio)


def least_of(
    values: NDArray[np.complex128], frequency_range: tuple[float, float], followed: complex
) -> complex:
    """The same of all eigenvalues [rad/s]."""
    low, high = (2 * math.pi * hertz for hertz in frequency_range)
    inside = oscillations(values) & (low <= values.imag) & (values.imag <= high)
    held: list[complex] = values[inside].tolist()
    return min([*held, followed], key=damping_ratio)
