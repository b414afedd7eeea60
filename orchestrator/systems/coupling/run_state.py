"""All that a run is at one communication point, so that another process can go on from there to the last bit."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, Self, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from orchestrator.core.errors import InputError
from orchestrator.devices.fmi.component import Component
from orchestrator.devices.fmi.description import FmuDescription

Position = Mapping[str, Any]  # how far an observer has come: numbers and arrays by name


@runtime_checkable
class Resumable(Protocol):
    """An observer that can go on in another process."""

    def position(self) -> Position:
        """All that has to be kept of what was observed."""

    def resume(self, position: Position) -> None:
        """Go on from there; called before `begin`, and the first communication point is not observed again."""


@dataclass(frozen=True)
class RunState:
    """A run after its observers have looked at a communication point."""

    index: int
    applied: bool  # whether the events of this communication point have happened
    handed_over: bool  # whether the newest outputs were handed to all components already
    # seconds, spent: wall-clock time so far [s], and that inside each component's calls, in the order of the schedule
    seconds: float
    spent: NDArray[np.float64]
    # y, tracks: the coupled outputs, and where they went since the last look
    y: NDArray[np.float64]
    tracks: NDArray[np.float64]
    # the outputs one step earlier, where inputs are extrapolated; else empty
    before: NDArray[np.float64]
    components: Mapping[str, bytes]  # serialised state of each FMU; empty at the end of a run
    observers: Sequence[Position]  # position of each observer that is `Resumable`, in their order
    # of connections that do more than carry a value, group by group: delay lines, noise generators, settings, and what
    # arrived last
    wires: Sequence[Mapping[str, NDArray[np.float64]]]

    def arrays(self) -> dict[str, NDArray[Any]]:
        found: dict[str, NDArray[Any]] = {
            "place": np.array([self.index, self.applied, self.handed_over], dtype=np.int64),
            "seconds": np.array([self.seconds, *self.spent]),
            "y": self.y,
            "tracks": self.tracks,
            "before": self.before,
            "observers": np.array(len(self.observers)),
            "wires": np.array(len(self.wires)),
        }
        found |= {
            f"component {n}": np.frombuffer(state, dtype=np.uint8)
            for n, state in self.components.items()
        }
        for k, position in enumerate(self.observers):
            found |= {
                f"observer {k} {name}": np.asarray(values) for name, values in position.items()
            }
        for k, bank in enumerate(self.wires):
            found |= {f"wires {k} {name}": values for name, values in bank.items()}
        return found

    @classmethod
    def of_arrays(cls, arrays: Mapping[str, NDArray[Any]]) -> Self:
        def beginning(head: str) -> dict[str, NDArray[Any]]:
            return {
                name.removeprefix(head): values
                for name, values in arrays.items()
                if name.startswith(head)
            }

        index, applied, handed_over = map(int, arrays["place"].tolist())
        seconds, *spent = arrays["seconds"].tolist()
        states = {name: state.tobytes() for name, state in beginning("component ").items()}
        observers = [
            _position(beginning(f"observer {k} ")) for k in range(int(arrays["observers"]))
        ]
        return cls(
            index=index,
            applied=bool(applied),
            handed_over=bool(handed_over),
            seconds=seconds,
            spent=np.array(spent),
            y=arrays["y"],
            tracks=arrays["tracks"],
            before=arrays["before"],
            components=states,
            observers=observers,
            wires=[beginning(f"wires {k} ") for k in range(int(arrays["wires"]))],
        )


def _position(arrays: Mapping[str, NDArray[Any]]) -> Position:
    """An observer's position, in which an array without dimensions is a single value."""
    return {name: values if values.ndim else values.item() for name, values in arrays.items()}


def resume_observers(observers: Iterable[object], kept: RunState) -> None:
    resumable = [observer for observer in observers if isinstance(observer, Resumable)]
    if len(resumable) != len(kept.observers):
        raise InputError(
            f"the run was kept with {len(kept.observers)} observers that can go on, and has {len(resumable)} now; give "
            "it the same ones, or begin it anew"
        )
    for observer, position in zip(resumable, kept.observers, strict=True):
        observer.resume(position)


class Keeper(Protocol):
    def latest(self) -> RunState | None:
        """Where the run is to go on; None where it is to begin."""

    def is_due(self) -> bool:
        """Return whether the state is to be kept now."""

    def keep(self, state: Callable[[], RunState]) -> None:
        """Keep the present state; the one before it may be forgotten."""

    def finish(self, state: Callable[[], RunState]) -> None:
        """Keep the state at the end, which needs no state of any FMU."""


class _NotKept:
    def latest(self) -> None:
        """See `Keeper.latest`."""

    def is_due(self) -> bool:
        return False

    def keep(self, state: Callable[[], RunState]) -> None:
        """See `Keeper.keep`."""

    def finish(self, state: Callable[[], RunState]) -> None:
        """See `Keeper.finish`."""


NOT_KEPT = _NotKept()  # the keeper of a run that nobody wants to go on with


def why_not_kept(description: FmuDescription) -> str | None:
    """Why a running instance of an FMU cannot be kept; None where it can."""
    if not description.can_save_state:
        return "it declares no canGetAndSetFMUstate"
    return None if description.can_serialize_state else "it declares no canSerializeFMUstate"


def state_as_bytes(component: Component) -> bytes:
    state = component.save_state()
    try:
        return component.serialize_state(state)
    finally:
        component.free_state(state)


def set_state(component: Component, content: bytes) -> None:
    state = component.deserialize_state(content)
    try:
        component.restore_state(state)
    finally:
        component.free_state(state)
