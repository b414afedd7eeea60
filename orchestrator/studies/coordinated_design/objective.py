"""Worth of a setting over all operating points: its worst damping ratio, and what it does to the other modes."""

from bisect import bisect_right
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from orchestrator.core.arrays import Complex
from orchestrator.linear.spectra.modes import (
    ELECTROMECHANICAL_HZ,
    ZERO,
    Mode,
    damping_ratio,
    make_mode,
    oscillations,
)
from orchestrator.linear.spectra.stability import grows
from orchestrator.studies.coordinated_design.open_loops import (
    LEAD,
    ClosedLoop,
    OpenLoops,
    PodPlace,
    Setting,
)

BANDS_HZ = (*ELECTROMECHANICAL_HZ, 10.0, 100.0)
"""Between these frequencies [Hz] other modes are compared with those that were there before."""

# the least damping ratio of a band may become worse by this where it is below the bound already
ALLOWED = 1e-3
UNMOVED = 0.02
"""Loops hardly move a mode that all of them together move by less than this part of its size, by their largest gains.
It counts as others do; beside it a search raises the least damping of the rest."""

APART = 1e-3
"""Modes that all loops together move by less than this part of their size, a tenth of a point of damping, by their
largest gains stand apart: a search neither damps them nor lets them lose as much, and a verdict names them."""

_HELD = 1e-5
"""No loop moves a mode that all of them move by less than this part of its size, with the most lead on top: where the
converter is out of service. A search leaves it as it is."""

Naming = Callable[[Sequence[str], list[Mode]], Mapping[str, Mode]]
"""Gives the modes that a case names, from the names of the states and the candidates."""


@dataclass(frozen=True)
class Aim:
    """Which modes a design damps, and the damping ratio below which it may push no other."""

    names: tuple[str, ...]  # of the case's modes; none for all electromechanical ones
    least: float
    naming: Naming | None = None  # gives the named modes; None where none is named


@dataclass(frozen=True)
class Watched:
    value: complex  # λ [rad/s]
    place: int  # in its spectrum
    # damping ratio that it may not fall below; None for a mode that the design damps
    floor: float | None
    hardly_moved: bool = False

    @property
    def damping(self) -> float:
        return damping_ratio(self.value)


def band_of(value: complex) -> int:
    """Number of the band of frequencies that an eigenvalue [rad/s] lies in."""
    return bisect_right(BANDS_HZ, value.imag / (2 * np.pi))


_SWINGING = band_of(2j * np.pi)


def floors_of(values: Iterable[complex], least: float) -> dict[int, float]:
    """The damping ratio, by band, that other modes may not fall below.

    ``values``: the other modes without the controllers [rad/s], one of each pair.
    ``least``: the bound; a band that has a mode below it keeps what it has, less `ALLOWED`."""
    floors = dict.fromkeys(range(len(BANDS_HZ) + 1), least)
    for value in values:
        band = band_of(value)
        floors[band] = min(floors[band], damping_ratio(value) - ALLOWED)
    return floors


def split(
    values: Complex, targets: Iterable[int] | None, floors: Mapping[int, float]
) -> list[Watched]:
    """All oscillations of a spectrum, with what is asked of each.

    ``values``: all eigenvalues [rad/s].
    ``targets``: places of the modes that the design damps; None for all electromechanical ones.
    ``floors``: as `floors_of` gives them."""
    chosen = None if targets is None else set(targets)
    found = []
    for place in np.flatnonzero(oscillations(values)).tolist():
        value, band = complex(values[place]), band_of(complex(values[place]))
        wanted = band == _SWINGING if chosen is None else place in chosen
        found.append(Watched(value, place, None if wanted else floors[band]))
    return found


