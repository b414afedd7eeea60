"""Area, zone, owner and station of every bus, as a network's file names them.

They say to whom a bus belongs, and change nothing in the network."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

_BETWEEN = " – "
_NUMBERED = ("area", "zone", "owner")
KINDS = (*_NUMBERED, "station")


@dataclass(frozen=True, slots=True)
class Region:
    """Region that a bus belongs to: number and name, such as ``2 EAST``; "" where the file says nothing."""

    area: str = ""
    zone: str = ""
    owner: str = ""
    station: str = ""

    def of(self, kind: str) -> str:
        return str(getattr(self, kind))

    @property
    def in_words(self) -> str:
        """Return ``area 2 EAST, zone 3, owner 1 GRID, station NORTH``."""
        return ", ".join(f"{kind} {name}" for kind, name in self.as_json().items())

    def as_json(self) -> dict[str, str]:
        """Return what the file says, by kind."""
        return {kind: self.of(kind) for kind in KINDS if self.of(kind)}


@dataclass(frozen=True)
class Regions:
    """Regions of a network's buses; kinds of which the whole network has one without a name are left out.

    Attributes
    ----------
    at
        Region by bus.
    """

    at: Mapping[str, Region] = field(default_factory=dict)

    @classmethod
    def telling(cls, at: Mapping[str, Region], buses: Iterable[str]) -> "Regions":
        """Regions of some buses, without numbers that tell nothing apart."""
        found = {bus: at[bus] for bus in buses if bus in at}
        names = {kind: {region.of(kind) for region in found.values()} for kind in KINDS}
        kept = [kind for kind, own in names.items() if len(own) > 1 or _is_named(own)]
        told = {
            bus: Region(**{kind: region.of(kind) for kind in kept}) for bus, region in found.items()
        }
        return cls(told if kept else {})

    @property
    def has_areas(self) -> bool:
        """Return whether the network has several areas."""
        return len({region.area for region in self.at.values()}) > 1

    def of(self, bus: str) -> Region:
        """Return the region of a bus; that of nothing for a bus that the file lacks."""
        return self.at.get(bus, Region())

    def area_of(self, *buses: str) -> str:
        """Return the area of buses, ``1 WEST – 2 EAST`` for a branch between two; "" if the network has only one."""
        if not self.has_areas:
            return ""
        return _BETWEEN.join(dict.fromkeys(filter(None, (self.of(bus).area for bus in buses))))

    def buses_by(self, kind: str) -> dict[str, list[str]]:
        """Return the buses of each region of a kind, in the order of the network's buses."""
        found: dict[str, list[str]] = {}
        for bus, region in self.at.items():
            found.setdefault(region.of(kind), []).append(bus)
        found.pop("", None)
        return found


def _is_named(names: Iterable[str]) -> bool:
    return any(name and not name.isdigit() for name in names)


def with_name(number: int, names: Mapping[int, str]) -> str:
    """Return number and name, ``2 EAST``; the number alone where the file has no name for it, or the number as one."""
    name = names.get(number, "")
    return f"{number} {name}" if name not in ("", str(number)) else str(number)
