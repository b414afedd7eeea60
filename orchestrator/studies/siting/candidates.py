"""Buses that may be the place of a device, and ratings that are most unusual."""

import fnmatch
from collections import Counter, defaultdict
from collections.abc import Sequence

from orchestrator.cases.form.names import close_names
from orchestrator.cases.questions.plausible_ranges import SMALLEST_SHARE
from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.core.errors import InputError, Problem, few
from orchestrator.core.options import Option

# load of a plant's own at its terminal, in parts of the rating there
_AUXILIARY = 0.05

# rating of a device by that of the largest unit, beyond which it is questioned: kVA for MVA
_MOST_TIMES_LARGEST = 10.0


def candidates(wanted: Sequence[str], prepared: PreparedScenario) -> list[str]:
    """The buses that patterns name; without any, all but the terminals of units.

    Raises `InputError` if a pattern names no bus."""
    known = list(prepared.network.buses) if prepared.network is not None else []
    found = {
        name: fnmatch.filter(known, name)
        or fnmatch.filter(known, f"bus_{name}")
        or fnmatch.filter(known, prepared.names.identifier(name, known, Option.BUSES))
        for name in wanted
    }
    unknown = [name for name, there in found.items() if not there]
    if unknown:
        hint = close_names(unknown[0], known, f"the buses are {few(known, 8)}")
        raise InputError(Option.BUSES + f" {unknown[0]}: there is no such bus; {hint}")
    if wanted:
        return list(dict.fromkeys(bus for there in found.values() for bus in there))
    left_out = {*unit_terminals(prepared)}
    return [bus for bus in known if bus not in left_out]


def unit_terminals(prepared: PreparedScenario) -> list[str]:
    """The buses of units behind one transformer: a unit, no load but the plant's own, and one branch without charging.

    None where no other bus would be left."""
    network, plans = prepared.network, prepared.system.components
    if network is None:
        return []
    rating = defaultdict[str, float](float)
    for port in (port for port in network.ports if port.name in plans):
        rating[port.bus] += plans[port.name].number("S_n")
    load = defaultdict[str, float](float)
    for one in network.loads:
        load[one.bus] += abs(one.p_mw)
    charged = {bus: line.B for line in network.lines for bus in (line.from_bus, line.to_bus)}
    ways = Counter(bus for line in network.lines for bus in (line.from_bus, line.to_bus))
    ways.update(bus for x in network.transformers for bus in x.buses)
    found = [
        bus
        for bus in network.buses
        if rating[bus] and ways[bus] == 1 and not charged.get(bus)
        if load[bus] <= _AUXILIARY * rating[bus]
    ]
    return found if len(found) < len(network.buses) else []


def question_about(rating: float | None, prepared: PreparedScenario) -> Problem | None:
    """Return whether a rating [MVA] is meant that is a thousandth of the largest unit's, or ten times it."""
    plans = prepared.system.components
    ports = prepared.network.ports if prepared.network is not None else ()
    ratings = {port.name: plans[port.name].number("S_n") for port in ports if port.name in plans}
    if rating is None or not ratings:
        return None
    largest = max(ratings, key=lambda name: ratings[name])
    if SMALLEST_SHARE <= rating / ratings[largest] <= _MOST_TIMES_LARGEST:
        return None
    beside = f"{rating:g} MVA beside {largest}'s {ratings[largest]:g} MVA; is it in MVA?"
    return Problem(
        Option.RATING, f"{beside} Write it with its unit, such as 250MVA, if another is meant"
    )
