"""Operating points at which a device is measured, and its figures there."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from orchestrator.studies.certification.codes.frequency.figures import (
    Impedances,
    Springs,
    TerminalSwing,
)
from orchestrator.studies.certification.codes.frequency.strength import Strengths

NAMED = (
    1.0,
    5.0,
    10.0,
    25.0,
    50.0,
    100.0,
    300.0,
)  # frequencies at which impedances are printed [Hz]


@dataclass(frozen=True)
class ScannedPoint:
    active: float  # power fed in [pu of the rating]
    reactive: float  # the same
    voltage: float  # at the terminals [pu]

    def __str__(self) -> str:
        return f"P {self.active:g}, Q {self.reactive:g}, V {self.voltage:g} pu"


POINTS = (
    ScannedPoint(0.5, 0.0, 1.0),
    ScannedPoint(0.05, 0.0, 1.0),
    ScannedPoint(0.9, 0.3, 1.0),
    ScannedPoint(0.9, -0.3, 1.0),
    ScannedPoint(0.5, 0.0, 0.95),
)
"""At which a device is measured: half, hardly any and almost full power, reactive power either way, a low voltage."""


@dataclass(frozen=True)
class AtPoint:
    """A device at one operating point. ``swing`` is measured at the first one; ``failure``: why nothing is known."""

    point: ScannedPoint
    failure: str = ""
    springs: Springs | None = None
    impedances: Impedances | None = None
    active_hz: tuple[tuple[float, float], ...] = ()  # where it can feed an oscillation
    strengths: Strengths | None = None
    swing: TerminalSwing | None = None

    def figures(self) -> dict[str, Any]:
        """Figures as JSON's types."""
        given: dict[str, Any] = {
            "P": self.point.active,
            "Q": self.point.reactive,
            "V": self.point.voltage,
            "failure": self.failure,
        }
        if self.springs is None or self.impedances is None or self.strengths is None:
            return given
        z, of = self.impedances, self.springs
        reactances = np.interp(NAMED, z.frequencies, z.reactance).tolist()
        ratios = [vars(one) for one in self.strengths.ratios]
        return given | {
            "met": of.met,
            "springs": {
                "angle": vars(of.angle),
                "magnitude": vars(of.magnitude),
                "asked": of.asked.value,
                "band_hz": list(of.asked.band),
            },
            "reactance": dict(zip(map("{:g}".format, NAMED), reactances, strict=True)),
            "active_hz": [list(band) for band in self.active_hz],
            "strength": {
                "scr_limit": self.strengths.limit,
                "ratios": ratios,
            },
            "swing": None if self.swing is None else vars(self.swing),
        }
