"""Ratings of branches and bands of bus voltages as a network file has them, beside a power flow."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field

from fmus.toolchain.port_variables import SYSTEM_BASE_MVA
from orchestrator.cases.flow.balance import FlowLine
from orchestrator.cases.flow.power_flow import PowerFlow


@dataclass(frozen=True, slots=True)
class Rating:
    """The load that a branch carries for good: RATEA [MVA], of a line at 1 pu: its current counts, as in PSS/E."""

    mva: float
    by_current: bool


@dataclass(frozen=True, slots=True)
class FileLimits:
    """Ratings by branch, and least and most voltage [pu] by bus; empty where the file has none."""

    ratings: Mapping[str, Rating] = field(default_factory=dict)
    bands: Mapping[str, tuple[float, float]] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Loading:
    branch: str
    part: float  # of its rating [1]

    @property
    def beyond(self) -> bool:
        return self.part > 1


@dataclass(frozen=True, slots=True)
class Outlier:
    """A bus outside of its band, with its voltage and the limit that it misses [pu]."""

    bus: str
    voltage: float
    limit: float


def loadings(
    flow: PowerFlow, limits: FileLimits, dead: Collection[str] = ()
) -> tuple[Loading, ...]:
    """The branch that is loaded most and all others beyond their rating, the worst first.

    ``dead``: buses that are cut off, whose voltages mean nothing."""
    lines = {line.name: line for line in flow.lines if line.closed and line.from_bus not in dead}
    found = []
    for name, rating in limits.ratings.items():
        # a leg with its ratio apart begins with that
        line = lines.get(f"{name}_ratio", lines.get(name))
        if line is not None and line.to_bus not in dead:
            found.append(Loading(name, _carried(line, flow, limits, rating) / rating.mva))
    found.sort(key=lambda one: -one.part)
    return tuple(one for k, one in enumerate(found) if not k or one.beyond)


def _carried(line: FlowLine, flow: PowerFlow, limits: FileLimits, rating: Rating) -> float:
    """Return what flows at the end where it is more [MVA]; at a star point of a transformer nothing is measured."""
    ends = (line.from_bus, line.to_bus)
    powers = line.powers(flow.voltages[ends[0]], flow.voltages[ends[1]])
    outer = [k for k in (0, 1) if ends[k] in limits.bands] or [0, 1]
    size = [abs(powers[k]) for k in outer]
    if rating.by_current:
        size = [s / abs(flow.voltages[ends[k]]) for s, k in zip(size, outer, strict=True)]
    return SYSTEM_BASE_MVA * max(size)


def outliers(
    flow: PowerFlow, limits: FileLimits, dead: Collection[str] = ()
) -> tuple[Outlier, ...]:
    """Buses outside of their bands, the one furthest outside first."""
    found = []
    for bus, (least, most) in limits.bands.items():
        if bus in dead or bus not in flow.voltages:
            continue
        magnitude = abs(flow.voltages[bus])
        if not least <= magnitude <= most:
            found.append(Outlier(bus, magnitude, most if magnitude > most else least))
    return tuple(sorted(found, key=lambda one: -abs(one.voltage - one.limit)))
