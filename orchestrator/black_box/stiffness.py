"""The admittance of a device in powers: how it opposes a change of the voltage's angle, magnitude and frequency."""

from dataclasses import dataclass

import numpy as np

from orchestrator.arrays import Complex, Numbers
from orchestrator.black_box.frequency_response import FrequencyResponse


@dataclass(frozen=True)
class Stiffness:
    """Powers that a device feeds in, over changes of the voltage at its terminals."""

    frequencies: Numbers  # of the change [Hz], shape (f,)
    # p_theta, q_v: P over the angle [pu/rad], and Q over the relative change of the magnitude [pu], shape (f,)
    p_theta: Complex
    q_v: Complex
    # p_v, q_theta: the same crosswise [pu, pu/rad], shape (f,)
    p_v: Complex
    q_theta: Complex
    p_omega: Complex  # P over the frequency of the voltage [pu/pu], shape (f,)

    def least(self, values: Complex, low: float, high: float) -> tuple[float, float]:
        """Least size of one of them in a band, and its frequency [Hz]."""
        inside = np.flatnonzero((self.frequencies >= low) & (self.frequencies <= high))
        if not len(inside):
            raise ValueError(f"no frequency was measured from {low:g} to {high:g} Hz")
        at = inside[int(np.argmin(np.abs(values[inside])))]
        return float(abs(values[at])), float(self.frequencies[at])


def stiffness(response: FrequencyResponse, voltage: complex, omega_b: float) -> Stiffness:
    """Change the basis of a measured response.

    With S = v·i* and i = Y·v in real and imaginary parts, a change dv gives dS = dv·i* + v·(Y·dv)*. A change of the
    angle is dv = j·v·dθ, one of the magnitude dv = v·dV/V."""
    Y = response.continuous()
    current = complex(*response.operating_point)
    by_voltage = np.array([[current.real, current.imag], [-current.imag, current.real]])
    by_current = np.array([[voltage.real, voltage.imag], [voltage.imag, -voltage.real]])
    powers = by_voltage + by_current @ Y
    turned, longer = (np.array([change.real, change.imag]) for change in (1j * voltage, voltage))
    (p_theta, q_theta), (p_v, q_v) = (powers @ turned).T, (powers @ longer).T
    p_omega = p_theta * omega_b / (2j * np.pi * response.frequencies)
    return Stiffness(response.frequencies, p_theta, q_v, p_v, q_theta, p_omega)
