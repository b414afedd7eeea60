"""Impedance correction tables of a RAW file: factors of transformers' impedances by ratio or by phase shift.

Each table has points (T, F), between which PSS/E interpolates. T is a phase shift in degrees if the first one is below
0.5 or the last one above 1.5, and else the winding's ratio in pu of its bus' base voltage (PSS/E's Program Operation
Manual, "Transformer impedance correction tables"). F is real up to revision 33, and complex after."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from orchestrator.cases.networks.psse.raw_records import SWITCHING_DEVICES, RawFile, Record

_LEAST_RATIO = 0.5  # below which the first T is a phase shift [degrees]
_MOST_RATIO = 1.5  # the same of the last T, if above


@dataclass(frozen=True)
class CorrectionTable:
    """Factors F of an impedance at rising T: ratios [pu], or phase shifts [degrees]."""

    places: tuple[float, ...]
    factors: tuple[complex, ...]

    @property
    def is_of_shift(self) -> bool:
        """Return whether T is a phase shift."""
        return self.places[0] < _LEAST_RATIO or self.places[-1] > _MOST_RATIO

    def factor(self, ratio: float, shift: float) -> complex:
        """Return F at a ratio [pu] or a shift [degrees], and that of the nearest end beyond the table's."""
        place = shift if self.is_of_shift else ratio
        return complex(np.interp(place, self.places, np.array(self.factors)))


def correction_tables(raw: RawFile) -> dict[int, CorrectionTable]:
    """Return the tables of a file by number.

    Raises an `InputError` if T does not rise, or a factor is 0."""
    points: dict[int, list[tuple[float, complex]]] = {}
    heads: dict[int, Record] = {}
    width = 2 if raw.revision < SWITCHING_DEVICES else 3  # numbers of a point
    number = 0
    is_open = (
        False  # whether the next line goes on with the table, as F = 0 ends it from revision 34 on
    )
    for record in raw.of("impedance correction"):
        first = 0
        if not is_open:
            number, first = record.whole(0, "the table's number I"), 1
            heads.setdefault(number, record)
        found = points.setdefault(number, [])
        is_open = width > 2
        for k in range(first, len(record.fields), width):
            place, factor = _point(record, k, width)
            if not factor:
                is_open = False
                break
            found.append((place, factor))
    return {number: _table(heads[number], found) for number, found in points.items() if found}


def _point(record: Record, at: int, width: int) -> tuple[float, complex]:
    """Return T and F, which is 0 behind the last point."""
    imaginary = record.number(at + 2, "Im(F)", 0.0) if width > 2 else 0.0
    factor = complex(record.number(at + 1, "F", 0.0), imaginary)
    return record.number(at, "T", 0.0), factor


def _table(head: Record, points: Sequence[tuple[float, complex]]) -> CorrectionTable:
    places = tuple(place for place, _ in points)
    if any(one >= other for one, other in pairwise(places)):
        listed = ", ".join(f"{place:g}" for place in places)
        raise head.error(f"T of the impedance correction table is {listed}; it must rise")
    return CorrectionTable(places, tuple(factor for _, factor in points))
