"""The reference buses of a RAW file (IDE = 3), some of which have no machine in service.

A study of one machine at an infinite bus leaves out the record of the latter, and programs put a source there."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass

from orchestrator.cases.flow.connected import connected_parts

INFINITE_REACTANCE = 1e-4
"""Reactance behind which an infinite bus holds its voltage [pu of its rating]: the voltage follows the rated current by
0.01 %, and EMT models need no large capacitance there."""


@dataclass(frozen=True)
class References:
    """Reference buses without a machine in service.

    ``infinite``: those that feed what is left of their part of the network, as nothing else does; ``ordinary``: those
    that do not, with the words that say why."""

    infinite: tuple[int, ...]
    ordinary: Mapping[int, str]


def references_without_machine(
    references: Sequence[int],
    fed: Collection[int],
    buses: Collection[int],
    ends: Sequence[tuple[int, int]],
) -> References:
    """Sort the reference buses of a file at which no machine is in service.

    ``fed``: buses with machines; ``ends``: the buses of each branch in service."""
    part = connected_parts(buses, ends)
    infinite: list[int] = []
    ordinary: dict[int, str] = {}
    for bus in (bus for bus in references if bus not in fed):
        beside = [other for other in part if part[other] == part[bus]]
        other = next((x for x in _others(references, part, bus) if x in fed or x in infinite), None)
        if len(beside) == 1:
            ordinary[bus] = "nothing is connected to it, so it is none"
        elif other is not None:
            ordinary[bus] = (
                f"an ordinary bus here, and {other}, a reference too, feeds what is left"
            )
        else:
            infinite.append(bus)
    return References(tuple(infinite), ordinary)


def _others(references: Sequence[int], part: Mapping[int, int], bus: int) -> Iterator[int]:
    return (other for other in references if other != bus and part[other] == part[bus])
