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
    ends = Counter(bus for line in network.lines for bus in (line.from_bus, line.to_bus))
    ends.update([*(bus for x in network.transformers for bus in x.buses), *units.values()])
    ends.update(2 * [*(x.bus for x in network.loads), *(x.bus for x in network.shunts)])
    only = {bus: unit for unit, bus in units.items() if ends[bus] == 2}  # itself and one branch
    return {
        line.name: only[bus]
        for line in network.lines
        for bus in (line.from_bus, line.to_bus)
        if bus in only and not line.B
    }
