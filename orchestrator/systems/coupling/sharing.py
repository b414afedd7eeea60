"""Which thread does which calls of a group, and whether several are faster than one: by the time that calls took."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

# what a further thread costs in every step [s]: it is told to begin, and fetches what others wrote
HANDOVER = 2e-6


@dataclass(frozen=True)
class Shares:
    own: tuple[int, ...]  # calls that the calling thread alone may do
    # calls of each thread, the calling one first; any of them may do those of another that has not begun them
    of: tuple[tuple[int, ...], ...]
    seconds: float  # cost of the thread that has most to do [s]


def shares(
    calls: Sequence[int], bound: NDArray[np.bool_], costs: NDArray[np.float64], threads: int
) -> Shares:
    """Share out the calls of a group, the costly ones first, each to who has least.

    ``bound``: of every call, whether the calling thread alone may do it.
    ``costs``: of every call [s]."""
    own = tuple(call for call in calls if bound[call])
    loads = [0.0] * threads
    loads[0] = float(costs[list(own)].sum())
    parts: list[list[int]] = [[] for _ in range(threads)]
    for call in sorted((c for c in calls if not bound[c]), key=lambda c: -costs[c]):
        least = loads.index(min(loads))
        parts[least].append(call)
        loads[least] += float(costs[call])
    return Shares(own, tuple(tuple(sorted(part)) for part in parts), max(loads))


def best_number(
    groups: Sequence[Sequence[int]], bound: NDArray[np.bool_], costs: NDArray[np.float64], most: int
) -> int:
    """The number of threads, from 1 to ``most``, by which a step should take the least time."""

    def seconds(threads: int) -> float:
        found = (
            shares(group, bound, costs, threads if worth_sharing(group, bound) else 1)
            for group in groups
        )
        return sum(
            one.seconds + (HANDOVER * (threads - 1) if len(one.of) > 1 else 0.0) for one in found
        )

    return min(range(1, most + 1), key=seconds)


def worth_sharing(group: Sequence[int], bound: NDArray[np.bool_]) -> bool:
    """Return whether a second thread would find anything to do."""
    free = sum(not bound[call] for call in group)
    return free > 1 or (free == 1 and len(group) > 1)


_BLOCK = 50  # communication steps done one way before the other has its turn
# of a trial, half of them each way: other programs on the same cores disturb both alike
_BLOCKS = 8
# communication steps for which a trial's outcome counts: the load of a machine changes
_VALID = 5000


class Trial:
    def __init__(self) -> None:
        self._seconds, self._left = [0.0, 0.0], _BLOCK
        self._block: int | None = 0
        self.together = False

    @property
    def most(self) -> int:
        """Communication steps until the way may change."""
        return self._left

    def took(self, steps: int, seconds: float) -> None:
        self._left -= steps
        if self._block is not None:
            self._seconds[self.together] += seconds
        if self._left > 0:
            return
        block = 0 if self._block is None else self._block + 1
        if block < _BLOCKS:
            if block == 0:
                self._seconds = [0.0, 0.0]
            self._block, self.together, self._left = block, block % 2 == 1, _BLOCK
        else:
            alone, together = self._seconds
            self._block, self.together, self._left = None, together < alone, _VALID
