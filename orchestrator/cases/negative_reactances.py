"""Branches of negative reactance, as equivalents of transformers have them: joined with what is in series with them.

A bus with two branches and nothing else carries one current. Both branches, without charging, are then exactly one
branch with the sum of their impedances. A bus with three branches and nothing else is the star point of a three-winding
transformer, which is an element of its own."""

from fmus.grid.network import SMALLEST_REACTANCE, Line, ThreeWinding


def without_negative_reactances(lines: list[Line], kept: set[str]) -> tuple[list[Line], set[str]]:
    """The lines with each negative reactance joined to the line in series, and the buses that are no more.

    A negative reactance that nothing can be joined with stays, for the network to refuse by name."""
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
    if line.has_ratio and bus not in (line.from_bus, other.from_bus):
        return _joined_legs(line, other)
    if line.B or other.B or line.has_ratio or other.X + line.X < SMALLEST_REACTANCE:
        return None
    far = line.to_bus if line.from_bus == bus else line.from_bus
    ends = (other.from_bus, far) if other.to_bus == bus else (far, other.to_bus)
    if ends[0] == ends[1] or (other.has_ratio and other.from_bus == bus):
        return None
    return Line(other.name, *ends, other.X + line.X, other.R + line.R, 0.0, other.tap, other.shift)


def _joined_legs(line: Line, other: Line) -> Line | None:
    """Two legs of a transformer, each with its ratio at its outer end: what is behind both ratios, behind one."""
    if line.B or other.B or other.X + line.X < SMALLEST_REACTANCE or line.from_bus == other.from_bus:
        return None
    square = line.tap**2
    X, R = (other.X + line.X) * square, (other.R + line.R) * square
    return Line(other.name, other.from_bus, line.from_bus, X, R, 0.0, other.tap / line.tap, other.shift - line.shift)


def without_star_points(lines: list[Line], kept: set[str]) -> tuple[list[Line], list[ThreeWinding], set[str]]:
    """The lines without those of negative reactance at star points, the transformers in their place, and the buses that
    are no more."""
    transformers, gone = [], set[str]()
    for line in [line for line in lines if line.X < SMALLEST_REACTANCE]:
        for star in {line.from_bus, line.to_bus} - kept - gone:
            legs = [x for x in lines if star in (x.from_bus, x.to_bus)]
            found = _transformer(star, legs)
            if line in legs and found is not None:
                transformers.append(found)
                lines = [x for x in lines if x not in legs]
                gone.add(star)
                break
    return lines, transformers, gone


def _transformer(star: str, legs: list[Line]) -> ThreeWinding | None:
    """Three branches that meet at a bus as one transformer; None where that is not exact."""
    if len(legs) != 3 or any(leg.B for leg in legs):
        return None
    ends = [(leg.to_bus if leg.from_bus == star else leg.from_bus) for leg in legs]
    turned = [leg.from_bus == star for leg in legs]  # the ratio is at the star: taken to the other side
    square = [leg.tap**2 if inner else 1.0 for leg, inner in zip(legs, turned, strict=True)]
    found = ThreeWinding(
        f"transformer_{star.removeprefix('bus_')}",
        (ends[0], ends[1], ends[2]),
        _three([leg.X * n for leg, n in zip(legs, square, strict=True)]),
        _three([leg.R * n for leg, n in zip(legs, square, strict=True)]),
        _three([1 / leg.tap if inner else leg.tap for leg, inner in zip(legs, turned, strict=True)]),
        _three([-leg.shift if inner else leg.shift for leg, inner in zip(legs, turned, strict=True)]),
    )
    return found if found.is_passive and len(set(ends)) == 3 else None


def _three(values: list[float]) -> tuple[float, float, float]:
    return values[0], values[1], values[2]
