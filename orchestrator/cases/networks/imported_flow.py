"""The equations of a power flow of an imported network, before it is a case."""

from collections.abc import Mapping, Sequence

from fmus.toolchain.port_variables import SYSTEM_BASE_MVA
from orchestrator.cases.flow.balance import FlowLine, FlowLoad, FlowShunt, legs_of
from orchestrator.cases.flow.equations import FlowEquations
from orchestrator.cases.networks.conversion import ImportedNetwork


def flow_lines(network: ImportedNetwork) -> list[FlowLine]:
    """Return the branches of a network, with the legs of its three-winding transformers."""
    own = [
        FlowLine(x.name, x.from_bus, to_bus=x.to_bus, R=x.R, X=x.X, B=x.B, tap=x.tap, shift=x.shift)
        for x in network.lines
    ]
    return [*own, *(leg for x in network.transformers for leg in legs_of(x))]


def imported_equations(
    network: ImportedNetwork, buses: Sequence[str], held: Mapping[str, float], slack: str
) -> FlowEquations:
    """Return the equations of the part of a network that some buses are.

    ``buses``: in the order of the equations' arrays; ``held``: magnitudes of held voltages [pu]."""
    own = set(buses)
    lines = [line for line in flow_lines(network) if line.from_bus in own]
    loads = [FlowLoad(x.bus, x.p_mw, x.q_mvar) for x in network.loads if x.bus in own]
    shunts = [
        FlowShunt(x.bus, x.g_mw / SYSTEM_BASE_MVA, x.b_mvar / SYSTEM_BASE_MVA)
        for x in network.shunts
        if x.bus in own
    ]
    fed = {bus: g.p_mw / SYSTEM_BASE_MVA for bus, g in network.generation.items() if bus in own}
    return FlowEquations.of(
        buses,
        lines,
        loads,
        shunts,
        active=fed,
        held={bus: v for bus, v in held.items() if bus in own},
        slack_bus=slack,
    )
