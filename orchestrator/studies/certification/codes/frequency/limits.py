"""The limit of ``gfor certify --code frequency``: the stiffness at the terminals that codes' phase jumps come to."""

from dataclasses import dataclass

import numpy as np

from orchestrator.studies.certification.codes.programme import jumps
from orchestrator.studies.certification.codes.stiffness import Stiffness

POWER = 0.5  # active power at which a device is measured, half of its rating [pu]

# MISO and ERCOT ask in time for a power against a jump of the angle (MISO BPM-015 r32 appendix H):
JUMP = np.deg2rad(10.0)  # of the angle [rad]
OPPOSED = 0.2  # least power against it [pu]
SCR = 3.0  # short-circuit ratio of the grid
LONGEST = 0.015  # time within which 90 % of the first change has come [s]


@dataclass(frozen=True)
class AskedStiffness:
    """The least |P/θ| that the criterion of phase jumps comes to, and the |P/θ| that was found."""

    value: float  # least |P/θ| that it asks for at the terminals [pu/rad]
    band: tuple[float, float]  # frequencies at which it asks for it [Hz]
    # found, at: least |P/θ| in the band [pu/rad], and its frequency [Hz].
    found: float
    at: float

    @property
    def met(self) -> bool:
        return self.found >= self.value

    def sentence(self) -> str:
        low, high = self.band
        return (
            f"{OPPOSED:g} pu against {np.rad2deg(JUMP):g}° at SCR {SCR:g} (MISO, ERCOT) asks, by this program's "
            f"derivation, for |P/θ| of {self.value:.3g} pu/rad from {low:.3g} to {high:.3g} Hz: "
            f"{'met' if self.met else 'not met'}, {self.found:.3g} at {self.at:.3g} Hz; no code says so"
        )


def asked_stiffness(found: Stiffness, f_n: float) -> AskedStiffness:
    """Compare a device with what the criterion of phase jumps comes to.

    A stiffness K at the terminals and that of the grid, K_g = X/|Z|², lie in series: a jump Δθ of the source moves the
    power by Δθ/(1/K + 1/K_g), which is to be `OPPOSED` or more. The power is a mean over a period T, so that K has to
    last as long: an angle that follows the bus with the time constant T has its corner at 1/(2π·T). And 90 % of the
    change within `LONGEST` is what a lag of `LONGEST`/ln 10 reaches, whose corner is the upper end of the band."""
    Z = jumps(SCR, POWER, ()).impedance
    asked = 1 / (JUMP / OPPOSED - abs(Z) ** 2 / Z.imag)
    band = (f_n / (2 * np.pi), float(np.log(10) / (2 * np.pi * LONGEST)))
    return AskedStiffness(float(asked), band, *found.least("P/theta", *band))
