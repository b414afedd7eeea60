"""Parts of a network that events leave without any unit: nothing holds their voltages and frequency."""

from collections.abc import Mapping, Sequence
from itertools import groupby

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from fmus.grid.network import Network
from orchestrator.cases.draft import Draft
from orchestrator.core.errors import Problem, few
from orchestrator.systems.coupling.events import Event

_SHOWN = 5  # buses that a question names; the others are counted


def question_islands(draft: Draft, events: Sequence[tuple[Event, str]]) -> None:
    """Ask about every part of the network that an event leaves with loads and without a unit."""
    plan = draft.system.components.get(draft.grid or "")
    if draft.network is None or draft.found.network_failed or plan is None or draft.grid is None:
        return
    values = {name: plan.value(name) for name in plan.description.parameters}
    units = {
        port.name: port.bus for port in draft.network.ports if port.name in draft.system.components
    }
    asked = {frozenset(part) for part in _without_unit(draft.network, units, values)}
    for time, group in groupby(
        sorted(events, key=lambda pair: pair[0].time), key=lambda pair: pair[0].time
    ):
        where, switched = "", False
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
                    )
                )


def _without_unit(
    network: Network, units: Mapping[str, str], values: Mapping[str, object]
) -> list[list[str]]:
    row = {bus: k for k, bus in enumerate(network.buses)}
    ends = [
        (line.from_bus, line.to_bus)
        for line in network.lines
        if values.get(line.variable("connected"), True)
    ]
    for winding in network.transformers:
        if values.get(f"{winding.name}.connected", True):
            ends += [(winding.buses[0], bus) for bus in winding.buses[1:]]
    starts, stops = ([row[end[k]] for end in ends] for k in (0, 1))
    links = coo_array((np.ones(len(ends)), (starts, stops)), shape=(len(row), len(row)))
    _, part_of = connected_components(links, directed=False)
    fed = {
        part_of[row[bus]] for unit, bus in units.items() if values.get(f"{unit}.connected", True)
    }
    drawn = {
        part_of[row[load.bus]]
        for load in network.loads
        if (load.p_mw or load.q_mvar) and values.get(f"{load.name}.scale", 1.0)
    }
    return [
        [bus for bus in network.buses if part_of[row[bus]] == part] for part in sorted(drawn - fed)
    ]
