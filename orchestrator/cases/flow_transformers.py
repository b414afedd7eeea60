"""Three-winding transformers in the power flow: three legs to a star point."""

from fmus.grid.element_data import ThreeWinding
from orchestrator.cases.flow_balance import FlowLine

_PART = 0.01
"""Reactance [pu, 100 MVA] of the part of a leg of negative reactance that carries its ratio: the power flow's
transformers have positive reactances only."""


def inner_buses(transformer: ThreeWinding) -> list[str]:
    """Buses that a transformer has in the power flow alone: its star point, and those inside of split legs."""
    split = [f"{transformer.name}.inner_{k + 1}" for k in range(3) if _is_split(transformer, k)]
    return [f"{transformer.name}.star", *split]


def legs_of(transformer: ThreeWinding, *, closed: bool = True) -> list[FlowLine]:
    """The legs from the buses to the star point.

    A leg with both a ratio and a negative reactance is two in series. An open transformer keeps its star point with the
    first bus, without a current."""
    legs, star = [], f"{transformer.name}.star"
    for k, bus in enumerate(transformer.buses):
        name, X, R = f"{transformer.name}.leg_{k + 1}", transformer.X[k], transformer.R[k]
        ratio = {"tap": transformer.tap[k], "shift": transformer.shift[k]}
        is_closed = closed or k == 0
        if _is_split(transformer, k):
            inner = f"{transformer.name}.inner_{k + 1}"
            legs.append(FlowLine(f"{name}_ratio", bus, inner, 0.0, _PART, 0.0, closed=is_closed, **ratio))
            legs.append(FlowLine(name, inner, star, R, X - _PART, 0.0))
        else:
            legs.append(FlowLine(name, bus, star, R, X, 0.0, closed=is_closed, **ratio))
    return legs


def _is_split(transformer: ThreeWinding, k: int) -> bool:
    return transformer.X[k] < 0 and transformer.has_ratio(k)
