"""Usual ranges of a network's data; those of components are declared by their models.

The ranges are wide: they find a wrong unit (ms for s, kVA for MVA) or a wrong base, and do not judge data."""

from fmus.toolchain.variables import Usual

_LINE = "lines and transformers on 100 MVA, from 20 kV cables to tie lines"
LINE_X = Usual(1e-5, 10, _LINE, slip="in ohms or in percent")
LINE_B = Usual(0, 10, _LINE)
LINE_RATIO = Usual(
    0.7, 1.4, "tap changers and off-nominal ratios; 11 public networks have 0.74 to 1.2"
)
COMPENSATION = Usual(0.05, 0.9, "series capacitors take 20 to 80 % of a line's reactance, widened")
STRAY_B = Usual(0, 1, "a stray capacitance is small")
MOST_R_OVER_X = 5.0  # largest usual R/X of a line; low-voltage cables come near it
# smallest usual rating of a unit, as a part of the largest unit's rating in the same network
SMALLEST_SHARE = 1e-3
