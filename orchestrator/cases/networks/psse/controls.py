"""Taps and switched shunts of a PSS/E file that hold a voltage in a band, step by step."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import accumulate

from orchestrator.cases.networks.psse.raw_records import NODES, Record

_DISCRETE = 1  # MODSW of a shunt that steps by its blocks
_VOLTAGE = 1  # COD of a tap that holds a voltage
_MOST_POSITIONS = 1000  # of a tap or a shunt; more are a mistake in the file
_STAT = 32  # first revision with STAT of a switched shunt
_BLOCKS = 8  # of a switched shunt at most


@dataclass(frozen=True, slots=True)
class TapRecord:
    """A ratio at winding 1 of two that holds the voltage of a bus between ``least`` and ``most`` [pu].

    ``positions``: ratios of the whole transformer, rising; ``raises``: whether a higher one raises the voltage."""

    bus: int
    least: float
    most: float
    positions: tuple[float, ...]
    raises: bool


@dataclass(frozen=True, slots=True)
class ShuntRecord:
    """A shunt at the bus ``place`` that holds the voltage of ``bus`` between ``least`` and ``most`` [pu].

    ``initial``, ``positions``: BINIT, and what its blocks come to, rising [Mvar at 1 pu]."""

    place: int
    bus: int
    least: float
    most: float
    initial: float
    positions: tuple[float, ...]

    def at(self, place: int, bus: int) -> "ShuntRecord":
        """Return the same shunt with other buses."""
        return replace(self, place=place, bus=bus)


def tap_record(
    line: Record, column: int, buses: tuple[int, int], factor: float, *, has_node: bool
) -> TapRecord | None:
    """Return the control of a transformer's tap; None if it holds no voltage, or by a law that is not taken over.

    ``line``, ``column``: the record of winding 1, and its column of COD; ``factor``: from a ratio as the record has it
    to that of the transformer; ``has_node``: whether a node stands behind the bus, as from revision 35 on."""
    if len(line.fields) <= column or line.whole(column, "COD", 0) != _VOLTAGE:
        return None
    controlled, next_one = line.whole(column + 1, "CONT", 0), column + 2 + has_node
    highest, lowest = line.number(next_one, "RMA", 1.1), line.number(next_one + 1, "RMI", 0.9)
    most, least = line.number(next_one + 2, "VMA", 1.1), line.number(next_one + 3, "VMI", 0.9)
    count = line.whole(next_one + 4, "NTP", 33)
    is_corrected = line.whole(next_one + 5, "TAB", 0) != 0
    is_compensated = any(
        line.number(next_one + 6 + k, name, 0.0) for k, name in enumerate(("CR", "CX"))
    )
    if is_corrected or is_compensated or not (controlled and 0 < least < most):
        return None
    if not (0 < lowest < highest and factor > 0 and 1 < count <= _MOST_POSITIONS):
        return None
    step = (highest - lowest) / (count - 1)
    positions = tuple(factor * (lowest + k * step) for k in range(count))
    bus = abs(controlled)
    # PSS/E: a sign tells the side of a bus that is not the transformer's own
    at_first = bus == buses[0] or (bus != buses[1] and controlled < 0)
    return TapRecord(bus, least, most, positions, raises=at_first)


def shunt_record(record: Record, revision: int, place: int) -> ShuntRecord | None:
    """Return the control of a switched shunt; None if it does not step by its blocks to hold a voltage."""
    has_status, has_identifier = revision >= _STAT, revision >= NODES
    mode = 1 + has_identifier
    if record.whole(mode, "MODSW", 1) != _DISCRETE:
        return None
    if has_status and record.whole(mode + 1, "ADJM", 0):
        return None
    high = 4 if has_status else 2
    high = 5 if has_identifier else high
    most, least = record.number(high, "VSWHI", 1.0), record.number(high + 1, "VSWLO", 1.0)
    bus = record.whole(high + 2, "SWREM", 0) or place
    initial = high + (6 if has_identifier else 5)
    blocks = shunt_blocks(record, initial + 1, with_status=has_identifier)
    positions = {0.0, *accumulate(x for x in blocks if x > 0)}
    positions |= {*accumulate(x for x in blocks if x < 0)}
    if not (0 < least < most and 1 < len(positions) <= _MOST_POSITIONS):
        return None
    own = record.number(initial, "BINIT", 0.0)
    return ShuntRecord(place, abs(bus), least, most, own, tuple(sorted(positions)))


def shunt_blocks(record: Record, column: int, *, with_status: bool) -> Sequence[float]:
    """Return the steps of a switched shunt one by one, in the order in which they are switched on [Mvar]."""
    found: list[float] = []
    width = 2 + with_status
    for first in range(column, column + _BLOCKS * width, width):
        is_on = not with_status or record.whole(first, "S", 1)
        count = record.whole(first + with_status, "N", 0)
        step = record.number(first + with_status + 1, "B", 0.0)
        found += [step] * count if is_on and 0 < count <= _MOST_POSITIONS else []
    return found
