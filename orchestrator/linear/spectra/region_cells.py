"""Cells of a region of the complex plane: ranges of frequencies between two damping ratios."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from orchestrator.linear.spectra.modes import damping_ratio


@dataclass(frozen=True)
class RegionCell:
    """A part of the region: Im λ from ``low`` to ``high`` [rad/s], damping ratio from ``least`` to ``most``."""

    low: float
    high: float
    least: float
    most: float

    @property
    def corners(self) -> list[complex]:
        return [omega * edge for omega in (self.low, self.high) for edge in self._edges]

    @property
    def _edges(self) -> tuple[complex, complex]:
        """λ at 1 rad/s on both sides."""
        first, last = (
            complex(-ratio / np.sqrt(1 - ratio**2), 1.0) for ratio in (self.least, self.most)
        )
        return first, last

    @property
    def centre(self) -> complex:
        return complex(np.mean(self.corners))

    @property
    def radius(self) -> float:
        return max(abs(corner - self.centre) for corner in self.corners)

    def holds(self, value: complex) -> bool:
        """Return whether a point lies in the cell, which includes its lower edges but not the upper ones."""
        return self.low <= value.imag < self.high and self.least <= damping_ratio(value) < self.most

    def halves(self) -> tuple["RegionCell", "RegionCell"]:
        """Cut across the longer side."""
        if self.high - self.low > (self.most - self.least) * self.high:
            middle = float(np.sqrt(self.low * self.high))
            return replace(self, high=middle), replace(self, low=middle)
        between = (self.least + self.most) / 2
        return replace(self, most=between), replace(self, least=between)

    def highest(self, stretch: float, along: float = 1.0) -> "tuple[RegionCell, ...]":
        """Cut off its highest frequencies, up to a ratio, and return them and what is left.

        ``along``: factor by which the ratio may be larger where nothing is left then."""
        if self.high <= stretch * along * self.low:
            return (self,)
        cut = self.high / stretch
        return replace(self, low=cut), replace(self, high=cut)

    def joined(self, other: "RegionCell") -> "RegionCell | None":
        """The cell with another one right above it; None where that is elsewhere."""
        if replace(other, low=self.low, high=self.high) != self or self.high != other.low:
            return None
        return replace(self, high=other.high)

    def within(self, centre: complex, radius: float) -> "RegionCell | None":
        """Return the range of its frequencies in which a disc [rad/s] holds the cell's whole width; None: nowhere.

        At Im λ = ω an edge e of the cell is at λ = ω·e, which lies in the disc where |ω·e − centre| ≤ radius."""
        low, high = self.low, self.high
        for edge in self._edges:
            middle = (edge * centre.conjugate()).real / abs(edge) ** 2
            inside = middle**2 - (abs(centre) ** 2 - radius**2) / abs(edge) ** 2
            if inside <= 0:
                return None
            low, high = max(low, middle - inside**0.5), min(high, middle + inside**0.5)
        return replace(self, low=low, high=high) if low < high else None

    def beside(self, part: "RegionCell") -> Iterator["RegionCell"]:
        """Yield the cells below and above a range of its frequencies."""
        if self.low < part.low:
            yield replace(self, high=part.low)
        if part.high < self.high:
            yield replace(self, low=part.high)

    @property
    def stretch(self) -> float:
        """Logarithm of the ratio of its frequencies."""
        return float(np.log(self.high / self.low))
