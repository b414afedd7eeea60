"""Names for modes that are known by their shape: each name to one mode, no mode with two names, and none in doubt."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product

import numpy as np

from orchestrator.linear.spectra.modes import Mode

LEAST_ANGLE = 45.0
"""Two groups that swing less than this apart [degrees] swing together. The angle of an inter-area mode falls far below
180 degrees where its damping is high."""

LEAST_SHARE = 0.02  # A group whose participation is below this part of the other's rests in a mode
# A group in which less than this part of the participation is a common motion swings within itself
LEAST_COMMON = 0.5
# A name is in doubt if another mode reaches this part of the measure of the mode that it would go
# to
CLEAR = 0.8
# from this part on it is worth asking which of both the mode was, before something was changed
CONTESTED = 0.5
# from this damping ratio on a mode amplifies nothing, and is no rival of one that does
NO_RESONANCE = 1 / np.sqrt(2)

LEFT_OVER = 0.5
"""A name takes a mode that is not its best one, because that has another name, only from this part of the best one's
measure on."""

_TRIED = 4  # up to this number of names, all ways to give them to the modes that fit best are tried
Measure = Callable[[Mode], float]  # how well a mode fits to a name, from 0 to 1


@dataclass(frozen=True)
class Naming:
    named: Mapping[str, Mode]
    # why a name that fits some mode is borne by none, by name
    reasons: Mapping[str, str] = field(default_factory=dict)
    # names for which another mode fits at least `CONTESTED` as well as the one that fits best
    contested: tuple[str, ...] = ()
    # the best mode of each name with the sum of all measures in view, doubts or not; and what its name measures
    fits: Mapping[str, tuple[Mode, Measure]] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()  # what else is to be known of a name

    @property
    def doubts(self) -> tuple[str, ...]:
        return (*self.reasons.values(), *self.remarks)


def opposition(mode: Mode, side: Sequence[str], other: Sequence[str]) -> float:
    """How much two groups of states, such as speeds, swing against each other in a mode as wholes.

    A state's participation is its part of the mode's energy. The energy of a group's common motion is the sum of its
    participations with their phases: what swings within the group cancels. The measure is the geometric mean of both
    groups' energies times sin²(φ/2) of the angle φ between their motions: the part of two equal motions that lies in
    their difference.

    It is 0 where they are less than `LEAST_ANGLE` apart, or one of them rests or swings within itself."""
    factors = dict(mode.participation)
    one, two = (_common_motion(mode, factors, group) for group in (side, other))
    smaller, larger = sorted((abs(one), abs(two)))
    if smaller <= LEAST_SHARE * larger:
        return 0.0
    cosine = (one * two.conjugate()).real / (smaller * larger)
    return (
        0.0
        if cosine > np.cos(np.radians(LEAST_ANGLE))
        else float(np.sqrt(smaller * larger) * (1 - cosine) / 2)
    )


def _common_motion(mode: Mode, factors: Mapping[str, float], group: Sequence[str]) -> complex:
    """Participation and phase of a group's common motion; 0 where most of its motion is within the group."""
    moving = [(factors[name], mode.shape[name]) for name in group if mode.shape[name]]
    common = sum((factor * shape / abs(shape) for factor, shape in moving), start=0j)
    return common if abs(common) >= LEAST_COMMON * sum(factor for factor, _ in moving) else 0j


def name_modes(modes: Sequence[Mode], measures: Mapping[str, Measure]) -> Naming:
    """Give every name to the mode that fits it, no mode getting two, so that the sum of all measures is largest.

    A name stays free where no mode fits, where two fit about equally, or where the only mode that fits well has another
    name."""
    names = list(measures)
    fit = np.array([[measures[name](mode) for mode in modes] for name in names]).reshape(
        len(names), len(modes)
    )
    column = _assigned(fit)
    named, reasons, contested, fits = {}, {}, [], {}
    for row, name in enumerate(names):
        best = int(fit[row].argmax()) if len(modes) else -1
        if best < 0 or fit[row, best] <= 0:
            continue
        k = column.get(row)
        if k is None or fit[row, k] < LEFT_OVER * fit[row, best]:
            owner = next(row for row, k in column.items() if k == best)
            reasons[name] = _describe_taken(name, modes[best], names[owner])
            continue
        fits[name] = (modes[k], measures[name])
        # such a one is not taken for one without resonance
        resonant = modes[k].damping_ratio < NO_RESONANCE
        alike = [not resonant or mode.damping_ratio < NO_RESONANCE for mode in modes]
        free = [j for j in range(len(modes)) if j != k and j not in column.values() and alike[j]]
        rival = max(free, key=lambda j: fit[row, j], default=None)
        if np.delete(fit[row], k).max(initial=0.0) >= CONTESTED * fit[row, k]:
            contested.append(name)
        if rival is not None and fit[row, rival] >= CLEAR * fit[row, k]:
            reasons[name] = (
                f"no mode is named {name!r}: those at {at_hertz(modes[k])} and {at_hertz(modes[rival])} fit it about "
                f"equally (measures {fit[row, k]:.3g} and {fit[row, rival]:.3g}); look at their shapes, or describe it "
                "by other states"
            )
            continue
        named[name] = modes[k]
    return Naming(named, reasons, tuple(contested), fits)


def _assigned(fit: np.ndarray) -> dict[int, int]:
    """Column of each row, such that the sum is largest."""
    if not fit.size:
        return {}
    if len(fit) <= _TRIED:
        # In a largest sum no row needs more columns than its own best ones, as others take fewer than there are rows.
        best = np.argsort(-fit, axis=1, kind="stable")[:, : len(fit)].tolist()
        ways = (
            way for way in product(*([*columns, None] for columns in best)) if _is_one_to_one(way)
        )
        way = max(
            ways, key=lambda way: sum(fit[row, k] for row, k in enumerate(way) if k is not None)
        )
        return {row: k for row, k in enumerate(way) if k is not None}
    from scipy.optimize import linear_sum_assignment  # noqa: PLC0415 - it takes long, and most cases have few names

    return {
        int(row): int(column)
        for row, column in zip(*linear_sum_assignment(fit, maximize=True), strict=True)
    }


def _is_one_to_one(columns: Sequence[int | None]) -> bool:
    taken = [k for k in columns if k is not None]
    return len(set(taken)) == len(taken)


def _describe_taken(name: str, mode: Mode, owner: str) -> str:
    return (
        f"no mode is named {name!r}: the one that fits it best, at {at_hertz(mode)}, is {owner!r}; describe one of "
        "both by other states"
    )


def at_hertz(mode: Mode) -> str:
    """Its frequency, as sentences tell which mode is meant."""
    return f"{mode.frequency_hz:.4g} Hz"
