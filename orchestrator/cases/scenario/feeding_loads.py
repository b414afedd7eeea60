"""Loads below zero: each feeds the network, and a slip in its sign leaves too much power for the units."""

from fmus.grid.network import Network
from orchestrator.cases.flow.sharing import load_of
from orchestrator.core.errors import few
from orchestrator.systems.coupling.system import ComponentPlan

_COUNTS = 0.1  # part of a unit's rating from which what such loads feed may be why it cannot work
_SHOWN = 3  # loads that are named; the others are counted


def feeding_loads(network: Network | None, grid: ComponentPlan | None, S_n: float) -> str:
    """Question about loads below zero that feed much beside a unit; "" without any.

    ``S_n``: the unit's rating [MVA]."""
    if network is None or grid is None:
        return ""
    powers = {load.name: load_of([load.name], grid) for load in network.loads}
    fed = {name: -power for name, power in powers.items() if power < 0}
    if not fed or sum(fed.values()) < _COUNTS * S_n:
        return ""
    largest = sorted(fed, key=lambda name: -fed[name])
    named = few([f"{name} feeds {fed[name]:.4g} MW" for name in largest], _SHOWN)
    return f"a likely cause is a load below zero: {named}; is its sign meant? A load that draws has P above 0"
