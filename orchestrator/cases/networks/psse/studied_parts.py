"""Parts of a network that only DC lines join, or nothing: a study takes one of them."""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from operator import attrgetter
from typing import TypeVar

import numpy as np

from orchestrator.cases.flow.connected import connected_parts
from orchestrator.cases.form.remedies import with_slack
from orchestrator.cases.networks.conversion import ImportedNetwork, bus_of
from orchestrator.cases.networks.psse.devices import HeldDevice
from orchestrator.core.errors import few

Element = TypeVar("Element")

_SHOWN = 3  # buses that are named; the others are counted


@dataclass(frozen=True)
class SystemApart:
    """Buses of other parts with machines, to which nothing leads.

    ``fed_mw``: power that is fed there; ``machine_bus``: one with a machine, by which a case chooses its part."""

    buses: frozenset[str] = frozenset()
    fed_mw: float = 0.0
    machine_bus: str = ""


@dataclass(frozen=True)
class StudiedPart:
    """One part of a network, and the buses of others, which are left out.

    ``by_dc``: buses to which DC lines lead; ``apart``: those of parts with a reference of their own, to which nothing
    leads; ``unreferred``: those of parts with machines but no reference; ``dead``: buses without a machine, to which
    nothing leads."""

    network: ImportedNetwork
    buses: frozenset[
        str
    ]  # of the part; others that the network has as well are refused by its power flow
    by_dc: frozenset[str] = frozenset()
    apart: SystemApart = SystemApart()
    unreferred: SystemApart = SystemApart()
    dead: frozenset[str] = frozenset()

    @property
    def left_buses(self) -> frozenset[str]:
        """Return the buses that are left out."""
        return self.by_dc | self.apart.buses | self.unreferred.buses | self.dead


def choose_part(
    network: ImportedNetwork,
    devices: Sequence[HeldDevice],
    references: Collection[str],
    slack: str | None = None,
) -> StudiedPart:
    """Return the part with the slack, or else of those with machines and a reference the one that has the most buses.

    Where no part with machines has a reference, that with the most buses is taken. Every other part is left out.

    ``references``: the buses that the source names as references, in its order; ``slack``: the bus that a case names as
    its own."""
    part = _parts(network)
    sizes = np.bincount(list(part.values()))
    fed = {part[bus] for bus in network.generation}
    if len(sizes) == 1 or not fed:
        return StudiedPart(network, frozenset(network.buses))
    referred = {part[bus] for bus in references if bus in part}
    candidates = sorted(fed & referred or fed)
    studied = (
        part[slack] if slack in part else max(candidates, key=lambda number: int(sizes[number]))
    )
    joined = _joins(devices, part)
    others = {bus: number for bus, number in part.items() if number != studied}
    by_dc = frozenset(bus for bus, number in others.items() if number in joined)
    rest = {bus: number for bus, number in others.items() if bus not in by_dc}
    dead = frozenset(bus for bus, number in rest.items() if number not in fed)
    with_reference = [bus for bus, number in rest.items() if number in fed & referred]
    without = [bus for bus, number in rest.items() if number in fed - referred]
    own = next((bus for bus in references if part.get(bus) == studied), None)
    found = StudiedPart(
        network,
        buses=frozenset(bus for bus, number in part.items() if number == studied),
        by_dc=by_dc,
        apart=_apart(network, references, with_reference),
        unreferred=_apart(network, references, without),
        dead=dead,
    )
    return replace(found, network=_without(replace(network, slack=own), found.left_buses))


def _apart(
    network: ImportedNetwork, references: Collection[str], buses: Collection[str]
) -> SystemApart:
    """Return what parts with machines feed, and of the buses that feed it the reference, or that which feeds most."""
    fed = {bus: feeds.p_mw for bus, feeds in network.generation.items() if bus in buses}
    if not fed:
        return SystemApart()
    named = next((bus for bus in references if bus in fed), max(fed, key=fed.__getitem__))
    return SystemApart(frozenset(buses), sum(fed.values()), named)


def _joins(devices: Sequence[HeldDevice], part: dict[str, int]) -> set[int]:
    """Return the parts that devices join to others."""
    joined = set[int]()
    for device in devices:
        own = {part[bus] for number in device.places if (bus := bus_of(str(number))) in part}
        joined |= own if len(own) > 1 else set()
    return joined


def _without(network: ImportedNetwork, left: frozenset[str]) -> ImportedNetwork:
    def outside(
        elements: Iterable[Element], bus_of: Callable[[Element], str]
    ) -> tuple[Element, ...]:
        return tuple(x for x in elements if bus_of(x) not in left)

    def at_others(by_bus: Mapping[str, Element]) -> dict[str, Element]:
        return {bus: x for bus, x in by_bus.items() if bus not in left}

    return replace(
        network,
        buses=outside(network.buses, str),
        lines=outside(network.lines, attrgetter("from_bus")),
        loads=outside(network.loads, attrgetter("bus")),
        shunts=outside(network.shunts, attrgetter("bus")),
        transformers=outside(network.transformers, lambda x: x.buses[0]),
        generation=at_others(network.generation),
        feeding=at_others(network.feeding),
        capacitors=at_others(network.capacitors),
    )


def _parts(network: ImportedNetwork) -> dict[str, int]:
    """Return the number of the connected part of each bus."""
    ends = [(line.from_bus, line.to_bus) for line in network.lines]
    ends += [(x.buses[0], bus) for x in network.transformers for bus in x.buses[1:]]
    return connected_parts(network.buses, ends)


def part_notes(part: StudiedPart) -> list[str]:
    """Return what is said of the buses that are left out."""
    found = []
    if part.by_dc:
        found.append(
            f"only DC lines lead to {_names(part.by_dc)}: a part with a frequency of its own, which is left out; the "
            "DC lines feed here what they do at the file's voltages there"
        )
    if part.apart.buses:
        found.append(
            f"{_not_joined(part.apart)}: a system of its own, with a reference of its own, which is left out. To study "
            f"it instead, name one of its buses with a machine, such as {with_slack(part.apart.machine_bus)}"
        )
    if part.unreferred.buses:
        found.append(
            f"{_not_joined(part.unreferred)}, and none is a reference (IDE = 3), without which PSS/E refuses the file: "
            "left out. If a branch is open by mistake, close it in the file. To study that part instead, name one of "
            f"its buses with a machine, such as {with_slack(part.unreferred.machine_bus)}"
        )
    if part.dead:
        found.append(
            f"no branch and no DC line lead to {_names(part.dead)}, and no machine feeds there: left out, as PSS/E "
            "does with what has no reference. If a branch is open by mistake, close it in the file"
        )
    return found


def _not_joined(apart: SystemApart) -> str:
    return f"no branch leads to {_names(apart.buses)}, where machines feed {apart.fed_mw:.4g} MW"


def _names(buses: Collection[str]) -> str:
    return few(sorted(buses), _SHOWN)


def reference_note(bus: str) -> str:
    """Return what is said of a network without a reference, of which a bus becomes one."""
    return (
        f"no bus of the network that is studied is the reference (IDE = 3), without which PSS/E solves nothing: {bus}, "
        "which has the largest machines, is taken, and feeds what is left. If that is right, or another bus is to, "
        f"name it, such as {with_slack(bus)}"
    )
