"""Summary of a screening: its modes with their worst points, durations of damping, counts, and a verdict."""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from orchestrator.core.errors import few
from orchestrator.linear.spectra.modes import damping_percent
from orchestrator.studies.operating_points.item import Status
from orchestrator.studies.screening.study import ScreenedItem, ScreeningResult

_LEADING = 2
_ALIKE = 0.8  # likeness of shares above which two modes are one
_FREQUENCY = 0.15  # part of the frequency within which they are

_SHOWN = 5
_FEW = 4  # units beyond their rating that are named beside the worst


@dataclass(frozen=True)
class ModeAt:
    """A mode at one operating point with one outage: the item, and its place there."""

    item: ScreenedItem
    place: int

    @property
    def value(self) -> complex:
        return complex(self.item.record.eigenvalues[self.place])

    @property
    def damping(self) -> float:
        return damping_percent(self.value)

    @property
    def frequency(self) -> float:
        return self.value.imag / (2 * np.pi)

    def participation(self, most: int | None = _SHOWN) -> list[tuple[str, float]]:
        """Components that take part most, and their factors."""
        shares = [
            (name, float(values[self.place])) for name, values in self.item.record.shares.items()
        ]
        return sorted(shares, key=lambda entry: -entry[1])[:most]

    def ranking(self, most: int | None = _SHOWN) -> list[tuple[str, complex, complex]]:
        """Converters by what a damping controller there would move the mode, the largest first.

        Returns name, and residues from its active and its reactive power reference to its frequency [rad/s by pu on its
        rating]. Their size is the shift of the eigenvalue by unit gain of a controller whose phase is right, as long as
        the gain is small."""
        found = [
            (name, complex(values[0, self.place]), complex(values[1, self.place]))
            for name, values in self.item.record.residues.items()
        ]
        return sorted(found, key=lambda entry: -max(abs(entry[1]), abs(entry[2])))[:most]


def least_of(item: ScreenedItem) -> ModeAt | None:
    """Its least damped critical mode; None where it has none."""
    return ModeAt(item, item.record.critical[0]) if item.record.critical else None


@dataclass(frozen=True)
class SwingAbove:
    """The least damped swing of machines above the range at an item, and who takes part most in it."""

    item: ScreenedItem
    frequency: float  # [Hz]
    damping: float  # [%]
    who: str

    @classmethod
    def of(cls, item: ScreenedItem) -> "SwingAbove | None":
        """Read it from an item's record; None where no swing was found there."""
        if item.record.above is None:
            return None
        value = complex(*item.record.above)
        hertz = value.imag / (2 * np.pi)
        return cls(item, hertz, damping_percent(value), item.record.who_above)


def less_damped_above(item: ScreenedItem, wanted: float) -> SwingAbove | None:
    """Return the swing above the range where it is damped less than all within it, and less than what is wanted.

    ``wanted``: damping [%] below which modes are critical."""
    above, least = SwingAbove.of(item), least_of(item)
    within = wanted if least is None else least.damping
    return above if above is not None and above.damping < within else None


@dataclass(frozen=True)
class ScreenedMode:
    name: str
    worst: ModeAt
    at: tuple[ModeAt, ...]

    @property
    def hours(self) -> float:
        """How long the intact network has it among the critical ones [h]."""
        return sum(mode.item.point.hours for mode in self.at if not mode.item.outage.elements)


