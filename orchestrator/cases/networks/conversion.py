"""Conversion of MATPOWER's tables to elements of our network.

Branches of negative reactance, as equivalents of transformers have them, are joined with what is in series with them. A
bus with two branches and nothing else carries one current: both branches, without charging, are then exactly one branch
with the sum of their impedances. A bus with three branches and nothing else is the star point of a three-winding
transformer, which is an element of its own."""

import math
from collections import Counter
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import TypeVar

from fmus.grid.network import SMALLEST_REACTANCE, Line, Load, Shunt, ThreeWinding
from fmus.toolchain.port_variables import SYSTEM_BASE_MVA
from orchestrator.cases.networks.branch_limits import FileLimits, Rating
from orchestrator.cases.networks.element_names import BranchName
from orchestrator.cases.networks.regions import Region
from orchestrator.cases.networks.sources import SourceTables
from orchestrator.core.arrays import Matrix
from orchestrator.core.foreign_files import one_line

_REFERENCE = 3  # MATPOWER's type of the reference bus
_OUT = 4  # MATPOWER's type of an isolated bus
_POWER_FACTOR = 0.9
_NEGLIGIBLE = 1e-9
_NO_LIMIT = 1e4
_RATE_A = 5  # column of MATPOWER's table of branches
_VMAX = 11  # columns of MATPOWER's table of buses
_VMIN = 12

_Value = TypeVar("_Value")


@dataclass(frozen=True, slots=True)
class Generation:
    """Total power [MW] and common voltage [pu] of the generators at a bus, a suitable rating [MVA], and their least and
    most reactive power together [Mvar], infinite where the source has no limit.

    ``is_rated``: whether the rating is the source's; otherwise it is a guess from powers and limits."""

    label: str
    p_mw: float
    v_pu: float
    rating_mva: float
    q_min_mvar: float = -math.inf
    q_max_mvar: float = math.inf
    is_rated: bool = False


@dataclass(frozen=True, slots=True)
class _Member:
    """One generator: its power [MW], voltage [pu], rating [MVA] and limits of reactive power [Mvar]."""

    p_mw: float
    v_pu: float
    rating_mva: float
    q_min_mvar: float = 0.0
    q_max_mvar: float = 0.0


@dataclass(frozen=True)
class ImportedNetwork:
    """Elements of a network, the generation at each bus, and the parts of constant impedance and current of loads [MW,
    Mvar], by the load's name. By bus, as the source has them: loads below zero [MW] and capacitors [Mvar]."""

    buses: tuple[str, ...] = ()
    lines: tuple[Line, ...] = ()
    loads: tuple[Load, ...] = ()
    shunts: tuple[Shunt, ...] = ()
    generation: dict[str, Generation] = field(default_factory=dict)
    slack: str | None = None
    frequency: float | None = None
    transformers: tuple[ThreeWinding, ...] = ()
    load_parts: dict[str, tuple[complex, complex]] = field(default_factory=dict)
    feeding: dict[str, float] = field(default_factory=dict)
    capacitors: dict[str, float] = field(default_factory=dict)
    limits: FileLimits = field(default_factory=FileLimits)  # by branch and by bus
    titles: dict[str, str] = field(default_factory=dict)  # names in the file, by bus
    branch_names: dict[str, BranchName] = field(default_factory=dict)  # as the file has them
    unit_names: dict[str, str] = field(default_factory=dict)  # of the generators, by bus
    regions: dict[str, Region] = field(default_factory=dict)  # area, zone, … by bus


