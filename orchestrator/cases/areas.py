"""Which area of the grid a component belongs to."""

import fnmatch
from collections.abc import Mapping, Sequence

from orchestrator.coupling.system import System


def areas_of(areas: Mapping[str, Sequence[str]], system: System) -> dict[str, str]:
    """Area of every component that has one.

    Parameters
    ----------
    areas
        Patterns by area. A component belongs to the first area with a pattern that fits its own name, or the
        bus (the scope of the variables) that feeds it.
    system
        Components and connections.
    """
    homes: dict[str, set[str]] = {name: {name} for name in system.components}
    for wire in system.connections:
        homes[wire.target.component].add(wire.source.variable.rpartition(".")[0])
    found: dict[str, str] = {}
    for name, known_as in homes.items():
        for area, patterns in areas.items():
            if any(fnmatch.fnmatchcase(alias, pattern) for alias in known_as for pattern in patterns):
                found[name] = area
                break
    return found
