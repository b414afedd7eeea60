"""Who feeds what an outage takes away: units by their governors or by their ratings, or the slack alone."""

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import NamedTuple

from fmus.toolchain.port_variables import LARGEST_POWER
from orchestrator.cases.flow.power_flow import FlowUnit, PowerFlow
from orchestrator.core.errors import ErrorKind, InputError
from orchestrator.core.options import Option
from orchestrator.core.spelling import Text
from orchestrator.core.units import whole_percent
from orchestrator.systems.coupling.system import ComponentPlan

_CLOSE = 1e-6  # power [MW] that may be left to the units at the slack bus beside their share

_ROUNDS = 30
# so much of its rating stays between a unit and its limit: at the limit itself no model starts
_ROOM = 1e-3

_LEAST_SHARE = 0.01  # shares below this [MW] are not told
_SHOWN = 4  # units whose shares are told, the largest first

_ISOCHRONOUS = 1e6  # gain of a droop of 0 [pu]: such a unit feeds all that it can


class SharingRule(StrEnum):
    """By what units share the power that an outage takes away."""

    DROOP = "droop"
    RATING = "rating"
    SLACK = "slack"


@dataclass(frozen=True)
class Dispatch:
    """Powers that the units feed before an outage [pu, S_n], how they share it, and about how much [MW]."""

    rule: SharingRule
    powers: Mapping[str, complex]
    change: float


_OF_FILE = "the network file's most, PT in a RAW file"


class PowerLimit(NamedTuple):
    """A most active power, and in words whose it is."""

    most: float
    whose: str


@dataclass(frozen=True)
class Room:
    """Limits of the units' powers that a file gives beside their models.

    ``active``: least and most active power [MW]; ``ratings``: likely ratings [MVA] of units whose S_n is only the base
    of their data; ``loads``: what loads draw [MW]."""

    active: Mapping[str, tuple[float, float]]
    ratings: Mapping[str, float]
    loads: Mapping[str, float] = field(default_factory=dict)

    def least_of(self, name: str) -> float:
        return self.active.get(name, (-math.inf, math.inf))[0]

    def highest_of(self, name: str) -> list[PowerLimit]:
        high = self.active.get(name, (-math.inf, math.inf))[1]
        rating = self.ratings.get(name, math.inf)
        return [PowerLimit(high, _OF_FILE), PowerLimit(rating, "its likely rating")]


@dataclass(frozen=True)
class Reserve:
    """A unit's share and its room: ``before``, ``least`` and ``most`` in MW, ``gain`` in MW by any common unit.

    ``whose``: the limit that ``most`` is, with the next one above, in words."""

    name: str
    before: float
    gain: float
    least: float
    most: float
    whose: str = ""


def in_words(
    dispatch: Dispatch,
    after: Mapping[str, complex],
    plans: Mapping[str, ComponentPlan],
    lost: Collection[str],
    also: Sequence[str] = (),
) -> str:
    """Tell what the lost units fed, what else was lost, and who feeds it now, by the powers afterwards [pu, S_n]."""
    rating = {name: plans[name].number("S_n") for name in dispatch.powers if name in plans}
    fed = [
        f"{name} is lost, which fed {dispatch.powers[name].real * rating[name]:.4g} MW"
        for name in sorted(lost)
    ]
    more = {n: (after[n] - dispatch.powers[n]).real * rating[n] for n in rating if n not in lost}
    most = sorted(more, key=lambda name: -abs(more[name]))[:_SHOWN]
    shared = ", ".join(
        f"{name} {more[name]:+.4g} MW" for name in most if abs(more[name]) >= _LEAST_SHARE
    )
    return "; ".join([*fed, *also, *([f"shared: {shared}"] if shared else [])])


def load_of(loads: Collection[str], plan: ComponentPlan) -> float:
    """Active power of loads of a grid [MW]."""
    return sum(plan.number(f"{name}.scale") * plan.number(f"{name}.P") for name in loads)


def lost_load(drawn: float) -> list[str]:
    """Return what is told of load that values or an outage take away [MW]."""
    if abs(drawn) < _LEAST_SHARE:
        return []
    return [f"{abs(drawn):.4g} MW of load {'lost' if drawn > 0 else 'more'}"]


def _number(plan: ComponentPlan, name: str) -> float | None:
    return plan.number(name) if name in plan.description.variables else None


def _fractions(plan: ComponentPlan) -> float:
    """Part of a steam valve's opening that becomes mechanical power."""
    return sum(_number(plan, f"governor.K_{k}") or 0.0 for k in range(1, 9))


def droop_gain(plan: ComponentPlan) -> float:
    """Power that a unit adds in steady state by frequency [pu, S_n and f_n]; 0 of one that does not answer to it."""
    gain = _number(plan, "governor.inverse_R")
    if gain:
        return gain
    gain = _number(plan, "governor.K")
    if gain:
        return gain * _fractions(plan)
    following = "frequency_droop.R_f" if _number(plan, "frequency_droop.enabled") else ""
    for name in ("governor.R", "droop.R_f", following, "mp"):
        droop = _number(plan, name)
        if droop is not None:
            if not droop:
                return _ISOCHRONOUS
            return (_number(plan, "governor.A_t") or 1.0) / droop
    return 0.0


