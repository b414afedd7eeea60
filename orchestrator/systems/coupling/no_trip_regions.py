"""Regions of voltage and frequency in which a code lets no inverter-based plant trip, as the limits of relays.

A relay with such limits trips its plant as soon as the code lets it. Source: NERC PRC-029-1, attachments 1 and 2, as
summarised by others; the standard's own text was not at hand."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import inf
from typing import Literal

from orchestrator.systems.coupling.relay_limits import Quantity, RelayLimits

NoTripCode = Literal["prc029"]

PRC029_LOW = ((0.25, 0.32), (0.5, 1.2), (0.7, 3.0), (0.9, 6.0))
"""Voltage [pu] below which a plant other than wind has to stay, and for how long in all [s]."""

PRC029_LOW_WIND = ((0.25, 0.16), (0.5, 1.2), (0.7, 2.5), (0.9, 3.0))
"""The same of wind plants that are connected by alternating current."""

PRC029_HIGH = ((1.05, 1800.0), (1.1, 1.0), (1.2, 0.0))
"""Voltage [pu] above which a plant has to stay, and for how long in all [s]."""

PRC029_FREQUENCIES = ((57.0, 61.8, 0.0), (58.8, 61.2, 299.0))
"""Frequencies [Hz] beyond which a plant has to stay, and for how long in all [s]."""

PRC029_RATED = 60.0  # frequency of the systems that the code is for [Hz]
_VOLTAGE_WINDOW = 10.0  # last seconds in which times beyond a voltage count together
_LONG_WINDOW = 3600.0  # the same of the voltage for which the code gives half an hour: an hour
_LONG = 600.0  # time [s] from which a voltage's is counted within the long window
_FREQUENCY_WINDOW = 600.0  # last seconds in which times beyond a frequency count together


@dataclass(frozen=True)
class NoTripRegion:
    """The limits of one code for one kind of plant, by quantity; ``rated``: of the frequency [Hz]."""

    title: str
    rated: float
    limits: Mapping[Quantity, tuple[RelayLimits, ...]]


def _prc029(title: str, low: tuple[tuple[float, float], ...]) -> NoTripRegion:
    voltages = [RelayLimits(below, inf, lasts, 0.0, _VOLTAGE_WINDOW) for below, lasts in low]
    for above, lasts in PRC029_HIGH:
        window = _LONG_WINDOW if lasts > _LONG else _VOLTAGE_WINDOW
        voltages.append(RelayLimits(-inf, above, lasts, 0.0, window if lasts else 0.0))
    frequencies = [
        RelayLimits(below, above, lasts, 0.0, _FREQUENCY_WINDOW if lasts else 0.0)
        for below, above, lasts in PRC029_FREQUENCIES
    ]
    limits: dict[Quantity, tuple[RelayLimits, ...]] = {
        "voltage": tuple(voltages),
        "frequency": tuple(frequencies),
    }
    return NoTripRegion(title, PRC029_RATED, limits)


NO_TRIP_REGIONS: Mapping[NoTripCode, tuple[NoTripRegion, NoTripRegion]] = {
    "prc029": (_prc029("PRC-029", PRC029_LOW), _prc029("PRC-029 for wind", PRC029_LOW_WIND))
}
"""Code → its region for plants other than wind, and for wind."""


def read_no_trip_code(text: str) -> str:
    """Read the name of a code with a region in which nobody may trip."""
    if text not in NO_TRIP_REGIONS:
        raise ValueError(f"{text!r} is no code; choose one of {', '.join(NO_TRIP_REGIONS)}")
    return text
