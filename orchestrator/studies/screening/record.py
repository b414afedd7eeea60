"""The record of a stretch of a screening."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from orchestrator.cases.networks.branch_limits import Loading, Outlier
from orchestrator.linear.spectra.mode_tracking import ModeSet
from orchestrator.studies.operating_points.item import Status
from orchestrator.studies.operating_points.widening import Widening
from orchestrator.studies.points.task import Kept


@dataclass(frozen=True)
class WantedRuns:
    """How long the run of an outage goes on after it, and its fault before it [s]; None for no fault."""

    seconds: float
    cleared_after: float | None = None


@dataclass(frozen=True)
class RelayTrip:
    """A relay that acted in the run of an outage, or a motor that stalled.

    ``of``: the unit, load or bus that it protects; ``record``: its record, "" of what happens inside a model; ``time``:
    when its breaker opened [s]; ``seen``: voltage [pu] or frequency [Hz] when it tripped, inside a model the power that
    goes off [MW]."""

    of: str
    record: str
    time: float
    seen: float
    message: str


@dataclass(frozen=True)
class WentWrong:
    """A finding of the run of an outage that no stable system gives, with its begin [s]."""

    kind: str
    component: str
    time: float
    message: str


@dataclass(frozen=True)
class OutageRun:
    """A run from the point before an outage, in which it happens.

    ``until``: where the run ends [s]."""

    until: float
    trips: tuple[RelayTrip, ...] = ()
    went_wrong: tuple[WentWrong, ...] = ()


@dataclass(frozen=True)
class ItemRecord:
    # status, text: what became of it, and why; of a computed one what was lost and who feeds it instead
    status: Status
    text: str = ""
    cause: str = ""  # the text of a failure without key and scenario; "" where it names none
    warnings: tuple[str, ...] = ()
    beyond: dict[str, float] = field(default_factory=dict)  # units beyond their rating [pu of it]
    # those of the warnings that ask about these ratings
    of_rating: tuple[str, ...] = ()
    reactive: str = ""  # the bus whose units are furthest beyond their limits of reactive power
    # of the file's ratings and bands: the branch that is loaded most and all beyond their rating, buses outside of
    # their band; the worst first
    loadings: tuple[Loading, ...] = ()
    outliers: tuple[Outlier, ...] = ()
    has_flow: bool = False  # whether there is a power flow, without which nothing is known of both
    residual: float = float("nan")
    # whether no mode grows; None where that is not known: nothing was computed, growth was not ``counted``, or a limit
    # is so close that the linear model is doubtful
    stable: bool | None = None
    counted: bool = False  # whether growing eigenvalues were counted at all frequencies
    # number of growing eigenvalues outside of what was searched; a pair counts twice
    growing_elsewhere: int = 0
    # real and imaginary part [rad/s] of the one of them that grows fastest; None where they were only counted
    fastest: tuple[float, float] | None = None
    # whether that one is the drift of the common speed, which no governor holds
    drifts: bool = False
    # whether the modes come from a search of their own rather than from a neighbour's
    searched: bool = False
    # number of eigenvalues that are zero, where growth was counted: one may be the free angle, others are a frequency
    # or a voltage that nothing restores
    zeros: int = 0
    # Growth [1/s] from which it was counted at all frequencies; slower growth was sought in the range and near 0 only.
    # 0 where all eigenvalues are known.
    slowest: float = 0.0
    # whether swings of machines were looked for above the range; real and imaginary part [rad/s] of the least damped
    # one, None without any, and who takes part most in it
    looked_above: bool = False
    above: tuple[float, float] | None = None
    who_above: str = ""
    # of the modes that are followed [rad/s]
    eigenvalues: NDArray[np.complex128] = field(default_factory=lambda: np.zeros(0, dtype=complex))
    # places of those that are within the range and below the damping, least damped first
    critical: tuple[int, ...] = ()
    # participation of every component, by its name
    shares: dict[str, NDArray[np.float32]] = field(default_factory=dict)
    # of every converter, by its name: from its active and its reactive power reference to its frequency, shape (2, m)
    # [rad/s, by pu and pu]
    residues: dict[str, NDArray[np.complex64]] = field(default_factory=dict)
    # reference, links: place in the stretch of the item from which the modes are followed, and of each mode's
    # predecessor there; −1 where there is none
    reference: int = -1
    links: tuple[int, ...] = ()
    lasting: bool = True  # whether computing it again would give the same
    # communication steps of the map whose modes these are; 0 of the system without a communication step
    map_steps: int = 0
    run: OutageRun | None = None  # the outage as it happens, where that was asked for
    widenings: tuple[Widening, ...] = ()  # limits beyond which the operating point lies


@dataclass(frozen=True)
class StretchRecord(Kept):
    items: tuple[ItemRecord, ...]  # the anchor first, and then what was asked for
    # first, last: modes of the anchor and of the last intact item, by which neighbouring stretches are joined; None
    # where these have none
    first: ModeSet | None = None
    last: ModeSet | None = None
    last_place: int = 0  # place of the last intact item
    # perturbed, reused: numbers of components that were perturbed, and of those whose linear model was there already
    perturbed: int = 0
    reused: int = 0

    @property
    def lasting(self) -> bool:
        return all(item.lasting for item in self.items)
