"""Where the growth of a system with a POD comes from: eigenvalues that grow with the controller, followed to those of
the system without it, so that a design is blamed only for what it does."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from orchestrator.core.errors import AnalysisError
from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.linear.spectra.continuation import Eigenpair, between, follow_along, pairs_near
from orchestrator.linear.spectra.stability import Cause, Stability, grows, place
from orchestrator.studies.pod_design.closed_loop import PodLoop, PodSetting

_GAINS = 9
_STATES_NAMED = 3


@dataclass(frozen=True)
class Growth:
    """An eigenvalue that grows with the controller.

    ``without``: the same eigenvalue without the controller [rad/s]; ``with_it``: with the final setting [rad/s];
    ``states``: those that take part most, in words; ``fades_at``: a gain within the bounds with which it does not grow
    [pu]; None if there is none, or the eigenvalue cannot be followed so far."""

    without: complex
    with_it: complex
    states: str
    fades_at: float | None
    bounds: tuple[float, float]

    @property
    def is_older(self) -> bool:
        """Return whether it grows without the controller too."""
        return bool(grows(np.array([self.without]))[0])

    def sentence(self) -> str:
        there = (
            f"the eigenvalue at {self.with_it.real:+.4g} 1/s ({place(self.with_it)}; {self.states})"
        )
        if not self.is_older:
            return f"the system is UNSTABLE by the controller: {there} is at {self.without.real:+.4g} 1/s without it"
        moved = "slower" if self.with_it.real < self.without.real else "faster"
        low, high = self.bounds
        gains = (
            f"no gain from {low:g} to {high:g} pu with this lead/lag holds it"
            if self.fades_at is None
            else f"with this lead/lag K = {self.fades_at:.4g} pu holds it"
        )
        return (
            f"the system is UNSTABLE, as it is without the controller: {there} grows {moved} than without it, "
            f"{self.without.real:+.4g} 1/s there; {gains}"
        )


def growth_of(
    loop: PodLoop, setting: PodSetting, stability: Stability, bounds: tuple[float, float]
) -> Growth | None:
    """Find the eigenvalue to blame for the growth with a setting; one that the controller made, before older ones.

    None where nothing grows, where the coupling is the cause, where a component gives no derivatives, and where an
    eigenvalue cannot be followed.

    ``bounds``: of the gains that are tried [pu]."""
    if stability.mode is None or stability.cause is not Cause.SYSTEM or not setting.gain:
        return None
    try:
        half, full = loop.continuous_models(setting)
        halves = between(half, full)
        if halves is None:
            return None
        # the state matrix is linear in the gain
        model_at = _Gains(halves, setting.gain).model
        growing = [
            pair
            for pair in pairs_near(full, stability.mode.eigenvalue)
            if grows(np.array([pair.eigenvalue]))[0]
        ]
        found = [_followed(pair, model_at, full.names, setting.gain, bounds) for pair in growing]
    except AnalysisError:
        return None
    return min(found, key=lambda one: (one.is_older, -one.with_it.real), default=None)


@dataclass(frozen=True)
class _Gains:
    """Models by the gain, from those on the straight way between half of a gain [pu] (0) and that gain (1)."""

    halves: Callable[[float], LinearModel]
    gain: float

    def model(self, wanted: float) -> LinearModel:
        return self.halves(2 * wanted / self.gain - 1)


def _followed(
    pair: Eigenpair,
    model_at: Callable[[float], LinearModel],
    names: Sequence[str],
    gain: float,
    bounds: tuple[float, float],
) -> Growth:
    without = follow_along(pair, model_at, gain, 0.0).eigenvalue
    shares = np.abs(pair.left.conj() * pair.right)
    most = [int(k) for k in np.argsort(shares)[::-1][:_STATES_NAMED]]
    states = ", ".join(names[k] for k in most)
    fades = _fading_gain(pair, model_at, gain, bounds)
    return Growth(without, pair.eigenvalue, states, fades, bounds)


def _fading_gain(
    pair: Eigenpair,
    model_at: Callable[[float], LinearModel],
    gain: float,
    bounds: tuple[float, float],
) -> float | None:
    """The gain nearest to the present one, of some within the bounds, with which an eigenvalue does not grow."""
    tried = np.linspace(*bounds, _GAINS).tolist()
    ways = ([g for g in tried if g > gain], [g for g in reversed(tried) if g < gain])
    fading = []
    for way in ways:
        here, there = gain, pair
        try:
            for wanted in way:
                there = follow_along(there, model_at, here, wanted)
                here = wanted
                if not grows(np.array([there.eigenvalue]))[0]:
                    fading.append(wanted)
                    break
        except AnalysisError:
            continue
    return min(fading, key=lambda found: abs(found - gain), default=None)