def import_network(
    source: SourceTables, *, joined: bool = True, needed: Collection[int] = ()
) -> ImportedNetwork:
    """Convert a source's tables to elements. Everything out of service is left out.

    ``joined``: whether a negative load at a generator's bus is a part of the generators.
    ``needed``: numbers of buses at which something else stands, which stay."""
    rows = {int(row[0]): row for row in source.bus if int(row[1]) != _OUT}
    labels = {number: source.labels[number] for number in rows}
    lines, to_earth, ratings, names = _lines(source, labels)
    at_bus = _generators(source, labels)
    loads = _loads(source, rows, at_bus if joined else {})
    earthed = {n for n, y in to_earth.items() if abs(y) > _NEGLIGIBLE} | {
        n for n, r in rows.items() if any(r[4:6])
    }
    kept = {load.bus for load in loads} | {bus_of(labels[n]) for n in (*at_bus, *earthed, *needed)}
    lines, merged = without_negative_reactances(lines, kept)
    legs = _ratings_of_legs(lines, ratings)
    lines, transformers, stars = without_star_points(lines, kept)
    names |= _names_of_stars(transformers, names)
    for transformer in transformers:
        windings = [f"{transformer.name}.leg_{k + 1}" for k in range(3)]
        ratings |= {name: legs[name] for name in windings if name in legs}
    merged |= stars
    for number, row in rows.items():
        to_earth[number] = to_earth.get(number, 0j) + complex(row[4], row[5]) / source.base_mva
    shunts = [
        Shunt(f"shunt_{labels[n]}", bus_of(labels[n]), _clean(y.real), _clean(y.imag))
        for n, y in ((n, y * source.base_mva) for n, y in to_earth.items())
        if abs(y) > _NEGLIGIBLE
    ]
    buses = [bus_of(label) for label in labels.values()]
    reference = [n for n, row in rows.items() if int(row[1]) == _REFERENCE]
    generation = {n: _generation(labels[n], members) for n, members in at_bus.items()}
    feeding = {n: p for n, p in _fed(source, rows).items() if p < -_NEGLIGIBLE}
    capacitors = {n: float(row[5]) for n, row in rows.items() if row[5] > _NEGLIGIBLE}
    titles = {n: one_line(title) for n, title in source.titles.items() if title}
    unit_names = {n: one_line(name) for n, name in source.unit_names.items()}
    return ImportedNetwork(
        tuple(bus for bus in buses if bus not in merged),
        tuple(lines),
        loads=tuple(loads),
        shunts=tuple(shunts),
        generation=_by_bus(generation, labels),
        slack=bus_of(labels[reference[0]]) if reference else None,
        frequency=source.frequency,
        transformers=tuple(transformers),
        load_parts=_load_parts(source, labels),
        feeding=_by_bus(feeding, labels),
        capacitors=_by_bus(capacitors, labels),
        limits=FileLimits(ratings, _bands(rows, labels)),
        titles=_by_bus(titles, labels),
        branch_names=names,
        unit_names=_by_bus(unit_names, labels),
        regions=_by_bus(source.regions, labels),
    )


def _by_bus(by_number: Mapping[int, _Value], labels: Mapping[int, str]) -> dict[str, _Value]:
    """Values by the names of the buses that are in service, from values by the numbers of all."""
    return {bus_of(labels[n]): value for n, value in by_number.items() if n in labels}


def bus_of(label: str) -> str:
    return f"bus_{label}"


def _bands(rows: Mapping[int, Matrix], labels: Mapping[int, str]) -> dict[str, tuple[float, float]]:
    """Least and most voltage [pu] of the buses that have both."""
    found = {}
    for number, row in rows.items():
        if len(row) > _VMIN and 0 < row[_VMIN] < row[_VMAX]:
            found[bus_of(labels[number])] = float(row[_VMIN]), float(row[_VMAX])
    return found


def _ratings_of_legs(lines: list[Line], ratings: Mapping[str, Rating]) -> dict[str, Rating]:
    """Ratings of three branches at one bus by the names of a transformer's legs, which they may become."""
    at: dict[str, list[str]] = {}
    for line in lines:
        for bus in (line.from_bus, line.to_bus):
            at.setdefault(bus, []).append(line.name)
    found = {}
    for bus, names in at.items():
        for k, name in enumerate(names):
            if len(names) == 3 and name in ratings:
                found[f"transformer_{bus.removeprefix('bus_')}.leg_{k + 1}"] = ratings[name]
    return found


def branch_names(source: SourceTables) -> list[str | None]:
    """Return the names of the lines that the rows of branches become; None for one out of service."""
    labels = {int(row[0]): source.labels[int(row[0])] for row in source.bus if row[1] != _OUT}
    found: list[str | None] = []
    seen: Counter[str] = Counter()
    for row in source.branch:
        start, end = int(row[0]), int(row[1])
        if row[10] == 0 or start not in labels or end not in labels:
            found.append(None)
            continue
        name = f"line_{labels[start]}_{labels[end]}"
        seen[name] += 1
        found.append(name if seen[name] == 1 else f"{name}_{seen[name]}")
    return found


