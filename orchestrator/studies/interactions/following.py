"""One mode in four systems: with both vendors of a pair, with each alone, and with neither.

The mode is followed from the system with both, whatever share a vendor holds of it elsewhere: a list of the modes in
which a vendor takes part is another list in each system, and two of them cannot be compared."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from orchestrator.core.errors import AnalysisError, CosimError
from orchestrator.linear.spectra.modes import damping_percent
from orchestrator.linear.spectra.presence import PresenceWay
from orchestrator.studies.interactions.point import SharedMode
from orchestrator.studies.interactions.study import InteractionsPlan, InteractionsResult
from orchestrator.studies.interactions.systems import NONE, Kind, SystemName

_ONE = 1e-3
"""Two eigenvalues of a mode that was followed on two ways are one if they differ by less than this part."""

Follow = Callable[[complex, SystemName, SystemName], complex | None]
"""Gives a mode of one system [rad/s] as it is in another one with fewer or other devices; None if it is not there.
Raises a `CosimError` if that cannot be told."""


@dataclass(frozen=True)
class FollowedMode:
    """A mode of a pair, and the same mode [rad/s] without one of the vendors, and without both.

    ``alone``: in the order of the pair. None if the mode is a vendor's own, and so is not there without it, or if
    ``unknown`` says why it could not be followed."""

    together: SharedMode
    alone: tuple[complex | None, complex | None]
    neither: complex | None
    unknown: str = ""

    @property
    def alone_percent(self) -> tuple[float | None, float | None]:
        return _percent(self.alone[0]), _percent(self.alone[1])

    @property
    def neither_percent(self) -> float | None:
        return _percent(self.neither)

    @property
    def fall(self) -> float | None:
        """How far [points] its damping together lies below the lesser one with a vendor alone; None if not known."""
        known = [percent for percent in self.alone_percent if percent is not None]
        if self.unknown or not known:
            return None
        return min(known) - self.together.damping_percent


def _percent(value: complex | None) -> float | None:
    return None if value is None else damping_percent(value)


def followed(mode: SharedMode, pair: tuple[str, str], follow: Follow) -> FollowedMode:
    both = SystemName(Kind.PAIR, pair)
    systems = [SystemName(Kind.ALONE, (vendor,)) for vendor in pair]
    try:
        first, second = (follow(mode.eigenvalue, both, one) for one in systems)
        ends = [
            follow(value, one, NONE)
            for value, one in zip((first, second), systems, strict=True)
            if value is not None
        ]
    except CosimError as error:
        return FollowedMode(mode, (None, None), None, str(error).splitlines()[0])
    neither = ends[0] if ends else None
    if len(ends) > 1 and not _is_one(ends[0], ends[1]):
        neither = None  # on the two ways it exchanges its nature with different modes
    return FollowedMode(mode, (first, second), neither)


def _is_one(one: complex | None, other: complex | None) -> bool:
    if one is None or other is None:
        return one is other
    return abs(one - other) <= _ONE * abs(one)


class Ways:
    """The ways between the systems of a study; each is made once."""

    def __init__(self, result: InteractionsResult) -> None:
        self._result = result
        self._ways: dict[tuple[SystemName, SystemName], PresenceWay] = {}
        self._found: dict[tuple[complex, SystemName, SystemName], complex | None] = {}

    def follow(self, eigenvalue: complex, begin: SystemName, end: SystemName) -> complex | None:
        key = (eigenvalue, begin, end)
        if key not in self._found:
            if (begin, end) not in self._ways:
                self._ways[begin, end] = self._way(begin, end)
            self._found[key] = self._ways[begin, end].followed_back(eigenvalue)
        return self._found[key]

    def _way(self, begin: SystemName, end: SystemName) -> PresenceWay:
        records = self._result.records
        kept = [records[name].model for name in (end, begin)]
        if kept[0] is None or kept[1] is None:
            raise AnalysisError("one of the systems has no linear model")
        # each identification has states of its own, so what was identified is another device in each system
        apart = {*records[begin].identified, *records[end].identified}
        apart |= _exchanged(self._result.plan, begin, end)
        return PresenceWay(kept[0].model(), kept[1].model(), apart)


def _exchanged(plan: InteractionsPlan, begin: SystemName, end: SystemName) -> set[str]:
    one, other = (_devices(plan.systems[name]) for name in (begin, end))
    return {name for name in {*one, *other} if one.get(name) != other.get(name)}


def _devices(exchanged: Mapping[str, object]) -> dict[str, str]:
    return {name: repr(table) for name, table in exchanged.items()}
