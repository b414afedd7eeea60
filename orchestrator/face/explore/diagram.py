"""The network as a single-line diagram: where buses lie, and which values act on each of its elements."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from orchestrator.cases.form.names import close_names
from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.core.errors import InputError, few
from orchestrator.face.api.scenario import Scenario
from orchestrator.output.report.html.network_map import HEIGHT, WIDTH, places


def diagram(scenario: Scenario) -> dict[str, Any] | None:
    """Buses with their places, and branches, loads and units with the names of the values that move them; None for a
    case without a network. A value that an element lacks is None."""
    prepared = scenario.prepared
    if prepared.network is None:
        return None
    elements = _Elements(prepared)
    lines = elements.lines()
    places = _places_of_buses(
        prepared, prepared.network.buses, [(line["from"], line["to"]) for line in lines]
    )
    return {
        "width": WIDTH,
        "height": HEIGHT,
        "buses": [
            {"name": bus, "title": elements.title(bus), "x": x, "y": y}
            for bus, (x, y) in places.items()
        ],
        "lines": lines,
        "loads": elements.loads(),
        "units": elements.units(),
    }


def _places_of_buses(
    prepared: PreparedScenario, buses: Sequence[str], ends: Sequence[tuple[str, str]]
) -> dict[str, tuple[float, float]]:
    """Where each bus lies: as the case says, or where it is computed, in the middle of the picture.

    ``ends``: the two buses of each branch. Raises an `InputError` for a bus of the case that the network lacks."""
    points = places(buses, ends)
    points += np.array([WIDTH, HEIGHT]) / 2 - (points.max(axis=0) + points.min(axis=0)) / 2
    given = prepared.case.table.diagram.positions
    unknown = [bus for bus in given if bus not in buses]
    if unknown:
        raise InputError(
            f"{prepared.case.source}: [diagram] positions: there is no bus {unknown[0]!r}; "
            + close_names(unknown[0], buses, f"there are: {few(buses, 8)}")
        )
    computed = dict(zip(buses, map(tuple, points.tolist()), strict=True))
    return {bus: given.get(bus, xy) for bus, xy in computed.items()}


class _Elements:
    """The elements of a network, each with its title and the names of the values that act on it."""

    def __init__(self, prepared: PreparedScenario) -> None:
        assert prepared.network is not None
        self._prepared, self._network = prepared, prepared.network
        self._components = prepared.system.components
        self._plan = self._components[prepared.grid]

    def title(self, name: str) -> str:
        """Return the title of an element, with what it belongs to in the file."""
        prepared = self._prepared
        buses = prepared.buses_of.get(name, ())
        if len(buses) == 1:
            belongs = prepared.regions.of(buses[0]).in_words
        else:
            areas = prepared.regions.area_of(*buses)
            belongs = f"area {areas}" if areas else ""
        return ", ".join(filter(None, (prepared.names.of(name), belongs)))

    def lines(self) -> list[dict[str, Any]]:
        """Lines and transformers; each winding of a transformer of three beyond its first is one."""
        lines = [
            {
                "name": line.name,
                "title": self.title(line.name),
                "from": line.from_bus,
                "to": line.to_bus,
                "kind": "branch" if line.has_ratio else "line",
                "open": self._of_grid(line.variable("connected")),
                "length": self._of_grid(line.variable("X")),
                "resistance": self._of_grid(line.variable("R")),
                "charging": self._of_grid(line.variable("B")),
            }
            for line in self._network.lines
        ]
        lines += [
            {
                "name": x.name,
                "title": self.title(x.name),
                "from": x.buses[0],
                "to": bus,
                "kind": "branch",
                "open": self._of_grid(f"{x.name}.connected"),
            }
            for x in self._network.transformers
            for bus in x.buses[1:]
        ]
        return lines

    def loads(self) -> list[dict[str, Any]]:
        """Loads with their active power [MW]."""
        return [
            {
                "name": load.name,
                "title": self.title(load.name),
                "bus": load.bus,
                "scale": self._of_grid(f"{load.name}.scale"),
                "p_mw": self._power_of(load.name, load.p_mw),
            }
            for load in self._network.loads
        ]

    def units(self) -> list[dict[str, Any]]:
        """Units and other devices at the network's ports."""
        rows = []
        for port in self._network.ports:
            plan = self._components.get(port.name)
            if plan is None:
                continue
            switch = f"{port.name}.connected"
            has_own = "connected" in plan.description.variables
            states = plan.description.states
            rows.append(
                {
                    "name": port.name,
                    "title": self.title(port.name),
                    "bus": port.bus,
                    "machine": any(state.endswith("machine.omega") for state in states),
                    "out": switch if has_own else self._of_grid(switch),
                }
            )
        return rows

    def _of_grid(self, variable: str) -> str | None:
        """The full name of a variable of the grid; None where it has none of this name."""
        known = self._plan.description.variables
        return f"{self._prepared.grid}.{variable}" if variable in known else None

    def _power_of(self, load: str, in_file: float) -> float:
        """Return the active power of a load [MW], by the parameter of the grid where it has one."""
        power = f"{load}.P"
        return self._plan.number(power) if power in self._plan.description.variables else in_file
