"""Ratings of units of a RAW file without dynamics data, if its own solution does not tell what they feed.

MBASE is the base of a machine's data and need not be its rating.  If the file is not solved, PG of the reference and QG
of every machine say nothing, and only a power flow tells how large the machines have to be for typical data."""

from collections.abc import Mapping
from dataclasses import replace

from fmus.toolchain.port_variables import LARGEST_POWER, SYSTEM_BASE_MVA
from orchestrator.cases.flow.balance import FlowLine, FlowLoad, FlowShunt, inner_buses, legs_of
from orchestrator.cases.flow.power_flow import FlowUnit, solve_power_flow
from orchestrator.cases.networks.conversion import Generation
from orchestrator.cases.networks.data import NetworkData
from orchestrator.core.errors import InputError, few

POWER_FACTOR = 0.9  # with which a power tells a rating that is not known
_SHOWN = 5


def with_needed_ratings(data: NetworkData, slack: str) -> tuple[dict[str, Generation], str]:
    """Return the generation at each bus with the ratings that the power flow asks for, and a question about them.

    A rating is replaced only if more than twice of it is asked for.  The question is empty if none is.

    Parameters
    ----------
    slack
        Bus that feeds what is left.
    """
    found, shown = dict(data.generation), []
    for bus, power in _powers(data, slack).items():
        own = data.generation[bus]
        if abs(power) > LARGEST_POWER * own.rating_mva:
            needed = round(abs(power) / POWER_FACTOR, 1)
            found[bus] = replace(own, rating_mva=needed)
            shown.append(
                f"{bus} {power.real:.4g} MW {power.imag:+.4g} Mvar of {own.rating_mva:g} MVA: {needed:g} MVA"
            )
    text = (
        "the power flow asks more than twice the rating of the units at "
        f"{few(shown, _SHOWN)}: typical data are taken on the power with a power factor of {POWER_FACTOR:g}; is "
        "a power, a voltage to be held or MBASE wrong?"
    )
    return found, text if shown else ""


def _powers(data: NetworkData, slack: str) -> Mapping[str, complex]:
    """Powers of the units of each bus in the power flow of the source's data [MW, Mvar]; none if there is no solution,
    of which the case's own power flow tells."""
    if slack not in data.generation:
        return {}
    inner = (bus for x in data.transformers for bus in inner_buses(x))
    lines = [
        FlowLine(x.name, x.from_bus, to_bus=x.to_bus, R=x.R, X=x.X, B=x.B, tap=x.tap, shift=x.shift)
        for x in data.lines
    ]
    shunts = [
        FlowShunt(x.bus, x.g_mw / SYSTEM_BASE_MVA, x.b_mvar / SYSTEM_BASE_MVA) for x in data.shunts
    ]
    units = [FlowUnit(b, b, 1.0, g.p_mw, g.v_pu) for b, g in data.generation.items()]
    try:
        flow = solve_power_flow(
            (*data.buses, *inner),
            [*lines, *(leg for x in data.transformers for leg in legs_of(x))],
            [FlowLoad(x.bus, x.p_mw, x.q_mvar) for x in data.loads],
            units,
            slack,
            shunts,
        )
    except InputError:
        return {}
    return flow.powers