def _lines(
    source: SourceTables, labels: dict[int, str]
) -> tuple[list[Line], dict[int, complex], dict[str, Rating], dict[str, BranchName]]:
    """Branches, for each bus the part of their admittance to earth that our π section cannot hold [pu of the
    source], and the ratings and names that the source has.

    A π section has one capacitance for both ends; a conductance, a difference between the ends and an inductive
    part (magnetisation) go to the buses."""
    lines: list[Line] = []
    to_earth: dict[int, complex] = {}
    ratings: dict[str, Rating] = {}
    names: dict[str, BranchName] = {}
    called = source.branch_names or [BranchName() for _ in source.branch]
    scale = SYSTEM_BASE_MVA / source.base_mva
    for row, (y_from, y_to), own, name in zip(
        source.branch, source.branch_to_earth, called, branch_names(source), strict=True
    ):
        if name is None:
            continue
        start, end = int(row[0]), int(row[1])
        tap = float(row[8]) or 1.0
        b = max(0.0, 2 * min(y_from.imag, y_to.imag))
        for bus, rest in ((start, (y_from - 0.5j * b) / tap**2), (end, y_to - 0.5j * b)):
            to_earth[bus] = to_earth.get(bus, 0j) + complex(rest)
        names[name] = BranchName(one_line(own.name), one_line(own.circuit))
        if 0 < row[_RATE_A] < math.inf:
            ratings[name] = Rating(float(row[_RATE_A]), by_current=row[8] == 0)
        lines.append(
            Line(
                name,
                bus_of(labels[start]),
                bus_of(labels[end]),
                X=float(row[3]) * scale,
                R=float(row[2]) * scale,
                B=float(b) / scale,
                tap=tap,
                shift=math.radians(float(row[9])),
            )
        )
    return lines, to_earth, ratings, _circuits_of_parallel(lines, names)


def _circuits_of_parallel(
    lines: list[Line], names: Mapping[str, BranchName]
) -> dict[str, BranchName]:
    """Names of branches; the circuit only if another branch joins the same buses, as it tells them apart."""
    joining = Counter(frozenset((line.from_bus, line.to_bus)) for line in lines)
    found = {}
    for line in lines:
        own = names[line.name]
        is_parallel = joining[frozenset((line.from_bus, line.to_bus))] > 1
        kept = BranchName(own.name, own.circuit if is_parallel else "")
        if kept != BranchName():
            found[line.name] = kept
    return found


def _names_of_stars(
    transformers: list[ThreeWinding], names: Mapping[str, BranchName]
) -> dict[str, BranchName]:
    """Names of the transformers that stand in the place of three branches, which are those of its windings."""
    found = {}
    for transformer in transformers:
        star = transformer.name.removeprefix("transformer_")
        for bus in transformer.buses:
            own = names.get(f"line_{bus.removeprefix('bus_')}_{star}", BranchName())
            if own.name:
                found[transformer.name] = BranchName(own.name)
    return found


def _generators(source: SourceTables, labels: dict[int, str]) -> dict[int, list[_Member]]:
    at_bus: dict[int, list[_Member]] = {}
    for row in source.gen:
        if row[7] > 0 and int(row[0]) in labels:
            p, most = float(row[1]), float(row[8])
            reactive = max(abs(float(row[3])), abs(float(row[4])))
            needed = max(abs(p), most) or (reactive if reactive < _NO_LIMIT else 0.0)
            least, largest = (
                q if abs(q) < _NO_LIMIT else math.copysign(math.inf, q)
                for q in map(float, row[[4, 3]])
            )
            if least == largest == 0:  # not known, as in pandapower's tables
                least, largest = -math.inf, math.inf
            member = _Member(p, float(row[5]), needed / _POWER_FACTOR, least, largest)
            at_bus.setdefault(int(row[0]), []).append(member)
    return at_bus


