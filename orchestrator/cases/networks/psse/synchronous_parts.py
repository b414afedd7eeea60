"""Parts of a network that only DC lines join: they run at frequencies of their own, and a study takes one of them."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from orchestrator.cases.flow.connected import connected_parts
from orchestrator.cases.networks.conversion import ImportedNetwork, bus_of
from orchestrator.cases.networks.psse.devices import HeldDevice


@dataclass(frozen=True)
class SynchronousPart:
    """The largest part of a network, and the buses of others that DC lines join to it."""

    network: ImportedNetwork
    left: frozenset[str] = frozenset()


def synchronous_part(
    network: ImportedNetwork, devices: Sequence[HeldDevice], references: Collection[str]
) -> SynchronousPart:
    """Return the part with the most buses of all that devices join; the network itself where none joins any.

    ``references``: the buses that the source names as references, in its order."""
    part = _parts(network)
    joined = set[int]()
    for device in devices:
        own = {part[bus] for number in device.places if (bus := bus_of(str(number))) in part}
        joined |= own if len(own) > 1 else set()
    if not joined:
        return SynchronousPart(network)
    sizes = np.bincount(list(part.values()))
    largest = max(joined, key=lambda k: int(sizes[k]))
    left = frozenset(bus for bus, k in part.items() if k in joined and k != largest)
    slack = next((bus for bus in references if part.get(bus) == largest), None)
    kept = replace(
        network,
        buses=tuple(bus for bus in network.buses if bus not in left),
        lines=tuple(x for x in network.lines if x.from_bus not in left),
        loads=tuple(x for x in network.loads if x.bus not in left),
        shunts=tuple(x for x in network.shunts if x.bus not in left),
        transformers=tuple(x for x in network.transformers if x.buses[0] not in left),
        generation={bus: g for bus, g in network.generation.items() if bus not in left},
        feeding={bus: p for bus, p in network.feeding.items() if bus not in left},
        capacitors={bus: q for bus, q in network.capacitors.items() if bus not in left},
        slack=slack,
    )
    return SynchronousPart(kept, left)


def _parts(network: ImportedNetwork) -> dict[str, int]:
    """Return the number of the connected part of each bus."""
    ends = [(line.from_bus, line.to_bus) for line in network.lines]
    ends += [(x.buses[0], bus) for x in network.transformers for bus in x.buses[1:]]
    return connected_parts(network.buses, ends)
