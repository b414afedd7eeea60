"""The effect of a POD setting on all other modes."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from orchestrator.core.arrays import Complex, Numbers
from orchestrator.core.late import optimize
from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.linear.spectra.continuation import pair_of
from orchestrator.linear.spectra.mode_tracking import similarity
from orchestrator.linear.spectra.modes import (
    ELECTROMECHANICAL_HZ,
    Mode,
    Spectrum,
    damping_ratio,
    to_continuous,
)
from orchestrator.linear.spectra.stability import fastest_growth

Naming = Callable[[LinearModel, list[Mode]], Mode | None]

_SAME = 1e-5
"""Two eigenvalues that differ by less than this part of their size are one eigenvalue, computed in two ways."""

_EQUAL = 1e-3
"""Damping ratios that differ by less than this count as equal, and growth rates that differ by less than this part of
their size."""


@dataclass(frozen=True)
class Surroundings:
    others: tuple[Mode, ...]  # those from 0.1 to 2 Hz, least damped first
    # real part [1/s] of the eigenvalue that grows most, at any frequency, the target's included; 0 where none grows
    growth: float
    # the mode to which the case's rule gives the target's name; normally the target itself
    named: Mode | None
    # the target, as it was followed; None if it lies outside of 0.1 to 2 Hz or was not followed
    followed: Mode | None = None

    @property
    def other_named(self) -> Mode | None:
        """The mode with the target's name, if it differs from the mode that was followed."""
        return self.named if any(self.named is mode for mode in self.others) else None

    @property
    def worst(self) -> Mode | None:
        """The least damped of the other modes; None where there are no others."""
        return self.others[0] if self.others else None

    def without(self, mode: Mode) -> "Surroundings":
        return replace(self, others=tuple(m for m in self.others if m is not mode))

    def counting(self, target: complex) -> complex:
        """The less damped of two modes [rad/s]: the target, and the mode that now has the target's name.

        A strong controller can make two modes trade places. Then the less damped of both counts as the target."""
        candidates = [target, *([self.other_named.eigenvalue] if self.other_named else [])]
        return min(candidates, key=damping_ratio)

    def worst_beside(self, target: complex) -> Mode | None:
        """The least damped mode, leaving out the mode that counts as ``target`` [rad/s]; see `counting`."""
        rest = self.others
        if self.other_named is not None and self.counting(target) == self.other_named.eigenvalue:
            followed = () if self.followed is None else (self.followed,)
            rest = (*(m for m in rest if m is not self.other_named), *followed)
        return min(rest, key=lambda m: m.damping_ratio, default=None)


def surroundings(
    model: LinearModel, spectrum: Spectrum, target: complex | None, naming: Naming
) -> Surroundings:
    """All modes from 0.1 to 2 Hz of a model's spectrum, except the one at ``target`` [rad/s].

    ``naming``: finds the mode with the target's name."""
    others, followed = tuple(spectrum.modes), None
    if target is not None:
        others = tuple(m for m in others if abs(m.eigenvalue - target) > _SAME * abs(target))
        followed = next((m for m in spectrum.modes if m not in others), None)
    fastest = fastest_growth(spectrum.eigenvalues, step_map=model.step_size is not None)
    return Surroundings(
        others, fastest.real if fastest else 0.0, naming(model, spectrum.modes), followed
    )


def breach(before: Surroundings, after: Surroundings, least: float) -> str | None:
    """The prohibited effect of a design: the system becomes unstable, or another mode falls below the least damping.

    Each mode is compared with the one that it was before. A mode that was below the least damping may not fall, and
    one that was not there before may not be below."""
    if after.growth > (1 + _EQUAL) * before.growth:
        return (
            f"the system becomes unstable: an eigenvalue has a real part of {after.growth:+.3g} 1/s"
        )
    for mode, was in _as_before(before.others, after.others):
        if mode.damping_ratio >= least:
            return None  # so have all that follow
        limit = least if was is None else min(was.damping_ratio, least)
        if mode.damping_ratio < limit - _EQUAL:
            had = "" if was is None else f" (before: {was.damping_percent:.2f} %)"
            return (
                f"the mode at {mode.frequency_hz:.3f} Hz ({mode.participation[0][0]}) has {mode.damping_percent:.2f} % "
                f"of damping{had}, below {100 * least:g} %"
            )
    return None


def _as_before(before: Sequence[Mode], after: Sequence[Mode]) -> Iterator[tuple[Mode, Mode | None]]:
    """Each mode, least damped first, with the one that it was before; None for one that was not there.

    Those belong together whose shapes are alike, and whose eigenvalues are near; each belongs to one at most."""
    rows, columns = optimize.linear_sum_assignment(_unlikeness(after, before))
    was = dict(zip(rows.tolist(), columns.tolist(), strict=True))
    for row in sorted(range(len(after)), key=lambda k: after[k].damping_ratio):
        yield after[row], before[was[row]] if row in was else None


def _unlikeness(after: Sequence[Mode], before: Sequence[Mode]) -> Numbers:
    """Return how far each mode of a model is from each of another: 0 if their shapes and eigenvalues are the same.

    Shape (len(after), len(before)). Modes whose left eigenvectors are not known are compared by their eigenvalues."""
    mine, theirs = (np.array([mode.eigenvalue for mode in modes]) for modes in (after, before))
    away: Numbers = np.abs(mine[:, None] - theirs) / np.abs(theirs)
    names = [name for name in after[0].shape if name in before[0].shape] if away.size else []
    if not (names and all(mode.left for mode in (*after, *before))):
        return away
    left, right = _sides(after, names)
    left_before, right_before = _sides(before, names)
    alike = similarity(left, right, left_before, right_before)
    unlike: Numbers = 1.0 - np.minimum(alike, 1.0) + away
    return unlike


def _sides(modes: Sequence[Mode], names: Sequence[str]) -> tuple[Complex, Complex]:
    """Return the left and the right eigenvectors of modes in some states, each of shape (modes, names)."""
    pairs = [pair_of(mode, names) for mode in modes]
    return np.array([pair.left for pair in pairs]), np.array([pair.right for pair in pairs])


def extremes(model: LinearModel) -> tuple[complex, complex | None]:
    """`weakest_and_growing` of a model."""
    values, _ = to_continuous(np.linalg.eigvals(model.A).astype(complex), model.step_size)
    return weakest_and_growing(values, step_map=model.step_size is not None)


def weakest_and_growing(
    values: Complex, *, step_map: bool, within: tuple[float, float] = ELECTROMECHANICAL_HZ
) -> tuple[complex, complex | None]:
    """The least damped eigenvalue of a range [Hz] (−1 if no eigenvalue lies there), and the fastest growing one
    [rad/s], of all eigenvalues."""
    low, high = within
    hertz = values.imag / (2 * np.pi)
    weakest = min(
        values[(hertz >= low) & (hertz <= high)].tolist(), key=damping_ratio, default=complex(-1)
    )
    return weakest, fastest_growth(values, step_map=step_map)
