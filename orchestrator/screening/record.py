"""What is kept of a stretch of a screening."""

from dataclasses import dataclass, field, fields
from enum import StrEnum
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from orchestrator.analysis.mode_tracking import ModeSet
from orchestrator.cases.schema import Value
from orchestrator.points.executor import WorkerLostError
from orchestrator.points.store import Arrays


class Status(StrEnum):
    """What became of an operating point with an outage."""

    COMPUTED = "computed"
    ISLANDING = "islanding"
    POWER_FLOW = "no power flow"
    STEADY_STATE = "no steady state"
    VALUES = "values refused"
    MODES = "no modes"
    FMU = "FMU failed"
    LOST = "worker lost"
    INTERNAL = "internal error"


@dataclass(frozen=True)
class Item:
    point: int
    outage: int
    values: dict[str, Value]  # of the operating point, by ``component.variable``
    out: tuple[str, ...]  # elements out of service: the point's own and the outage's
    lost: tuple[str, ...] = ()  # those of them that only the outage takes

    @property
    def intact(self) -> bool:
        """Whether no outage adds to what the point itself has out of service."""
        return self.outage == 0


@dataclass(frozen=True)
class ItemRecord:
    # status, text: what became of it, and why; of a computed one what was lost and who feeds it instead
    status: Status
    text: str = ""
    warnings: tuple[str, ...] = ()
    residual: float = float("nan")
    # whether no mode grows; None where that is not known: nothing was computed, growth was not ``counted``, or a limit
    # is so close that the linear model is doubtful
    stable: bool | None = None
    counted: bool = False  # whether growing eigenvalues were counted at all frequencies
    growing_elsewhere: int = 0  # number of growing eigenvalues outside of what was searched; a pair counts twice
    # real and imaginary part [rad/s] of the one of them that grows fastest; None where they were only counted
    fastest: tuple[float, float] | None = None
    searched: bool = False  # whether the modes come from a search of their own rather than from a neighbour's
    # number of eigenvalues that are zero, where growth was counted: one may be the free angle, others are a frequency
    # or a voltage that nothing restores
    zeros: int = 0
    # Growth [1/s] from which it was counted at all frequencies; slower growth was sought in the range and near 0 only.
    # 0 where all eigenvalues are known.
    slowest: float = 0.0
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


_IN_ARRAYS = ("eigenvalues", "shares", "residues")


@dataclass(frozen=True)
class StretchRecord:
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

    @classmethod
    def lost(cls, task: Any, error: WorkerLostError) -> Self:
        return cls(tuple(ItemRecord(Status.LOST, str(error), lasting=False) for _ in range(1 + len(task.items))))

    def stored(self) -> tuple[dict[str, Any], Arrays]:
        """Header and arrays for a `PointStore`."""
        names = [f.name for f in fields(ItemRecord) if f.name not in _IN_ARRAYS]
        header: dict[str, Any] = {
            "items": [{name: getattr(item, name) for name in names} for item in self.items],
            "shares": [list(item.shares) for item in self.items],
            "residues": [list(item.residues) for item in self.items],
            "last_place": self.last_place,
            "perturbed": self.perturbed,
            "reused": self.reused,
            "names": [list(ends.names) if ends is not None else None for ends in (self.first, self.last)],
        }
        arrays: Arrays = {}
        for k, item in enumerate(self.items):
            arrays[f"e{k}"] = item.eigenvalues
            arrays[f"s{k}"] = np.array(list(item.shares.values()), dtype=np.float32)
            arrays[f"r{k}"] = np.array(list(item.residues.values()), dtype=np.complex64)
        for end, modes in (("first", self.first), ("last", self.last)):
            if modes is not None:
                arrays |= {f"{end}_values": modes.eigenvalues}
                arrays |= {f"{end}_{side}": getattr(modes, side).astype(np.complex64) for side in ("left", "right")}
        return header, arrays

    @classmethod
    def restored(cls, header: dict[str, Any], arrays: Arrays) -> Self | None:
        """The record that was stored in this form; None if the file has another form."""
        try:
            items = []
            for k, entry in enumerate(header["items"]):
                shares = dict(zip(header["shares"][k], arrays[f"s{k}"], strict=True))
                residues = dict(zip(header["residues"][k], arrays[f"r{k}"], strict=True))
                tuples = {name: tuple(entry[name]) for name in ("warnings", "critical", "links")}
                if entry["fastest"] is not None:
                    tuples["fastest"] = tuple(entry["fastest"])
                items.append(ItemRecord(**entry | tuples | {"status": Status(entry["status"])},
                                        eigenvalues=arrays[f"e{k}"], shares=shares, residues=residues))  # fmt: skip
            first, last = (
                _end(end, names, arrays) for end, names in zip(("first", "last"), header["names"], strict=True)
            )
            return cls(tuple(items), first, last, header["last_place"], header["perturbed"], header["reused"])
        except (KeyError, TypeError, ValueError):
            return None

    @property
    def as_kept(self) -> Self:
        """The same with the accuracy that a file keeps, so that a kept and a new stretch are joined in the same way."""
        found = self.restored(*self.stored())
        assert found is not None
        return found


def _end(end: str, names: list[str] | None, arrays: Arrays) -> ModeSet | None:
    """The modes at an end of a stretch, from its file."""
    if names is None:
        return None
    return ModeSet(arrays[f"{end}_values"], arrays[f"{end}_left"], arrays[f"{end}_right"], tuple(names))