def power_limits(plan: ComponentPlan, reactive: float = 0.0) -> tuple[float, float]:
    """Least and most active power from which a unit starts [pu, S_n]; infinite where its model has no limit.

    ``reactive``: Reactive power that it feeds [pu, S_n]: the current that is left is active."""
    least, highest = _limits_of_model(plan, reactive)
    return least, highest.most


def _limits_of_model(plan: ComponentPlan, reactive: float) -> tuple[float, PowerLimit]:
    """Return the least power from which a unit starts, and its lowest upper limit [pu, S_n]; see `power_limits`."""
    low, high = [-math.inf], [PowerLimit(math.inf, "")]

    def turbine(least: str, most: str, factor: float = 1.0, idle: float = 0.0) -> None:
        lower, upper = (_number(plan, f"governor.{name}") for name in (least, most))
        if lower is not None:
            low.append(factor * (lower - idle))
        if upper is not None:
            high.append(PowerLimit(factor * (upper - idle), f"governor.{most}"))

    turbine("V_MIN", "V_MAX")
    turbine("P_MIN", "P_MAX", _fractions(plan))
    turbine(
        "G_MIN",
        "G_MAX",
        _number(plan, "governor.A_t") or 1.0,
        _number(plan, "governor.q_NL") or 0.0,
    )
    turbine("", "A_T")
    v_0 = _number(plan, "v_0") or 1.0
    kind = _number(plan, "current_limit.kind")
    box = _number(plan, "voltage_control.i_q_max")
    circle = _number(plan, "current_limit.I_max")
    if box is not None and (kind is None or kind < 0.5):
        high.append(PowerLimit(v_0 * box, "voltage_control.i_q_max"))
    elif circle is not None:
        left = math.sqrt(max(0.0, (v_0 * circle) ** 2 - reactive**2))
        high.append(PowerLimit(left, "current_limit.I_max"))
    if len(high) > 1 and low == [-math.inf]:
        low.append(-min(high).most)
    most = plan.description.variables["P_0"].maximum
    if most is not None:
        # beyond it S_n is only the base of the unit's data
        usual = abs(plan.number("P_0")) <= LARGEST_POWER
        high.append(PowerLimit(min(most, LARGEST_POWER) if usual else most, "its model"))
    losses = 1.5 * (_number(plan, "machine.R_s") or 0.0)
    lowest = min(high)
    return max(low) + _ROOM, lowest._replace(most=lowest.most - _ROOM - losses)


def shares(
    reserves: Sequence[Reserve], change: float, *, bare: bool = False, typed: str = ""
) -> dict[str, float]:
    """Power of each unit [MW] after a change of the units' whole power; a unit at its limit leaves the rest to others.

    ``change``: What they have to feed beside what they fed [MW]; ``bare``: without what the losses grow by;
    ``typed``: how the loss of a load with the units is asked for."""
    found = {one.name: one.before for one in reserves}
    free = [one for one in reserves if one.gain > 0]
    rest = change
    while free and rest:
        step = rest / sum(one.gain for one in free)
        wanted = {one.name: one.before + step * one.gain for one in free}
        stopped = [one for one in free if not one.least <= wanted[one.name] <= one.most]
        if not stopped:
            return found | wanted
        for one in stopped:
            found[one.name] = max(
                min(one.before, one.least), min(max(one.before, one.most), wanted[one.name])
            )
            rest -= found[one.name] - one.before
        free = [one for one in free if one not in stopped]
    if abs(rest) <= _CLOSE:
        return found
    raise InputError(
        _overload(reserves, change, f"{abs(rest):.4g} MW{', before the losses grow,' * bare}")
        + (typed if change > 0 else ""),
        kind=ErrorKind.START,
    )


def _overload(reserves: Sequence[Reserve], change: float, left: str) -> str:
    able = [one for one in reserves if one.gain > 0] or list(reserves)
    step = change / (sum(one.gain for one in able) or 1.0)
    worst = max(
        able, key=lambda one: (one.before + step * one.gain) / one.most if one.most > 0 else 0.0
    )
    need = worst.before + step * worst.gain
    if change > 0 and worst.most > 0:
        first = (
            f"{worst.name} would need {whole_percent(need, worst.most)} of its {worst.most:.4g} MW"
            f"{worst.whose and f' ({worst.whose})'}"
        )
    elif change > 0:
        first = f"{worst.name} would need {need:.4g} MW, where its most is {worst.most:.4g} MW"
    else:
        first = f"{worst.name} would have to go down to {need:.4g} MW"
    more, short = ("more", "short") if change > 0 else ("less", "too much")
    text = (
        f"{first}: {abs(change):.4g} MW {more} cannot be shared, {left} are {short} when all units with a governor or "
        "a droop are at their limits; "
    )
    if change > 0 and all(one.most <= 0 for one in able):
        return text + (
            "no unit may feed anything: if PT in the RAW file or P_MAX of the governors is not meant so, correct it, "
            "or let the slack alone feed what is lost (" + Option.SHARING + " slack)"
        )
    return text + "give another dispatch, or lose load with the unit"