def _loads(
    source: SourceTables, rows: dict[int, Matrix], at_bus: dict[int, list[_Member]]
) -> list[Load]:
    """Loads; a negative one is static generation. At a generator's bus it is added to the generators there, unless it
    has parts that follow the voltage. At a bus with loads of both signs those below zero are an element of their own,
    ``static_<bus>``."""
    loads = []
    for number, row in rows.items():
        label, p, q = source.labels[number], float(row[2]), float(row[3])
        parts = source.load_parts.get(number, ())
        if number in source.feeding:
            fed = source.feeding[number].power
            p, q = p - fed.real, q - fed.imag
            loads.append(Load(f"static_{label}", bus_of(label), _clean(fed.real), _clean(fed.imag)))
        if p < -_NEGLIGIBLE and number in at_bus and not parts:
            at_bus[number].append(_Member(-p, at_bus[number][0].v_pu, -p / _POWER_FACTOR))
        elif max(map(abs, (p, q, *parts))) > _NEGLIGIBLE:
            loads.append(Load(f"load_{label}", bus_of(label), _clean(p), _clean(q)))
    return loads


def _fed(source: SourceTables, rows: Mapping[int, Matrix]) -> dict[int, float]:
    """Return the active power of loads by bus [MW], of those below zero alone at a bus with both signs."""
    drawn = {number: float(row[2]) for number, row in rows.items()}
    return drawn | {n: fed.power.real for n, fed in source.feeding.items() if n in rows}


def _load_parts(
    source: SourceTables, labels: Mapping[int, str]
) -> dict[str, tuple[complex, complex]]:
    """Return the parts of constant impedance and current by the names of the loads [MW, Mvar]."""
    parts = {f"load_{labels[n]}": x for n, x in source.load_parts.items() if n in labels}
    for number, fed in source.feeding.items():
        if number in labels and any(fed.parts):
            parts[f"static_{labels[number]}"] = fed.parts
    return parts


def _generation(label: str, members: list[_Member]) -> Generation:
    rating = round(sum(m.rating_mva for m in members), 1) or SYSTEM_BASE_MVA
    least, most = sum(m.q_min_mvar for m in members), sum(m.q_max_mvar for m in members)
    return Generation(label, sum(m.p_mw for m in members), members[0].v_pu, rating, least, most)


def _clean(value: float) -> float:
    return 0.0 if abs(value) < _NEGLIGIBLE else float(value)


def without_negative_reactances(lines: list[Line], kept: set[str]) -> tuple[list[Line], set[str]]:
    """The lines with each negative reactance joined to the line in series, and the buses that are no more.

    A negative reactance that nothing can be joined with stays, for the network to refuse by name."""
    merged: set[str] = set()
    for line in [line for line in lines if line.X < SMALLEST_REACTANCE]:
        for bus in (line.from_bus, line.to_bus):
            others = [x for x in lines if bus in (x.from_bus, x.to_bus) and x is not line]
            joined = _joined(line, others[0], bus) if len(others) == 1 and bus not in kept else None
            if joined:
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
    if (
        line.B
        or other.B
        or other.X + line.X < SMALLEST_REACTANCE
        or line.from_bus == other.from_bus
    ):
        return None
    square = line.tap**2
    X, R = (other.X + line.X) * square, (other.R + line.R) * square
    return Line(
        other.name,
        other.from_bus,
        line.from_bus,
        X,
        R,
        tap=other.tap / line.tap,
        shift=other.shift - line.shift,
    )


def without_star_points(
    lines: list[Line], kept: set[str]
) -> tuple[list[Line], list[ThreeWinding], set[str]]:
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
    # the ratio is at the star: taken to the other side
    turned = [leg.from_bus == star for leg in legs]
    square = [leg.tap**2 if inner else 1.0 for leg, inner in zip(legs, turned, strict=True)]
    ratios, shifts = [], []
    for leg, inner in zip(legs, turned, strict=True):
        ratios.append(1 / leg.tap if inner else leg.tap)
        shifts.append(-leg.shift if inner else leg.shift)
    found = ThreeWinding(
        f"transformer_{star.removeprefix('bus_')}",
        (ends[0], ends[1], ends[2]),
        _three([leg.X * n for leg, n in zip(legs, square, strict=True)]),
        _three([leg.R * n for leg, n in zip(legs, square, strict=True)]),
        _three(ratios),
        _three(shifts),
    )
    return found if found.is_passive and len(set(ends)) == 3 else None


def _three(values: list[float]) -> tuple[float, float, float]:
    return values[0], values[1], values[2]