def kept_as_they_are(watched: Sequence[Watched], values: Iterable[complex]) -> list[Watched]:
    """The modes, of which those that are next to some values [rad/s] are not damped, and keep what these have."""
    found = list(watched)
    wanted = tuple(values)
    for k, value in zip(places_next_to(watched, wanted), wanted, strict=True):
        if k is not None:
            found[k] = replace(found[k], floor=damping_ratio(value) - ALLOWED)
    return found


def nearest(watched: Sequence[Watched], value: complex) -> int | None:
    """Which of the modes is that of a value [rad/s] that hardly moves; None if none is near."""
    (found,) = places_next_to(watched, [value])
    return found


def places_next_to(watched: Sequence[Watched], values: Sequence[complex]) -> list[int | None]:
    """For each value which of the modes `nearest` gives."""
    if not (watched and values):
        return [None] * len(values)
    wanted = np.array(values)
    distances = np.abs(wanted[:, None] - np.array([mode.value for mode in watched]))
    closest = distances.argmin(axis=1)
    near = distances[np.arange(len(wanted)), closest] < UNMOVED * np.abs(wanted)
    return [k if is_near else None for k, is_near in zip(closest.tolist(), near, strict=True)]


def growth(values: Complex) -> float:
    """The largest real part [1/s] of a spectrum; 0 where nothing grows."""
    values = values[grows(values) & (np.abs(values) > ZERO)]
    return float(values.real.max()) if len(values) else 0.0


@dataclass(frozen=True)
class Worth:
    worst: float  # least damping ratio of the modes that the design damps; 1 where there are none
    # by how much another mode is below its floor, or the system grows more than before [1/s]; at most 0 if neither
    breach: float
    point: int = 0  # number of the point with the least damping
    # least damping ratio of those that the loops move more than hardly; at least ``worst``
    rest: float = 1.0

    @property
    def allowed(self) -> bool:
        return self.breach <= _ROUNDING


_ROUNDING = 1e-7


def worth_of(
    watched: Sequence[Watched], growing: float, growing_before: float, point: int = 0
) -> Worth:
    damped = [mode for mode in watched if mode.floor is None]
    worst = min((mode.damping for mode in damped), default=1.0)
    rest = min((mode.damping for mode in damped if not mode.hardly_moved), default=worst)
    short = max(
        (mode.floor - mode.damping for mode in watched if mode.floor is not None), default=-1.0
    )
    more = growing - max(growing_before, 0.0)
    return Worth(worst, max(short, more if more > _ROUNDING else -1.0), point, rest)


