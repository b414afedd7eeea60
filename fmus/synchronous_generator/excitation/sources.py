"""The sources of static exciters: the terminal's voltage and current, and the rectifier behind them.

    V_E = |K̄_P·v̄_t + j·(K_I + K̄_P·X_L)·ī_t|,  K̄_P = K_P·e^{j·θ_P}
    V_B = V_E·F_EX(K_C·I_FD/V_E), at most V_BMAX

The stator's current compounds the source where K_I or X_L exceeds 0. Sources: IEEE 421.5 (ST2A to ST4B)."""

import math
from dataclasses import dataclass

from fmus.synchronous_generator.data_lines import Given, declared, number, pu
from fmus.synchronous_generator.excitation.common import SOURCE, Regulated, rectifier
from fmus.toolchain.frames import Phasor
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, Scalar, cos, fmax, fmin, if_else, sin

LEAST_SOURCE = 1e-3
"""Smallest source [pu] that a rectifier's loading is divided by."""

COMPOUND = (
    pu("K_P", 6.5, "Potential source gain", 0),
    pu("K_I", 0.0, "Gain of the stator's current in the source", 0),
    pu("X_L", 0.0, "Reactance of the source's transformer", 0),
    number("theta_P", 0.0, "Angle of the potential source [degrees]"),
)
LOADED = (
    pu("K_C", 0.0, "Rectifier loading factor", 0),
    pu("V_BMAX", 99.0, "Upper limit of V_B", 0.1),
)


def behind_rectifier(V_E: Expr, loading: Scalar) -> Expr:
    """V_E·F_EX(loading/V_E) [pu], loading = K_C·I_FD."""
    V = fmax(V_E, LEAST_SOURCE)
    return V * rectifier(loading / V)


@dataclass(frozen=True)
class Source:
    """A source that the terminal feeds; ``p`` has K_P and K_I, and of K_C and V_BMAX, X_L and
    theta_P what the source has."""

    p: Given
    seen: Regulated

    def voltage(self, v_t: Phasor, i: Phasor) -> Expr:
        """V_E [pu] of the terminal's voltage and current."""
        p = self.p
        if not p.has("theta_P"):
            return (v_t * p.K_P + (i * p.K_I).times_j()).magnitude()
        angle = p.theta_P * (math.pi / 180)
        K_P = Phasor(p.K_P * cos(angle), p.K_P * sin(angle))
        return (K_P * v_t + ((K_P * p.X_L + Phasor(p.K_I, 0.0)) * i).times_j()).magnitude()

    def available(self, v_t: Phasor) -> Expr:
        """V_B [pu] while the machine runs; 1 where neither voltage nor current feeds it."""
        return self._available(v_t, self.seen.i, self.seen.I_fd)

    @property
    def at_start(self) -> Expr:
        """V_B [pu] of the operating point, where the field current equals E_fd."""
        return self._available(self.seen.v_0, self.seen.start.i, self.seen.start.E_fd)

    def _available(self, v_t: Phasor, i: Phasor, I_fd: Expr) -> Expr:
        p = self.p
        V_B = behind_rectifier(self.voltage(v_t, i), p.K_C * I_fd)
        V_B = fmin(V_B, p.V_BMAX) if p.has("V_BMAX") else V_B
        return if_else(p.K_P + p.K_I > 0, fmax(V_B, LEAST_SOURCE), 1)


def compound_source(
    m: ModelBuilder, seen: Regulated, K_P: float = 6.5, K_C: float = 0.08, V_BMAX: float = 8.0
) -> Source:
    """Declare a compound source with a rectifier behind it; the arguments are defaults."""
    values = {"K_P": K_P, "K_C": K_C, "V_BMAX": V_BMAX}
    return Source(declared(m, (*COMPOUND, *LOADED), SOURCE, values), seen)
