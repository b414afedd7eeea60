"""Parts of a network that events leave without any unit: nothing holds their voltages and frequency."""

from collections import Counter
from collections.abc import Mapping, Sequence
from itertools import groupby

from fmus.grid.network import Network
from orchestrator.cases.draft import Draft
from orchestrator.cases.flow.connected import connected_parts
from orchestrator.core.errors import Problem, QuestionTopic, few
from orchestrator.systems.coupling.events import Event

_SHOWN = 5  # buses that a question names; the others are counted


def question_islands(draft: Draft, events: Sequence[tuple[Event, str]]) -> None:
    """Ask about every part of the network that an event leaves with loads and without a unit."""
    plan = draft.system.components.get(draft.grid or "")
    if draft.network is None or draft.found.network_failed or plan is None or draft.grid is None:
        return
    values = {name: plan.value(name) for name in plan.description.parameters}
    plans = draft.system.components
    units = {
        port.name: port.bus
        for port in draft.network.ports
        if port.name in plans and plans[port.name].kind != "load"
    }
    asked = {frozenset(part) for part in _without_unit(draft.network, units, values)}
    for time, group in groupby(
        sorted(events, key=lambda pair: pair[0].time), key=lambda pair: pair[0].time
    ):
        where = ""
        switched = False
        for event, place in group:
            where = where or place
            for name, value in event.changes().get(draft.grid, {}).items():
                switched = switched or bool(value) != bool(values.get(name, True))
                values[name] = value
        if not switched:
            continue
        for part in _without_unit(draft.network, units, values):
            if frozenset(part) not in asked:
                asked.add(frozenset(part))
                draft.found.questions.append(
                    Problem(
                        where,
                        f"from t = {time:g} s on no unit is connected to {few(part, _SHOWN)}: nothing "
                        "holds the voltage and the frequency of the loads there, and no verdict speaks of them; trip "
                        "these loads at the same time",
                        topic=QuestionTopic("a part without a unit"),
                    )
                )


def _without_unit(
    network: Network, units: Mapping[str, str], values: Mapping[str, object]
) -> list[list[str]]:
    ends = [
        (line.from_bus, line.to_bus)
        for line in network.lines
        if all(
            values.get(line.variable(switch), True)
            for switch in ("connected", "from_connected", "to_connected")
        )
    ]
    for winding in network.transformers:
        if values.get(f"{winding.name}.connected", True):
            ends += [(winding.buses[0], bus) for bus in winding.buses[1:]]
    part_of = connected_parts(network.buses, ends)
    fed = {part_of[bus] for unit, bus in units.items() if values.get(f"{unit}.connected", True)}
    drawn = {
        part_of[load.bus]
        for load in network.loads
        if (load.p_mw or load.q_mvar) and values.get(f"{load.name}.scale", 1.0)
    }
    return [[bus for bus in network.buses if part_of[bus] == part] for part in sorted(drawn - fed)]


def likely_reference(network: Network, units: Mapping[str, float]) -> str:
    """Return the largest unit in the largest part of a network.

    ``units``: ratings [MVA]."""
    ends = [(line.from_bus, line.to_bus) for line in network.lines]
    for winding in network.transformers:
        ends += [(winding.buses[0], bus) for bus in winding.buses[1:]]
    part_of = connected_parts(network.buses, ends)
    size = Counter(part_of.values())
    at = {port.name: port.bus for port in network.ports}
    return max(units, key=lambda name: (size[part_of[at[name]]], units[name]))
