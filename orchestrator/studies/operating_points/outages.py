"""Outages: which elements leave the network, and what remains of it."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from orchestrator.cases.flow.connected import connected_parts
from orchestrator.cases.form.names import close_names
from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.core.errors import InputError, few
from orchestrator.core.options import Option
from orchestrator.studies.operating_points.line_ends import LineEnd, line_of, read_end
from orchestrator.studies.operating_points.point_columns import Elements

INTACT = "intact"  # name of the network without an outage
_KINDS = ("n-1", "lines", "units")
_SHOWN = 4  # buses of an island that a message names
# the name of the outage of a unit with its own transformer, ``sg3 (line_6_1)``
_WITH_TRANSFORMER = re.compile(r"^(\S+)\s*\((\S+)\)$")
_AUXILIARY = 0.05
"""Load of a plant's own, in parts of its rating: cut off with so little, its units are lost; with more, an island is
left.
"""


@dataclass(frozen=True)
class Outage:
    """Elements that are lost together; none for the intact network."""

    name: str
    elements: tuple[str, ...] = ()


def read_outages(text: str | None, elements: Elements) -> list[Outage]:
    """The intact network, and the outages that a text names.

    ``text``: ``n-1`` (each line, transformer and unit; a unit with its own transformer is one outage), ``lines``,
    ``units``, or names with commas between them; None for none. ``line_1_2+sg3`` loses two elements together, and so
    does ``sg3 (line_6_1)``, as a unit with its own transformer is called; ``line_1_2 at bus_1`` opens one end.
    Names in the network's file mean their elements."""
    names: list[str] = []
    for part in (part.strip() for part in (text or "").split(",") if part.strip()):
        names += (
            _of_kind(part.lower(), elements)
            if part.lower() in _KINDS
            else [elements.file.identifier(part, elements.names, Option.OUTAGES)]
        )
    found = [Outage(INTACT)]
    for name in names:
        parts = _WITH_TRANSFORMER.sub(r"\1+\2", name).split("+")
        lost = tuple(_element(one.strip(), elements) for one in parts)
        if any(set(lost) == set(other.elements) for other in found) or len(set(lost)) < len(lost):
            raise InputError(Option.OUTAGES + f": {name} is named twice; name it once")
        found.append(Outage(name, lost))
    return found


def _element(text: str, elements: Elements) -> str:
    """Return the identifier of the element, or of the end of a line, that a text names."""
    found = elements.file.identifier(text, elements.names, Option.OUTAGES)
    if found in elements.names:
        return found
    end = read_end(text, elements)
    if end is None:
        hint = close_names(text, elements.names, f"write {', '.join(_KINDS)}, or names of elements")
        raise InputError(
            Option.OUTAGES + f": there is no unit, line, DC line, load or shunt {text!r}; {hint}"
        )
    return end.element


def _of_kind(kind: str, elements: Elements) -> list[str]:
    if kind != "n-1":
        return list(elements.lines) if kind == "lines" else _units_alone(elements)
    own = {unit: branch for branch, unit in elements.step_ups.items() if branch in elements.lines}
    lines = [name for name in elements.lines if name not in elements.step_ups]
    return lines + [
        f"{name} ({own[name]})" if name in own else name for name in _units_alone(elements)
    ]


def _units_alone(elements: Elements) -> list[str]:
    """Return the units as outages: both stations of a DC line are one, which has the first one's name."""
    found: list[str] = []
    for name in elements.units:
        if elements.other_ends.get(name) not in found:
            found.append(name)
    return found


@dataclass(frozen=True)
class Remains:
    why_none: str = ""  # why no system remains; "" where one does
    # units, loads, shunts: what is out of service or dead: without a way to the part that remains
    units: tuple[str, ...] = ()
    loads: tuple[str, ...] = ()
    shunts: tuple[str, ...] = ()
    charging: tuple[str, ...] = ()  # the grid's variables of the charging of dead lines
    # lost branches that stay closed, because a dead part hangs on each: nothing flows there
    ties: tuple[str, ...] = ()
    dead: tuple[str, ...] = ()


