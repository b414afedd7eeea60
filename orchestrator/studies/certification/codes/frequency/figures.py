"""Figures of a device from its admittance: impedance, stiffness, inertia and damping."""

from dataclasses import dataclass

import numpy as np

from orchestrator.core.arrays import Complex, Numbers, Vector
from orchestrator.studies.certification.codes.frequency.limits import (
    AskedStiffness,
    asked_stiffness,
)
from orchestrator.studies.certification.codes.stiffness import Stiffness

TOLD = (1.0, 300.0)  # frequencies of impedances and passivity [Hz]
SLOW = 0.5  # highest frequency from which inertia and damping are read [Hz]


@dataclass(frozen=True)
class Impedances:
    """Matrix from the current into a device to its voltage, over frequencies of the rotating frame [Hz].

    ``dq``: d along the voltage, shape (f, 2, 2) [pu of the rating]; ``sequences``: the same by sequences, the positive
    one at the frequency plus the rated one, the mirrored one at the frequency minus it."""

    frequencies: Numbers
    dq: Complex
    sequences: Complex
    f_n: float

    @property
    def reactance(self) -> Numbers:
        """The positive sequence's reactance, brought to the rated frequency [pu]."""
        return np.asarray(
            self.sequences[:, 0, 0].imag * self.f_n / (self.frequencies + self.f_n), dtype=float
        )

    def rows(self) -> list[dict[str, float]]:
        """A row for each frequency: magnitudes [pu] and phases [°]."""
        columns = {"frequency [Hz]": self.frequencies}
        for name, values in (
            ("Z_dd", self.dq[:, 0, 0]),
            ("Z_qq", self.dq[:, 1, 1]),
            ("Z_dq", self.dq[:, 0, 1]),
            ("Z_qd", self.dq[:, 1, 0]),
            ("Z_positive", self.sequences[:, 0, 0]),
            ("Z_mirrored", self.sequences[:, 1, 1]),
        ):
            columns |= {
                f"|{name}| [pu]": np.abs(values),
                f"phase {name} [°]": np.rad2deg(np.angle(values)),
            }
        rows = np.array(list(columns.values())).T.tolist()
        return [dict(zip(columns, row, strict=True)) for row in rows]


def impedances(f: Numbers, admittance: Vector, angle: float, f_n: float) -> Impedances:
    """Impedances of a device.

    ``admittance``: from the voltage to the current out of the device, in the network's frame, shape (f, 2, 2) [pu];
    ``angle``: of its voltage there [rad]."""
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, s], [-s, c]])
    dq = np.linalg.inv(-(turn @ admittance @ turn.T))
    by_sequences = np.array([[1, 1j], [1, -1j]]) / np.sqrt(2)
    inside = (f >= TOLD[0]) & (f <= TOLD[1])
    dq = dq[inside]
    return Impedances(f[inside], dq, by_sequences @ dq @ by_sequences.conj().T, f_n)


@dataclass(frozen=True)
class Least:
    value: float  # [pu/rad] or [pu/pu]
    at: float  # [Hz]


@dataclass(frozen=True)
class Springs:
    """The parts of a device's powers that oppose a change of its voltage as springs do, where they are least in a band.

    ``angle``: of the active power against the angle [pu/rad]; ``magnitude``: of the reactive power against the relative
    magnitude [pu/pu]. A source behind an impedance has both. A mass, which a control makes of the frequency's rate of
    change, opposes the angle's acceleration: its part is negative at the same size, or positive behind a slow
    measurement, and nothing holds the magnitude."""

    angle: Least
    magnitude: Least
    asked: AskedStiffness

    @property
    def least(self) -> float:
        return min(self.angle.value, self.magnitude.value)

    @property
    def met(self) -> bool:
        return self.least >= self.asked.value


def springs(found: Stiffness, f_n: float) -> Springs:
    """Springs in the band of the criterion of phase jumps.

    What this asks of the angle follows from an impedance, and the same impedance gives the reactive power."""
    asked = asked_stiffness(found, f_n)
    inside = np.flatnonzero(
        (found.frequencies >= asked.band[0]) & (found.frequencies <= asked.band[1])
    )

    def least(name: str) -> Least:
        values = -found.powers[name][inside].real
        k = int(np.argmin(values))
        return Least(float(values[k]), float(found.frequencies[inside[k]]))

    return Springs(least("P/theta"), least("Q/V"), asked)


@dataclass(frozen=True)
class TerminalSwing:
    """Inertia and damping seen from the terminals: −P/ω = D + 2·H·s, fitted up to `SLOW`."""

    inertia: float  # H [s, of the rating]
    damping: float  # D [pu/pu]
    misses: float  # root mean square of what the two do not explain, of that of P/ω


def swing(found: Stiffness) -> TerminalSwing:
    slow = found.frequencies <= SLOW
    values = -found.powers["P/omega"][slow]
    omega = 2 * np.pi * found.frequencies[slow]
    damping = float(values.real.mean())
    inertia = float((values.imag @ omega) / (omega @ omega) / 2)
    rest = values - damping - 2j * omega * inertia
    size = float(np.sqrt((np.abs(values) ** 2).mean()))
    return TerminalSwing(
        inertia, damping, float(np.sqrt((np.abs(rest) ** 2).mean())) / size if size else 0.0
    )
