"""The areas of the grid, and the components of each."""

import fnmatch
from collections.abc import Iterable, Mapping, Sequence

from orchestrator.systems.coupling.system import System


def areas_of(areas: Mapping[str, Sequence[str]], system: System) -> dict[str, str]:
    """Area of every component that has one.

    ``areas``: patterns by area. A component belongs to the first area with a pattern that fits its own name, or the bus
    (the scope of the variables) that feeds it."""
    return {name: found[0] for name, found in _fitting(areas, system).items()}


def in_two_areas(areas: Mapping[str, Sequence[str]], system: System) -> dict[str, list[str]]:
    """Areas of every component that the patterns of more than one fit; the first counts."""
    return {name: found for name, found in _fitting(areas, system).items() if len(found) > 1}


def _fitting(areas: Mapping[str, Sequence[str]], system: System) -> dict[str, list[str]]:
    homes: dict[str, set[str]] = {name: {name} for name in system.components}
    for wire in system.connections:
        homes[wire.target.component].add(wire.source.variable.rpartition(".")[0])

    def areas_of(known_as: Iterable[str]) -> list[str]:
        names = list(known_as)
        fits = (
            area for area, patterns in areas.items() for x in patterns if fnmatch.filter(names, x)
        )
        return list(dict.fromkeys(fits))

    found = {name: areas_of(known_as) for name, known_as in homes.items()}
    return {name: fitting for name, fitting in found.items() if fitting}
