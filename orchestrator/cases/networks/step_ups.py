"""Transformers of single units: branches that alone lead to a bus with one unit and nothing else."""

from collections import Counter
from collections.abc import Mapping

from fmus.grid.network import Network


def own_branches(network: Network, units: Mapping[str, str]) -> dict[str, str]:
    """Return the branches without charging that alone lead to a bus with one unit and nothing else.

    Parameters
    ----------
    network
        The network.
    units
        Unit → its bus.

    Returns
    -------
    dict
        Branch → the unit whose it is.
    """
    return {branch: of[0] for branch, of in shared_branches(network, units).items() if len(of) == 1}


def shared_branches(network: Network, units: Mapping[str, str]) -> dict[str, tuple[str, ...]]:
    """Return the branches without charging that alone lead to a bus with units and nothing else.

    Parameters
    ----------
    network
        The network.
    units
        Unit → its bus.

    Returns
    -------
    dict
        Branch → the units behind it.
    """
    ends = Counter(bus for line in network.lines for bus in (line.from_bus, line.to_bus))
    ends.update(bus for x in network.transformers for bus in x.buses)
    others = {x.bus for x in network.loads} | {x.bus for x in network.shunts}
    behind: dict[str, list[str]] = {}
    for unit, bus in units.items():
        if ends[bus] == 1 and bus not in others:
            behind.setdefault(bus, []).append(unit)
    return {
        line.name: tuple(behind[bus])
        for line in network.lines
        for bus in (line.from_bus, line.to_bus)
        if bus in behind and not line.B
    }