class RatedPoint:
    """One operating point of the search: its loops, and what its modes may not fall below.

    ``largest``: the largest gain of every loop that may be closed [pu]; None where all modes count, also those that no
    loop moves, save those that are ``apart``.
    ``apart``: eigenvalues of the open loops [rad/s] that stand apart. With ``largest`` they are found: all loops are in
    service here and move another mode, and no mode is named, since one that is asked for always counts."""

    def __init__(
        self,
        number: int,
        loops: OpenLoops,
        aim: Aim,
        largest: Mapping[PodPlace, float] | None,
        apart: Sequence[complex] = (),
    ) -> None:
        self.number, self.loops, self._aim = number, loops, aim
        self.apart = tuple(apart)
        self._held: tuple[complex, ...] = ()
        self._hardly: tuple[complex, ...] = ()
        closed = self.loops.solve({})
        values, targets = closed.values, self._named_places(closed)
        self._before = growth(values)
        modes = split(values, targets, floors_of((), 0.0))
        self._floors = floors_of(
            (mode.value for mode in modes if mode.floor is not None), aim.least
        )
        if largest is None:
            return
        gains = np.array([largest.get(place, 0.0) for place in loops.places])
        damped = [mode for mode in modes if mode.floor is None]
        reach = np.abs(self._residues([mode.place for mode in damped], closed)) @ gains
        parts = [
            (mode.value, size / abs(mode.value))
            for mode, size in zip(damped, reach.tolist(), strict=True)
        ]
        in_service = all(place in loops.places for place in largest)
        if targets is None and in_service and any(part >= APART for _, part in parts):
            self.apart = tuple(value for value, part in parts if part < APART)
        counting = [(value, part) for value, part in parts if value not in self.apart]
        self._held = tuple(value for value, part in counting if LEAD * part < _HELD)
        self._hardly = tuple(
            value for value, part in counting if LEAD * part >= _HELD and part < UNMOVED
        )

    def _residues(self, places: Sequence[int], closed: ClosedLoop) -> Complex:
        """How far each loop moves eigenvalues with all loops open [rad/s per pu], shape (modes, loops)."""
        left, right = closed.vectors(places)
        rows = left.conj().T
        lengths = np.sum(rows * right.T, axis=1)[:, None]
        return np.asarray((rows @ self.loops.U) * (self.loops.V @ right).T / lengths, dtype=complex)

    def _split(self, values: Complex, targets: Iterable[int] | None) -> list[Watched]:
        """The modes; those that no loop moves, or hardly any gain, are not damped but kept as they are."""
        found = kept_as_they_are(split(values, targets, self._floors), (*self._held, *self.apart))
        for k in places_next_to(found, self._hardly):
            if k is not None:
                found[k] = replace(found[k], hardly_moved=True)
        return found

    def _named_places(self, closed: ClosedLoop) -> list[int] | None:
        """Places of the named modes; None where one of the names is not borne here, so that all modes count."""
        if self._aim.naming is None:
            return None
        # without those that a reduction left out
        values = closed.values[: closed.own]
        places = [
            k
            for k in np.flatnonzero(oscillations(values)).tolist()
            if band_of(values[k]) == _SWINGING
        ]
        left, right = closed.vectors(places)
        names = self.loops.all_names(len(left))
        left, right = self.loops.whole(left, left=True), self.loops.whole(right)
        modes = {
            k: make_mode(complex(values[k]), left[:, j], right[:, j], names)
            for j, k in enumerate(places)
        }
        found = self._aim.naming(names, list(modes.values()))
        if any(name not in found for name in self._aim.names):
            return None
        wanted = [found[name] for name in self._aim.names]
        return [k for k, mode in modes.items() if any(mode is one for one in wanted)]

    def worth(self, setting: Setting) -> Worth:
        if self._aim.naming is None:
            values, targets = self.loops.eigenvalues(setting), None
        else:
            closed = self.loops.solve(setting)
            values, targets = closed.values, self._named_places(closed)
        return worth_of(self._split(values, targets), growth(values), self._before, self.number)

    def residues(self) -> dict[PodPlace, complex]:
        """How far each loop moves the least damped of the modes that any moves [rad/s per pu]; empty without one."""
        watched, closed = self.watched({})
        worst = min(
            (mode for mode in watched if mode.floor is None),
            key=lambda mode: mode.damping,
            default=None,
        )
        if worst is None:
            return {}
        (shifts,) = self._residues([worst.place], closed).tolist()
        return dict(zip(self.loops.places, shifts, strict=True))

    def watched(self, setting: Setting) -> tuple[list[Watched], ClosedLoop]:
        """Its modes with a setting, and the closed loops that have them."""
        closed = self.loops.solve(setting)
        return self._split(closed.values, self._named_places(closed)), closed


def together(worths: Iterable[Worth]) -> Worth:
    """The worth over all operating points: the least damping, and the worst breach."""
    found = list(worths)
    worst = min(found, key=lambda worth: worth.worst)
    rest = min(worth.rest for worth in found)
    return Worth(worst.worst, max(worth.breach for worth in found), worst.point, rest)


def worth_of_all(
    loops: OpenLoops, setting: Setting, aim: Aim, apart: Sequence[complex] = ()
) -> Worth:
    """Return the worth of a setting at a point, where all modes to be damped count, also those that no loop moves;
    those that stand apart do not."""
    return RatedPoint(0, loops, aim, None, apart).worth(setting)
