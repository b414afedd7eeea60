"""Branches of negative reactance, as equivalents of transformers have them: joined with what is in series with them.

A bus with two branches and nothing else carries one current. Both branches, without charging, are then exactly one
branch with the sum of their impedances.
"""

from fmus.grid.network import SMALLEST_REACTANCE, Line


def without_negative_reactances(lines: list[Line], kept: set[str]) -> tuple[list[Line], set[str]]:
    """The lines with each negative reactance joined to the line in series, and the buses that are no more.

    A negative reactance that nothing can be joined with stays, for the network to refuse by name.

    Parameters
    ----------
    lines
        All branches.
    kept
        Buses with a load, a generator or a shunt.
    """
    merged: set[str] = set()
    for line in [line for line in lines if line.X < SMALLEST_REACTANCE]:
        for bus in (line.from_bus, line.to_bus):
            others = [x for x in lines if bus in (x.from_bus, x.to_bus) and x is not line]
            joined = _joined(line, others[0], bus) if len(others) == 1 and bus not in kept else None
            if joined is not None:
                lines = [joined if x is others[0] else x for x in lines if x is not line]
                merged.add(bus)
                break
    return lines, merged


def _joined(line: Line, other: Line, bus: str) -> Line | None:
    """Two lines that meet at a bus as one, with the other's name; None where that is not exact or no line results."""
    if line.B or other.B or line.has_ratio or other.X + line.X < SMALLEST_REACTANCE:
        return None
    far = line.to_bus if line.from_bus == bus else line.from_bus
    ends = (other.from_bus, far) if other.to_bus == bus else (far, other.to_bus)
    if ends[0] == ends[1] or (other.has_ratio and other.from_bus == bus):
        return None
    return Line(other.name, *ends, other.X + line.X, other.R + line.R, 0.0, other.tap, other.shift)
