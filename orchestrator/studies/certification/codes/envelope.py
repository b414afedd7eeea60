"""Envelopes within which RTE expects the response of a grid-forming plant, from what its applicant declares.

The plant is a voltage source behind X_eff whose angle obeys a swing equation. The grid is a reactance 1/SCR; X is the
sum of both. Powers and currents are per unit of the rating, t counts from the event, ω_b is 2π·f_n:

    2H·dω/dt = −ΔP + D·(ω_f − ω),  dδ/dt = ω_b·(ω − ω_grid),  ΔP = δ/X,

where ω_f is the grid's frequency behind a lag `LAG`. All curves follow from its roots. A bound is a distance from the
power before the event, in the direction in which the ideal plant moves: what is *asked* lies nearer to it, what is
*allowed* farther away.

Source: RTE's programme DyCoV (dynawo/dyn-grid-compliance-verification, ``src/dycov/gfm`` and the curves under
``docs/GFM_envelopes_curves``), that computes them for the sheet "grid-forming" of its technical documentation. Its
revisions differ in margins; those of the published curves are taken, which these functions give to their last digit."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from orchestrator.core.arrays import Complex, Numbers

LAG = 0.01  # lag with which the damping follows the frequency of the grid [s]
# what the bounds come later by for waveforms [s]: the mean over a period of 50 Hz takes as long
LATE = 0.02
SLACK = 0.01  # by how much later a bound that asks for something begins [s]
# distance of the bounds in the end: the larger of a part of the rating and a part of the peak
TUNNEL = 0.02  # of the rating
TUNNEL_SHARE = 0.05  # of the peak

DEMAND = 0.98  # largest power that is asked for [pu]
CEILING = 1.2  # largest power that is allowed [pu]

_NEAR = 1e-6  # roots that are nearer to each other than this part count as one, and are moved apart


@dataclass(frozen=True)
class Bounds:
    """Values that are asked and allowed, as distances from the value before the event."""

    ideal: Numbers  # response of the declared plant, shape (n,)
    # asked, allowed: bounds towards the value before the event and away from it, shape (n,). One below 0 lies on the
    # other side.
    asked: Numbers
    allowed: Numbers


@dataclass(frozen=True)
class Swinging:
    """The swing equation of a plant at a grid."""

    # D, H: damping [pu of power per pu of frequency] and inertia constant [s].
    D: float
    H: float
    X: float  # reactance between both voltages [pu]
    omega_b: float  # 2π times the rated frequency [rad/s]

    @property
    def decay(self) -> float:
        """Half of the sum of both roots, ζ·ω_n [1/s]."""
        return self.D / (4 * self.H)

    @property
    def natural(self) -> float:
        """Natural frequency ω_n [rad/s]."""
        return float(np.sqrt(self.omega_b / (2 * self.H * self.X)))

    @property
    def ratio(self) -> float:
        return self.decay / self.natural

    @property
    def swing(self) -> float:
        """Frequency of its oscillation [rad/s]; only where ζ < 1."""
        return float(np.sqrt(self.natural**2 - self.decay**2))

    @property
    def roots(self) -> tuple[complex, complex]:
        """Both roots, with their sign turned [1/s]."""
        spread = np.sqrt(complex(self.decay**2 - self.natural**2))
        return complex(self.decay + spread), complex(self.decay - spread)

    def varied(self, ratio: float) -> "Swinging":
        """The same with more damping and less inertia by a ratio."""
        return Swinging(self.D * ratio, self.H / ratio, self.X, self.omega_b)

    def dying(self, t: Numbers) -> Numbers:
        """Power after a jump of the angle, over its first value: from 1 to 0, and level at the start."""
        return 1 - _step(self.roots, t)

    def dying_of_source(self, t: Numbers) -> Numbers:
        """Return what `dying` returns; where ζ ≤ 1 as DyCoV has it, e^(−σt)·(cos ω_d·t − (σ − 1)/ω_d·sin ω_d·t).

        That is no solution of the swing equation, for which +σ stands in place of −(σ − 1). It falls earlier."""
        if self.ratio > 1:
            return self.dying(t)
        phase = self.swing * t
        sine = t if self.swing == 0 else np.sin(phase) / self.swing
        return np.asarray(np.exp(-self.decay * t) * (np.cos(phase) - (self.decay - 1) * sine))

    def ramping(self, t: Numbers) -> Numbers:
        """Power per rate of the grid's frequency [pu·s] after a ramp begins: from 0 to 2H + D·LAG."""
        return np.asarray(
            2 * self.H * _step(self.roots, t) + self.D * LAG * _step((*self.roots, 1 / LAG), t)
        )

    def ramp_peak(self, *, rising: bool) -> float:
        """Size of `ramping` by which the tunnel is measured [pu·s].

        Where ζ < 1 DyCoV adds the amplitude of the oscillation to the final value with its sign, so that the tunnel of
        a falling frequency is the narrower one."""
        final = 2 * self.H + self.D * LAG
        if self.ratio >= 1:
            return final
        parts = self.D * LAG * _residues(_apart((*self.roots, 1 / LAG)))
        amplitude = 2 * abs(2 * self.H * _residues(_apart(self.roots))[0] + parts[0])
        steady = final - parts[2].real
        return float(abs(steady + amplitude if rising else amplitude - steady))

    def ramp_settled(self) -> float:
        """Time after which `ramping` counts as settled [s]."""
        if self.ratio < 1:
            return 4 / self.decay
        return 4 * max(LAG, *(1 / root.real for root in self.roots))