class Summary:
    def __init__(self, result: ScreeningResult) -> None:
        self.result = result
        self.counts = Counter(item.record.status for item in result.items)
        self.unstable = [item for item in result.items if item.record.stable is False]
        self.runs = [item for item in result.items if item.record.run is not None]
        ran = [(item, item.record.run) for item in self.runs]
        self.tripping = [item for item, run in ran if run is not None and run.trips]
        self.gone_wrong = [item for item, run in ran if run is not None and run.went_wrong]
        self.free = [item for item in result.items if item.record.zeros > 1]
        self.widened = [item for item in result.items if item.record.widenings]
        self.modes = self._modes()

    @property
    def beyond(self) -> str:
        """At how many judged items a unit is beyond its rating or its reactive power, and which one; "" where none
        is."""
        judged = [item for item in self.result.items if item.record.status is Status.COMPUTED]
        total = f"{len(judged)}{'' if len(judged) == len(self.result.items) else ' judged'}"
        fed = [one for item in judged if (one := item.record.reactive)]
        worst = [
            max((load, name, where(self, item)) for name, load in item.record.beyond.items())
            for item in judged
            if item.record.beyond
        ]
        told = (
            [f"at {len(fed)} of {total} limits of reactive power are exceeded: {fed[0]}"]
            if fed
            else []
        )
        if worst:
            load, unit, at = max(worst)
            most = f"most {unit} with {100 * load:.3g} % ({at})"
            others = sorted({name for one in judged for name in one.record.beyond} - {unit})
            most += f", also {few(others, _FEW)}" if others else ""
            told.insert(0, f"at {len(worst)} of {total} a unit is beyond its rating, {most}")
        return "; ".join(told)

    @property
    def stable(self) -> bool | None:
        """Return whether nothing grows anywhere; None where an item has no verdict, or is missing, and none grows.

        In runs of outages nothing may lose synchronism; where relays trip, what they leave has no verdict."""
        bad = self.unstable or self.gone_wrong
        return self.stable_here if bad or self.result.complete else None

    @property
    def stable_here(self) -> bool | None:
        """The same of the items that are there: of a part alone."""
        if self.unstable or self.gone_wrong:
            return False
        if self.tripping:
            return None
        return True if all(item.record.stable for item in self.result.items) else None

    @property
    def counted_items(self) -> int:
        return sum(item.record.counted for item in self.result.items)

    @property
    def slowest(self) -> float:
        """Growth [1/s] from which it was counted at all frequencies, wherever it was; slower growth outside of the
        range was sought near 0 only. 0 where all eigenvalues are known everywhere."""
        return max((item.record.slowest for item in self.result.items), default=0.0)

    def failures(self) -> Iterator[ScreenedItem]:
        return (item for item in self.result.items if item.record.status is not Status.COMPUTED)

    def least_damped(self) -> list[ModeAt]:
        """The least damped critical mode of every item that has one, the worst first."""
        return sorted(filter(None, map(least_of, self.result.items)), key=lambda mode: mode.damping)

    def least_above(self) -> SwingAbove | None:
        """The least damped swing of machines above the range, of all items; None where none was found."""
        computed = (one for one in self.result.items if one.record.status is Status.COMPUTED)
        found = filter(None, map(SwingAbove.of, computed))
        return min(found, key=lambda swing: swing.damping, default=None)

    def _modes(self) -> list[ScreenedMode]:
        followed: dict[int, list[ModeAt]] = {}
        for item in self.result.items:
            for place in item.record.critical:
                followed.setdefault(item.trajectories[place], []).append(ModeAt(item, place))
        modes = []
        for at in _joined(list(followed.values()), self.result.items):
            worst = min(at, key=lambda mode: mode.damping)
            who = ", ".join(name for name, _ in worst.participation(_LEADING))
            modes.append(ScreenedMode(f"{worst.frequency:.2f} Hz ({who})", worst, tuple(at)))
        return sorted(modes, key=lambda mode: mode.worst.damping)


def where(summary: Summary, item: ScreenedItem) -> str:
    """An item's point and outage; the outage alone where there is one point only."""
    names = (item.point.name, item.outage.name)
    return ", ".join(names if len(summary.result.plan.points) > 1 else names[1:])


def _joined(groups: list[list[ModeAt]], items: Sequence[ScreenedItem]) -> list[list[ModeAt]]:
    """Trajectories as modes: one that ends where another begins is the same mode, where frequency and shares agree.

    After an outage those who take part in a mode may change so much that it was not followed. Two trajectories with one
    item in common are two modes, however alike."""
    found: list[tuple[list[ModeAt], set[int]]] = []
    for group in sorted(groups, key=len, reverse=True):
        own = {id(one.item) for one in group}
        likeness = [
            (_likeness(known, group), k) for k, (known, at) in enumerate(found) if not at & own
        ]
        best, place = max(likeness, default=(0.0, -1))
        if best > _ALIKE:
            found[place][0].extend(group)
            found[place][1].update(own)
        else:
            found.append((list(group), own))
    order = {id(item): k for k, item in enumerate(items)}
    return [sorted(group, key=lambda one: order[id(one.item)]) for group, _ in found]


def _likeness(known: Sequence[ModeAt], other: Sequence[ModeAt]) -> float:
    """How alike the shares are at the points that two trajectories have in common; 0 at frequencies too far apart."""
    one = other[0]
    here = [mode for mode in known if mode.item.point is one.item.point] or known
    near = min(here, key=lambda mode: abs(mode.frequency - one.frequency))
    if abs(near.frequency - one.frequency) > _FREQUENCY * one.frequency:
        return 0.0
    shares = [dict(mode.participation(None)) for mode in (near, one)]
    names = sorted(set(shares[0]) & set(shares[1]))  # who is out of service takes part in neither
    a, b = (np.array([share[name] for name in names]) for share in shares)
    size = float(np.linalg.norm(a) * np.linalg.norm(b))
    return float(a @ b) / size if size else 0.0


def duration(
    mode: ScreenedMode, *, outages: bool = False
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """A damping-duration curve: for how long the damping is at most so much.

    Returns hours and damping ratios [%], both rising."""
    least: dict[str, tuple[float, float]] = {}
    for one in mode.at:
        if outages or not one.item.outage.elements:
            point = one.item.point
            known = least.get(point.name, (point.hours, np.inf))
            least[point.name] = point.hours, min(known[1], one.damping)
    ordered = sorted(least.values(), key=lambda entry: entry[1])
    return np.cumsum([hours for hours, _ in ordered]), np.array([damping for _, damping in ordered])