def what_remains(prepared: PreparedScenario, elements: Elements, out: Sequence[str]) -> Remains:
    """Return what outages leave: of all parts with a unit in service, the one with the most load remains."""
    network = prepared.network
    assert network is not None
    parts = _Parts.of(prepared, elements, tuple(map(line_of, out)))
    of_bus = parts.of_bus
    fed = {of_bus[bus] for bus in parts.units.values()}
    if not fed:
        return Remains("no unit is left, so no system remains")
    main = max(fed, key=lambda part: (parts.load_in(part), parts.rating_in(part)))
    dead = [bus for bus in network.buses if of_bus[bus] != main]
    for part in fed - {main}:
        if parts.load_in(part) > _AUXILIARY * parts.rating_in(part):
            return Remains(parts.island_sentence(part, dead))
    ties, joined = _ties(parts.lost, of_bus)
    if any(joined[of_bus[bus]] != joined[main] for bus in dead):
        return Remains(
            f"{few(dead, _SHOWN)} cut off by branches that the case or the point has open"
        )
    gone = [name for name in elements.units if name in parts.out]
    gone += [name for name, bus in parts.units.items() if of_bus[bus] != main]
    gone += [elements.other_ends[name] for name in gone if name in elements.other_ends]
    loads = tuple(
        name
        for name, bus in parts.loads.items()
        if name in parts.out or (of_bus[bus] != main and parts.powers[name])
    )
    shunts = tuple(
        x.name for x in network.shunts if x.name in elements.shunts and of_bus[x.bus] != main
    )
    ends = [end for end in map(LineEnd.of, out) if end is not None]
    charged = {end.line for end in ends if end.bus in dead}  # from the bus that remains
    open_or_charged = set(parts.out) - set(ties) | charged
    charging = tuple(
        x.variable("B")
        for x in network.lines
        if x.B and x.name not in open_or_charged and {x.from_bus, x.to_bus} & set(dead)
    )
    return Remains(
        units=tuple(dict.fromkeys(gone)),
        loads=loads,
        shunts=shunts,
        charging=charging,
        ties=tuple(dict.fromkeys(ties)),
        dead=tuple(dead),
    )


@dataclass(frozen=True)
class _Parts:
    """The network in the parts into which outages cut it; each bus has the number of its part."""

    of_bus: Mapping[str, int]
    out: tuple[str, ...]  # what is lost, a line of which one end is open among it
    lost: Sequence[tuple[str, str, str]]  # branches among it that were closed, with two buses each
    units: Mapping[str, str]  # bus of each unit in service
    ratings: Mapping[str, float]  # of these units [MVA]
    loads: Mapping[str, str]  # bus of each load
    powers: Mapping[str, float]  # of all loads [MW]

    @classmethod
    def of(cls, prepared: PreparedScenario, elements: Elements, out: tuple[str, ...]) -> "_Parts":
        network, components = prepared.network, prepared.system.components
        assert network is not None
        grid = components[elements.grid]
        values = grid.parameters
        branches = [(x.name, x.from_bus, x.to_bus) for x in network.lines]
        branches += [(x.name, x.buses[0], bus) for x in network.transformers for bus in x.buses[1:]]
        closed = [(one, other) for name, one, other in branches if _closed(name, out, values)]
        lost = [
            branch
            for branch in branches
            if branch[0] in out and values.get(f"{branch[0]}.connected", True)
        ]
        units = {name: bus for name, bus in elements.units.items() if _closed(name, out, values)}
        powers = {
            x.name: grid.number(f"{x.name}.scale") * grid.number(f"{x.name}.P")
            for x in network.loads
        }
        return cls(
            connected_parts(network.buses, closed),
            out=out,
            lost=lost,
            units=units,
            ratings={name: components[name].number("S_n") for name in units},
            loads={x.name: x.bus for x in network.loads},
            powers=powers,
        )

    def load_in(self, part: int) -> float:
        """The load in a part [MW], without loads that are lost."""
        inside = (name for name, bus in self.loads.items() if self.of_bus[bus] == part)
        return sum(self.powers[name] for name in inside if name not in self.out)

    def units_in(self, part: int) -> list[str]:
        return [name for name, bus in self.units.items() if self.of_bus[bus] == part]

    def rating_in(self, part: int) -> float:
        """The ratings of a part's units [MVA]."""
        return sum(self.ratings[name] for name in self.units_in(part))

    def island_sentence(self, part: int, dead: Sequence[str]) -> str:
        """Which buses are an island that goes on without those that remain."""
        buses = few((bus for bus in dead if self.of_bus[bus] == part), _SHOWN)
        return (
            f"{buses} cut off, with {self.load_in(part):.4g} MW of load and the units "
            f"{', '.join(self.units_in(part))}, which may go on alone"
        )


def _ties(
    lost: Sequence[tuple[str, str, str]], part: Mapping[str, int]
) -> tuple[list[str], dict[int, int]]:
    """Return the lost branches on which a part of the network hangs, and of each part the one that they join it to."""
    ties: list[str] = []
    joined = {k: k for k in set(part.values())}
    for name, one, other in lost:
        a, b = joined[part[one]], joined[part[other]]
        if a != b:
            ties.append(name)
            joined = {k: a if at == b else at for k, at in joined.items()}
    return ties, joined


def _closed(name: str, out: Sequence[str], values: Mapping[str, float | bool]) -> bool:
    switches = (f"{name}.{x}" for x in ("connected", "from_connected", "to_connected"))
    return name not in out and all(values.get(switch, True) for switch in switches)
