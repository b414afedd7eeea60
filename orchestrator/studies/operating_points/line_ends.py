"""Ends of lines that outages open: ``line_7_8 at bus_7``, from whose other bus the line stays charged."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

from orchestrator.core.errors import InputError
from orchestrator.core.options import Option
from orchestrator.studies.operating_points.point_columns import Elements

_AT = " at "


@dataclass(frozen=True)
class LineEnd:
    line: str
    bus: str

    @classmethod
    def of(cls, element: str) -> "LineEnd | None":
        """Return the end of a line that an element is; None for an element that is lost whole."""
        line, at, bus = element.rpartition(_AT)
        return cls(line, bus) if at else None

    @property
    def element(self) -> str:
        """Its name among the elements that outages take."""
        return f"{self.line}{_AT}{self.bus}"

    def side(self, elements: Elements) -> Literal["from", "to"]:
        """Return which of the line's ends it is."""
        return "from" if elements.ends[self.line][0] == self.bus else "to"

    def switch(self, elements: Elements) -> str:
        """Return the grid's variable of its switch."""
        return f"{self.line}.{self.side(elements)}_connected"


def line_of(element: str) -> str:
    """Return the line of an end, and any other element itself."""
    end = LineEnd.of(element)
    return element if end is None else end.line


def lines_with_ends(elements: Iterable[str]) -> frozenset[str]:
    """Return the lines of which any end is among these elements."""
    return frozenset(end.line for end in map(LineEnd.of, elements) if end is not None)


def read_end(text: str, elements: Elements) -> LineEnd | None:
    """Return the end of a line that a text names; None if it names none.

    Raises
    ------
    InputError
        If the branch has no two ends, does not lead to the bus, or is in a network that has transients.
    """
    end = LineEnd.of(text)
    if end is None:
        return None
    line = elements.file.identifier(end.line.strip(), elements.lines, Option.OUTAGES)
    if line not in elements.lines:
        return None
    where = Option.OUTAGES + f": {text!r}: "
    if line not in elements.ends:
        raise InputError(where + f"{line} has three windings, which open together; write {line}")
    buses = elements.ends[line]
    bus = elements.file.identifier(end.bus.strip(), buses, Option.OUTAGES)
    if bus not in buses:
        raise InputError(
            where + f"{line} joins {' and '.join(buses)}; write '{line} at {buses[0]}' or "
            f"'{line} at {buses[1]}'"
        )
    if not elements.of_phasors:
        raise InputError(
            where + "a line that opens at one end needs a network of phasors, and "
            f"{elements.grid!r} has transients; give "
            + Option.SET
            + ' models=phasor, or write models = "phasor" at the top of the case'
        )
    return LineEnd(line, bus)