def jump_bounds(plant: Swinging, angle: float) -> Callable[[Numbers], Bounds]:
    """Bounds of the active power after a jump of the grid's angle (IGFM1)."""
    peak = angle / plant.X
    spread, margin = (0.85, 1.15), 0.4

    def bounds(t: Numbers) -> Bounds:
        since = np.maximum(t - SLACK, 0)
        ideal = plant.dying_of_source(t)
        if plant.ratio > 1:
            asked, most = margin * plant.dying(since), (1 + margin) * ideal
        else:
            fading = np.exp(-plant.decay * since)
            asked, most = (1 - margin) * fading, (1 + margin) * fading
        asked = np.where(t < SLACK, 0.0, asked)
        curves = [ideal, asked, most, *(plant.varied(r).dying_of_source(t) for r in spread)]
        tunnel = _tunnel(peak) * (1 - np.exp((0.02 - t) / 0.3))
        return Bounds(
            peak * ideal,
            peak * np.min(curves, axis=0) - tunnel,
            peak * np.max(curves, axis=0) + tunnel,
        )

    return bounds


def amplitude_bounds(current: float) -> Callable[[Numbers], Bounds]:
    """Bounds of the reactive current after a step of the grid's voltage (IGFM2)."""
    tunnel, lasts, margin = _tunnel(current), 0.08, 0.3
    rise = -0.01 / np.log(0.1)  # 90 % in 10 ms

    def bounds(t: Numbers) -> Bounds:
        ideal = current * (1 - np.exp(-t / rise))
        more = np.where(t < lasts, margin * current * np.exp(-3 * t / lasts), 0.0)
        return Bounds(ideal, np.minimum(ideal, current - tunnel), current + more + tunnel)

    return bounds


def strength_bounds(plant: Swinging, change: float) -> Callable[[Numbers], Bounds]:
    """Bounds of the active power after a step of the short-circuit ratio (IGFM3).

    ``plant``: As declared, with the grid after the step.
    ``change``: Size of the power's first change [pu]: |P_0|·|1/SCR_after − 1/SCR_before|/X."""
    tunnel, spread, margin = _tunnel(change), (1.0, 0.8, 1.2), 0.2
    plants = [plant.varied(ratio) for ratio in spread]

    def bounds(t: Numbers) -> Bounds:
        ideal = change * plant.dying(t)
        curves = [change * p.dying(t) for p in plants]
        fading = [
            change * p.natural / p.swing * np.exp(-p.decay * t) for p in plants if p.ratio < 1
        ]
        least = np.min([*curves, *(-f for f in fading)], axis=0)
        most = np.max([*curves, *fading], axis=0)
        asked = np.minimum((1 - np.sign(least) * margin) * least - tunnel, ideal / 2)
        asked = np.where(t <= 0.03, ideal / 2 - 0.005, asked)
        return Bounds(ideal, asked, (1 + margin) * most + tunnel)

    return bounds


def ramp_bounds(plant: Swinging, rate: float, lasts: float) -> Callable[[Numbers], Bounds]:
    """Bounds of the active power during and after a ramp of the grid's frequency (IGFM4).

    ``rate``: Rate of the frequency [pu/s]; its sign chooses the margins.
    ``lasts``: Duration of the ramp [s]."""
    size, tunnel = abs(rate), _tunnel(abs(rate) * plant.ramp_peak(rising=rate > 0))
    less, more = (0.3, 0.5) if rate > 0 else (0.5, 0.3)
    plants = [plant.varied(ratio) for ratio in (1.0, 0.8, 1.2)]
    settled = plant.ramp_settled()

    def curve(p: Swinging, t: Numbers) -> Numbers:
        after = np.where(t >= lasts, p.ramping(np.maximum(t - lasts, 0)), 0.0)
        return np.asarray(size * (p.ramping(t) - after))

    def unlimited(t: Numbers) -> Bounds:
        curves = [curve(p, t) for p in plants]
        asked = (1 - less) * np.min(curves, axis=0) - tunnel
        allowed = (1 + more) * np.max(curves, axis=0) + tunnel
        level = float(curve(plant, np.array([settled]))[0])
        still = (t >= settled) & (t < lasts)
        return Bounds(
            curves[0],
            np.where(still, level - tunnel, asked),
            np.where(still, level + tunnel, allowed),
        )

    last = float(unlimited(np.array([lasts * (1 - 1e-9)])).allowed[0])

    def bounds(t: Numbers) -> Bounds:
        found = unlimited(t)
        return Bounds(
            found.ideal,
            found.asked,
            np.where(t >= lasts, np.minimum(found.allowed, last), found.allowed),
        )

    return bounds


def _tunnel(peak: float) -> float:
    return max(TUNNEL, TUNNEL_SHARE * peak)


def _apart(poles: tuple[complex, ...]) -> Complex:
    """The poles, with those that are nearly one moved apart."""
    moved = list(poles)
    for k, pole in enumerate(moved):
        if any(abs(pole - other) < _NEAR * abs(pole) for other in moved[:k]):
            moved[k] = pole * (1 + 10 * _NEAR)
    return np.array(moved)


def _residues(poles: Complex) -> Complex:
    """c_k of Π p_k/(s·Π(s + p_k)) = 1/s − Σ c_k/(s + p_k)."""
    factors = poles[:, None] / (poles[:, None] - poles[None, :] + np.diag(poles))
    return np.asarray(np.prod(factors, axis=0))


def _step(poles: tuple[complex, ...], t: Numbers) -> Numbers:
    """Response to a step from 0 to 1 of a chain of lags whose inverse time constants these are."""
    moved = _apart(poles)
    return np.asarray(1 - (np.exp(-np.outer(t, moved)) @ _residues(moved)).real)
