"""Outages: which elements leave the network, and what an outage cuts off."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from orchestrator.cases.names import close_names
from orchestrator.cases.prepare import PreparedScenario
from orchestrator.errors import InputError
from orchestrator.screening.columns import Elements

INTACT = "intact"
"""Name of the network without an outage."""

_KINDS = ("n-1", "lines", "units")
_SHOWN = 4


@dataclass(frozen=True)
class Outage:
    """Elements that are lost together; none for the intact network."""

    name: str
    elements: tuple[str, ...] = ()


def read_outages(text: str | None, elements: Elements) -> list[Outage]:
    """The intact network, and the outages that a text names.

    Parameters
    ----------
    text
        ``n-1`` (each line, transformer and unit), ``lines``, ``units``, or names with commas between them, where
        ``line_1_2+sg3`` loses two elements together; None for none.
    elements
        Of the scenario.

    Raises
    ------
    InputError
        If there is no such element, or an outage is named twice.
    """
    names: list[str] = []
    for part in (part.strip() for part in (text or "").split(",") if part.strip()):
        names += _of_kind(part.lower(), elements) if part.lower() in _KINDS else [part]
    found = [Outage(INTACT)]
    for name in names:
        lost = tuple(one.strip() for one in name.split("+"))
        for one in lost:
            if one not in elements.names:
                hint = close_names(one, elements.names, f"write {', '.join(_KINDS)}, or names of elements")
                raise InputError(f"--outages: there is no unit, line, load or shunt {one!r}; {hint}")
        if any(set(lost) == set(other.elements) for other in found) or len(set(lost)) < len(lost):
            raise InputError(f"--outages: {name} is named twice; name it once")
        found.append(Outage(name, lost))
    return found


def _of_kind(kind: str, elements: Elements) -> list[str]:
    lines = list(elements.lines) if kind in ("n-1", "lines") else []
    return lines + (list(elements.units) if kind in ("n-1", "units") else [])


def cut_off(prepared: PreparedScenario, elements: Elements, out: Sequence[str]) -> str:
    """What has no way to the slack bus any more, in words; "" where all has.

    Parameters
    ----------
    prepared
        With the values of the operating point.
    elements
        Of the scenario.
    out
        Elements out of service.
    """
    network, grid = prepared.network, prepared.system.components[elements.grid]
    assert network is not None
    row = {bus: k for k, bus in enumerate(network.buses)}
    ends = [(x.from_bus, x.to_bus) for x in network.lines if _closed(x.name, out, grid.parameters)]
    for winding in (x for x in network.transformers if _closed(x.name, out, grid.parameters)):
        ends += [(winding.buses[0], bus) for bus in winding.buses[1:]]
    starts, stops = ([row[end[k]] for end in ends] for k in (0, 1))
    links = coo_array((np.ones(len(ends)), (starts, stops)), shape=(len(row), len(row)))
    _, part_of = connected_components(links, directed=False)
    slack = elements.slack or next(iter(elements.units.values()))
    lost = [bus for bus in network.buses if part_of[row[bus]] != part_of[row[slack]]]
    if not lost:
        return ""
    megawatts = sum(grid.number(f"{x.name}.scale") * grid.number(f"{x.name}.P") for x in network.loads if x.bus in lost)
    units = [unit for unit, bus in elements.units.items() if bus in lost and unit not in out]
    what = [f"{megawatts:.4g} MW of load"] * bool(megawatts) + [f"the units {', '.join(units)}"] * bool(units)
    more = f" and {len(lost) - _SHOWN} more" if len(lost) > _SHOWN else ""
    return f"{', '.join(lost[:_SHOWN])}{more} cut off, with {' and '.join(what) or 'neither load nor unit'}"


def _closed(name: str, out: Sequence[str], values: Mapping[str, float | bool]) -> bool:
    return name not in out and bool(values.get(f"{name}.connected", True))
