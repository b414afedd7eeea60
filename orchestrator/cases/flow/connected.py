"""Parts of a network that no branch joins."""

from collections.abc import Hashable, Iterable
from typing import TypeVar

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

Bus = TypeVar("Bus", bound=Hashable)


def connected_parts(buses: Iterable[Bus], ends: Iterable[tuple[Bus, Bus]]) -> dict[Bus, int]:
    """Return the number of the part that each bus is in.

    ``ends``: the buses of each branch in service."""
    row = {bus: k for k, bus in enumerate(buses)}
    pairs = [(row[start], row[end]) for start, end in ends]
    starts, stops = (np.array([pair[k] for pair in pairs], dtype=int) for k in (0, 1))
    links = coo_array((np.ones(len(pairs)), (starts, stops)), shape=(len(row), len(row)))
    _, part = connected_components(links, directed=False)
    return {bus: int(part[k]) for bus, k in row.items()}
