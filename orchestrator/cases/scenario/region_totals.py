"""Totals of each area, zone, owner and station of a network's file."""

from collections.abc import Iterator
from dataclasses import dataclass

from orchestrator.cases.networks.regions import KINDS
from orchestrator.cases.scenario.prepare import PreparedScenario


@dataclass(frozen=True, slots=True)
class RegionTotal:
    """A region: its buses and units, what the units feed, and what the loads draw in the power flow's data [MW].

    ``kind``: area, zone, owner or station; ``name``: number and name in the file."""

    kind: str
    name: str
    buses: tuple[str, ...]
    units: tuple[str, ...]
    generation_mw: float
    load_mw: float


def region_totals(prepared: PreparedScenario) -> list[RegionTotal]:
    """Return the regions of a case's file, kind by kind; empty where it names none."""
    return [*_totals(prepared)]


def _totals(prepared: PreparedScenario) -> Iterator[RegionTotal]:
    network, flow = prepared.network, prepared.power_flow
    if network is None or flow is None:
        return
    plans = prepared.system.components
    fed = {name: power.real * plans[name].number("S_n") for name, power in flow.powers.items()}
    at_bus: dict[str, list[str]] = {}
    for port in network.ports:
        at_bus.setdefault(port.bus, []).append(port.name)
    drawn: dict[str, float] = {}
    for load in network.loads:
        drawn[load.bus] = drawn.get(load.bus, 0.0) + load.p_mw
    for kind in KINDS:
        for name, buses in prepared.regions.buses_by(kind).items():
            units = [unit for bus in buses for unit in at_bus.get(bus, ()) if unit in fed]
            yield RegionTotal(
                kind,
                name,
                tuple(buses),
                tuple(units),
                sum(fed[unit] for unit in units),
                sum(drawn.get(bus, 0.0) for bus in buses),
            )