def shared_flow(
    solve: Callable[[Sequence[FlowUnit]], PowerFlow],
    units: Sequence[FlowUnit],
    plans: Mapping[str, ComponentPlan],
    slack_bus: str,
    dispatch: Dispatch,
    room: Room,
) -> PowerFlow:
    """The power flow in which the units share what the dispatch before lacks now, with the change of the losses."""
    left = [
        replace(one, P_0=dispatch.powers[one.name].real) if one.connected else one for one in units
    ]
    if dispatch.rule is SharingRule.SLACK:
        return solve(left)
    reserves = _reserves(left, plans, dispatch, room)
    at_slack = {
        one.name for one in left if one.connected and one.bus == slack_bus and one.Q_0 is None
    }
    rating = {one.name: one.S_n for one in left}
    change, before = dispatch.change, (0.0, 0.0)
    typed = _typed_loss(units, dispatch, room)
    for k in range(_ROUNDS):
        found = shares(reserves, change, bare=not k, typed=typed)
        moved = {
            one.name: replace(one, P_0=found[one.name] / one.S_n)
            for one in left
            if one.name in found and one.connected
        }
        flow = solve([moved.get(one.name, one) for one in left])
        missing = sum(flow.powers[name].real * rating[name] - found[name] for name in at_slack)
        if abs(missing) <= _CLOSE:
            return replace(flow, powers=_as_shared(flow, found, rating, at_slack))
        # Losses depend but little on the shares: what is missing falls by about what is shared more.
        slope = (
            (missing - before[1]) / (change - before[0])
            if before[1] and change != before[0]
            else -1.0
        )
        before, change = (change, missing), change - missing / (slope or -1.0)
    raise InputError(
        f'power flow: the shares of the units do not settle in {_ROUNDS} rounds; take sharing = "slack"',
        kind=ErrorKind.POWER_FLOW,
    )


def _typed_loss(units: Sequence[FlowUnit], dispatch: Dispatch, room: Room) -> Text:
    """Return how a screening is asked to lose with the units a load of about their power; "" without a load."""
    lost = [one.name for one in units if not one.connected and one.name in dispatch.powers]
    if not lost or not room.loads:
        return Text("")
    like = min(room.loads, key=lambda name: abs(room.loads[name] - dispatch.change))
    return "; a screening loses a load with it by " + Option.OUTAGES + f" {'+'.join([*lost, like])}"


def _reserves(
    units: Sequence[FlowUnit],
    plans: Mapping[str, ComponentPlan],
    dispatch: Dispatch,
    room: Room,
) -> list[Reserve]:
    """Return the reserves of the units that are left. Where none answers to the frequency, ratings decide."""
    left = [one for one in units if one.connected]
    gains = {one.name: droop_gain(plans[one.name]) for one in left}
    if dispatch.rule is SharingRule.RATING or not any(gains.values()):
        parts = {one.name: room.ratings.get(one.name, one.S_n) / one.S_n for one in left}
        gains = {one.name: parts[one.name] if one.Q_0 is None else 0.0 for one in left}
    found = []
    for one in left:
        least, own = _limits_of_model(plans[one.name], dispatch.powers[one.name].imag)
        highest = [PowerLimit(own.most * one.S_n, own.whose), *room.highest_of(one.name)]
        found.append(
            Reserve(
                one.name,
                one.P_0 * one.S_n,
                gains[one.name] * one.S_n,
                least=max(least * one.S_n, room.least_of(one.name)),
                most=min(highest).most,
                whose=_in_words(highest),
            )
        )
    return found


def _in_words(highest: Sequence[PowerLimit]) -> str:
    """Tell whose limit the lowest one is, and how much the next one would allow."""
    first, second, *_ = sorted(highest)
    if math.isinf(second.most):
        return first.whose
    return f"{first.whose}, where {second.whose} allows {second.most:.4g} MW"


def _as_shared(
    flow: PowerFlow, found: Mapping[str, float], rating: Mapping[str, float], at_slack: set[str]
) -> dict[str, complex]:
    """The units' powers, those at the slack bus with their own shares instead of equal ones.

    What little is missing is theirs as well: without a governor nothing else would ever make up for it."""
    missing = sum(flow.powers[name].real * rating[name] - found[name] for name in at_slack)
    rest = missing / (sum(rating[name] for name in at_slack) or 1.0)
    own = {
        name: complex(found[name] / rating[name] + rest, flow.powers[name].imag)
        for name in at_slack
    }
    return flow.powers | own
