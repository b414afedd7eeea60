"""The network as a single-line diagram: where buses lie, and which values act on each of its elements."""

from typing import Any

import numpy as np

from orchestrator.cases.form.names import close_names
from orchestrator.core.errors import InputError, few
from orchestrator.face.api.scenario import Scenario
from orchestrator.output.report.html.network_map import HEIGHT, WIDTH, places


def diagram(scenario: Scenario) -> dict[str, Any] | None:
    """Buses with their places, and branches, loads and units with the names of the values that move them; None for a
    case without a network. A value that an element lacks is None."""
    prepared = scenario.prepared
    network, grid = prepared.network, prepared.grid
    if network is None:
        return None
    units = prepared.system.components

    def title(name: str) -> str:
        """Return the title of an element, with what it belongs to in the file."""
        buses = prepared.buses_of.get(name, ())
        if len(buses) == 1:
            belongs = prepared.regions.of(buses[0]).in_words
        else:
            areas = prepared.regions.area_of(*buses)
            belongs = f"area {areas}" if areas else ""
        return ", ".join(filter(None, (prepared.names.of(name), belongs)))

    plan = units[grid]
    has = plan.description.variables

    def of_grid(variable: str) -> str | None:
        return f"{grid}.{variable}" if variable in has else None

    def power_of(load: str, in_file: float) -> float:
        """Return the active power of a load [MW], by the parameter of the grid where it has one."""
        power = f"{load}.P"
        return plan.number(power) if power in has else in_file

    lines: list[dict[str, Any]] = [
        {
            "name": line.name,
            "title": title(line.name),
            "from": line.from_bus,
            "to": line.to_bus,
            "kind": "branch" if line.has_ratio else "line",
            "open": of_grid(line.variable("connected")),
            "length": of_grid(line.variable("X")),
            "resistance": of_grid(line.variable("R")),
            "charging": of_grid(line.variable("B")),
        }
        for line in network.lines
    ]
    lines += [
        {
            "name": x.name,
            "title": title(x.name),
            "from": x.buses[0],
            "to": bus,
            "kind": "branch",
            "open": of_grid(f"{x.name}.connected"),
        }
        for x in network.transformers
        for bus in x.buses[1:]
    ]
    ends = [(line["from"], line["to"]) for line in lines]
    points = places(network.buses, ends)
    points += np.array([WIDTH, HEIGHT]) / 2 - (points.max(axis=0) + points.min(axis=0)) / 2
    given = prepared.case.table.diagram.positions
    unknown = [bus for bus in given if bus not in network.buses]
    if unknown:
        raise InputError(
            f"{prepared.case.source}: [diagram] positions: there is no bus {unknown[0]!r}; "
            + close_names(unknown[0], network.buses, f"there are: {few(network.buses, 8)}")
        )
    at = [given.get(bus, tuple(xy)) for bus, xy in zip(network.buses, points.tolist(), strict=True)]
    return {
        "width": WIDTH,
        "height": HEIGHT,
        "buses": [
            {"name": bus, "title": title(bus), "x": x, "y": y}
            for bus, (x, y) in zip(network.buses, at, strict=True)
        ],
        "lines": lines,
        "loads": [
            {
                "name": load.name,
                "title": title(load.name),
                "bus": load.bus,
                "scale": of_grid(f"{load.name}.scale"),
                "p_mw": power_of(load.name, load.p_mw),
            }
            for load in network.loads
        ],
        "units": [
            {
                "name": port.name,
                "title": title(port.name),
                "bus": port.bus,
                "machine": any(
                    state.endswith("machine.omega") for state in units[port.name].description.states
                ),
                "out": f"{port.name}.connected"
                if "connected" in units[port.name].description.variables
                else of_grid(f"{port.name}.connected"),
            }
            for port in network.ports
            if port.name in units
        ],
    }
