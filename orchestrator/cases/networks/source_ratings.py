"""Ratings of units of a network's source without dynamics data, where the source does not tell what they feed.

MBASE of a RAW file is the base of a machine's data and need not be its rating.  If the file is not solved, PG of the
reference and QG of every machine say nothing, and only a power flow tells how large the machines have to be for typical
data.  MATPOWER and pandapower have no ratings at all: a guess from active power is too small where reactive power
governs, as of synchronous condensers."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache

from fmus.toolchain.port_variables import LARGEST_POWER, SYSTEM_BASE_MVA
from orchestrator.cases.flow.balance import FlowLine, FlowLoad, FlowShunt, inner_buses, legs_of
from orchestrator.cases.flow.power_flow import FlowUnit, solve_power_flow
from orchestrator.cases.networks.conversion import Generation
from orchestrator.cases.networks.data import NetworkData
from orchestrator.core.errors import InputError, few

POWER_FACTOR = 0.9  # with which a power tells a rating that is not known
_SHOWN = 5
_KEPT = 4  # networks whose solution is kept: each scenario of a case asks


def with_needed_ratings(
    data: NetworkData, slack: str, wanted: Collection[str], *, keep_limits: bool = False
) -> tuple[dict[str, Generation], list[str]]:
    """Return the generation at each bus with the ratings that the power flow asks for, and questions about them.

    A rating of the source is replaced only if more than twice of it is asked for, a guess if more than it is.

    Parameters
    ----------
    slack
        Bus that feeds what is left.
    wanted
        Buses whose ratings matter.
    keep_limits
        Whether the units keep the source's limits of reactive power.
    """
    found, rated, guessed = dict(data.generation), list[str](), list[str]()
    for bus, power in _powers(data, slack, keep_limits=keep_limits).items():
        own = data.generation[bus]
        most = own.rating_mva * (LARGEST_POWER if own.is_rated else 1.0)
        if bus in wanted and abs(power) > most:
            needed = round(abs(power) / POWER_FACTOR, 1)
            found[bus] = replace(own, rating_mva=needed)
            (rated if own.is_rated else guessed).append(
                f"{bus} {power.real:.4g} MW {power.imag:+.4g} Mvar of {own.rating_mva:g} MVA: {needed:g} MVA"
            )
    beyond = (
        "the power flow asks more than twice the rating of the units at "
        f"{few(rated, _SHOWN)}: typical data are taken on the power with a power factor of {POWER_FACTOR:g}; is "
        "a power, a voltage to be held or MBASE wrong?"
    )
    unknown = (
        "the file has no ratings, and the power flow asks more than those that active powers and limits suggest of "
        f"the units at {few(guessed, _SHOWN)}: they are taken on the apparent power with a power factor of "
        f"{POWER_FACTOR:g}; is a power or a voltage to be held wrong? Known ratings belong in a file of "
        "[units], in its column rating_mva"
    )
    return found, [text for text, shown in ((beyond, rated), (unknown, guessed)) if shown]


def _powers(data: NetworkData, slack: str, *, keep_limits: bool) -> Mapping[str, complex]:
    """Powers of the units of each bus in the power flow of the source's data [MW, Mvar]; none if there is no solution,
    of which the case's own power flow tells."""
    if slack not in data.generation:
        return {}
    lines = [
        FlowLine(x.name, x.from_bus, to_bus=x.to_bus, R=x.R, X=x.X, B=x.B, tap=x.tap, shift=x.shift)
        for x in data.lines
    ]
    shunts = [
        FlowShunt(x.bus, x.g_mw / SYSTEM_BASE_MVA, x.b_mvar / SYSTEM_BASE_MVA) for x in data.shunts
    ]
    limits = [
        (bus, g.q_min_mvar / SYSTEM_BASE_MVA, g.q_max_mvar / SYSTEM_BASE_MVA)
        for bus, g in data.generation.items()
    ]
    inner = [bus for x in data.transformers for bus in inner_buses(x)]
    legs = [leg for x in data.transformers for leg in legs_of(x)]
    units = [FlowUnit(bus, bus, 1.0, g.p_mw, g.v_pu) for bus, g in data.generation.items()]
    loads = [FlowLoad(x.bus, x.p_mw, x.q_mvar) for x in data.loads]
    network = _Network(
        buses=(*data.buses, *inner),
        lines=(*lines, *legs),
        loads=tuple(loads),
        shunts=tuple(shunts),
        units=tuple(units),
        slack=slack,
        limits=tuple(limits) if keep_limits else (),
    )
    return _solved(network)


@dataclass(frozen=True, slots=True)
class _Network:
    """The data of a source's power flow; units have 1 MVA each, and limits are in pu of 100 MVA."""

    buses: tuple[str, ...]
    lines: tuple[FlowLine, ...]
    loads: tuple[FlowLoad, ...]
    shunts: tuple[FlowShunt, ...]
    units: tuple[FlowUnit, ...]
    slack: str
    limits: tuple[tuple[str, float, float], ...]


@lru_cache(maxsize=_KEPT)
def _solved(network: _Network) -> Mapping[str, complex]:
    """Powers of the units [MW, Mvar]; none without a solution."""
    limits = {bus: (least, most) for bus, least, most in network.limits}
    try:
        flow = solve_power_flow(
            network.buses,
            network.lines,
            network.loads,
            network.units,
            slack_bus=network.slack,
            shunts=network.shunts,
            limits=limits,
            keep_limits=bool(network.limits),
        )
    except InputError:
        return {}
    return flow.powers
