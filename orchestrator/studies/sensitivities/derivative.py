"""The derivative of an eigenvalue by one parameter, from its shifts at several values, and doubts about it."""

from collections.abc import Callable
from dataclasses import dataclass

from orchestrator.studies.sensitivities.parameters import SHARE, Parameter

SIZES = (1e-2, 1e-3)
"""Differences are taken over this part of the parameter and over twice of it, and must agree; else over the second."""

_AGREE = 0.02  # two sizes agree within this part of the derivative
# A derivative upwards and one downwards that differ by more than this part belong to a limit on one
# side
_KINK = 0.1
# where smooth, twice the change doubles the difference between up and down; at a kink it stays
_STAYS_APART = 0.75

_FLOOR = 2e-6
"""What an effect of one percent is not judged below, as a part of |λ|, with the first size: blocks that are perturbed
over a step of 100 µs give λ to about 1e-6 rad/s."""

_SLOWEST = 0.5  # |λ| that the floor is at least related to [rad/s]


@dataclass(frozen=True)
class Shift:
    """How far a changed parameter moves an eigenvalue [rad/s]: in the step map, and without a communication step.

    ``edges`` are the components that stand at the edge of a limit with the changed value."""

    step: complex
    continuous: complex | None
    edges: frozenset[str] = frozenset()


@dataclass(frozen=True)
class Derivative:
    """∂λ/∂p [rad/s per unit of the parameter], of the step map and of the continuous model, with doubts in words."""

    step: complex
    continuous: complex | None
    doubts: tuple[str, ...] = ()


def differentiate(
    parameter: Parameter, shift_at: Callable[[float], Shift], eigenvalue: complex
) -> Derivative | None:
    """Central differences of two sizes; of one side where the parameter is at a bound, None where it has no room."""
    found: Derivative | None = None
    for size in SIZES:
        change = size * parameter.scale
        signs = [sign for sign in (1, -1) if parameter.allows(2 * sign * change)]
        if not signs:
            continue
        slopes = {
            sign: [_slope(shift_at, parameter, sign * k * change) for k in (1, 2)] for sign in signs
        }
        floor = (
            _FLOOR * max(abs(eigenvalue), _SLOWEST) / (SHARE * parameter.scale) * (SIZES[0] / size)
        )
        derivative = _derivative_of(slopes, floor)
        found = found or derivative
        if not derivative.doubts:
            return derivative
    return found


def _slope(shift_at: Callable[[float], Shift], parameter: Parameter, change: float) -> Shift:
    shift = shift_at(parameter.value + change)
    return Shift(
        shift.step / change,
        None if shift.continuous is None else shift.continuous / change,
        shift.edges,
    )


def _derivative_of(slopes: dict[int, list[Shift]], floor: float) -> Derivative:
    """The derivative of slopes by their side, each over one change and over twice of it; ``floor`` is not judged."""
    step, twice = (_together([pair[k].step for pair in slopes.values()]) for k in (0, 1))
    rates = [[shift.continuous for shift in pair] for pair in slopes.values()]
    continuous, later = (_mean_if_all([pair[k] for pair in rates]) for k in (0, 1))
    doubts = []
    if abs(step - twice) > _AGREE * abs(step) + floor:
        doubts.append(
            f"two sizes of change disagree: {abs(step):.3g} and {abs(twice):.3g} rad/s a unit"
        )
    if len(slopes) == 2:
        (up, up_2), (down, down_2) = ([shift.step for shift in slopes[sign]] for sign in (1, -1))
        apart, apart_2 = abs(up - down), abs(up_2 - down_2)
        if apart > _KINK * max(abs(up), abs(down)) + floor and apart > _STAYS_APART * apart_2:
            doubts.append(
                f"upwards it moves the mode by {abs(up):.3g}, downwards by {abs(down):.3g} rad/s a unit"
            )
    edges = sorted({name for pair in slopes.values() for shift in pair for name in shift.edges})
    if edges:
        doubts.append(
            f"beside its value the edge of a limit or of a dead band is near, in {', '.join(edges)}"
        )
    # What the first power of the change leaves out falls out of the two sizes: a half on one side, a quarter on both.
    ratio = 2 if len(slopes) == 1 else 4
    step = (ratio * step - twice) / (ratio - 1)
    if continuous is not None and later is not None:
        continuous = (ratio * continuous - later) / (ratio - 1)
    return Derivative(step, continuous, tuple(doubts))


def _together(values: list[complex]) -> complex:
    return sum(values) / len(values)


def _mean_if_all(values: list[complex | None]) -> complex | None:
    known = [value for value in values if value is not None]
    return _together(known) if len(known) == len(values) else None
