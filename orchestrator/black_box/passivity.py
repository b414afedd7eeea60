"""Passivity of an admittance over frequency.

With currents counted into the device, Y = −i/v, a device is passive at a frequency where Y + Yᴴ has no negative
eigenvalue: it then takes power from every oscillation there and can drive none. A negative index names the frequencies
at which it could, together with a grid that lets it."""

from dataclasses import dataclass

import numpy as np

from orchestrator.arrays import Numbers
from orchestrator.black_box.frequency_response import FrequencyResponse


@dataclass(frozen=True)
class Passivity:
    frequencies: Numbers
    index: Numbers  # smallest eigenvalue of (Y + Yᴴ)/2 [unit of Y], shape (f,)
    # ``index`` over the largest singular value of Y: from −1, where the device only delivers power, to 1
    relative: Numbers
    bounds: Numbers  # bounds of ``index``, from the bounds of Y

    def ranges(self) -> list[tuple[float, float]]:
        """Ranges of measured frequencies [Hz] in which the index is negative beyond its bound."""
        found: list[tuple[float, float]] = []
        before = False
        for f, active in zip(self.frequencies.tolist(), (self.index < -self.bounds).tolist(), strict=True):
            if active:
                found = [*found[:-1], (found[-1][0], f)] if before else [*found, (f, f)]
            before = active
        return found


def passivity(response: FrequencyResponse) -> Passivity:
    """Passivity of the device itself, without the communication's hold; its response must be a square admittance."""
    Y = -response.continuous()
    index = np.linalg.eigvalsh((Y + Y.conj().transpose(0, 2, 1)) / 2)[:, 0]
    size = np.linalg.norm(Y, ord=2, axis=(1, 2))
    bounds = np.asarray(np.linalg.norm(response.bounds, axis=(1, 2)), dtype=float)
    return Passivity(
        response.frequencies, np.asarray(index, dtype=float), np.asarray(index / size, dtype=float), bounds
    )
