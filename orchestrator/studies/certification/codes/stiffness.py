"""How stiff a source a device is: the powers that it feeds in over changes of its voltage, by frequency."""

from dataclasses import dataclass

import numpy as np

from orchestrator.core.arrays import Complex, Numbers
from orchestrator.studies.black_box.frequency_response import FrequencyResponse
from orchestrator.studies.immittance.forms import powers_over


@dataclass(frozen=True)
class Stiffness:
    """Powers that a device feeds in, over changes of the voltage at its terminals, at frequencies [Hz]."""

    frequencies: Numbers
    powers: dict[str, Complex]  # as of `powers_over`

    def least(self, name: str, low: float, high: float) -> tuple[float, float]:
        inside = np.flatnonzero((self.frequencies >= low) & (self.frequencies <= high))
        if not len(inside):
            raise ValueError(f"no frequency was measured from {low:g} to {high:g} Hz")
        sizes = np.abs(self.powers[name][inside])
        return float(sizes.min()), float(self.frequencies[inside[int(np.argmin(sizes))]])


def stiffness(response: FrequencyResponse, voltage: complex, f_n: float) -> Stiffness:
    f, Y, current = response.frequencies, response.continuous(), complex(*response.operating_point)
    return Stiffness(f, powers_over(f, Y, voltage, current, f_n))
