"""The bus voltage of a converter without network transients, from states alone.

A current source has no emf. Two lags of the bus voltage extrapolate it: 2·v_1 − v_2 errs by (s·τ)², and is a function
of states alone."""

from dataclasses import dataclass

from fmus.toolchain.blocks import low_pass
from fmus.toolchain.frames import Phasor
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.phasor_port import MasterStep
from fmus.toolchain.port import OperatingPoint
from fmus.toolchain.symbols import Expr, exp, fmax

# communication step in parts of the lags below which their delays are those of none: 2e-7 from τ
SHORT = 1e-3

LEAST_VOLTAGE = 0.01
"""Voltage [pu] below which no division by it takes place: the WECC's diagrams' own figure."""

LEAST_SQUARE = LEAST_VOLTAGE**2
"""Square of a voltage [pu²] below which its turning is no frequency."""


@dataclass(frozen=True)
class ExtrapolatedVoltage:
    """Bus voltage through one lag and through two, in the network frame, in which a master holds it.

    ``delay``, ``more``: of the first lag at the end of a communication step, and how much later the second is [s]."""

    once: Phasor
    twice: Phasor
    tau: Expr
    delay: Expr
    more: Expr

    @property
    def value(self) -> Phasor:
        """The voltage, extrapolated [pu]; right on average over a step in which the input is held."""
        return 2 * self.once - self.twice

    def after(self, time: Expr) -> Phasor:
        """The voltage [pu] at that time [s] after the end of a communication step."""
        return self.once + (self.once - self.twice) * ((self.delay + time) / self.more)

    def follow(self, m: ModelBuilder, v: Phasor) -> None:
        """Give both lags what they follow."""
        for behind, ahead in ((self.once, v), (self.twice, self.once)):
            m.derivative(Expr(behind.re), (ahead.re - behind.re) / self.tau)
            m.derivative(Expr(behind.im), (ahead.im - behind.im) / self.tau)


def extrapolated_voltage(
    m: ModelBuilder, port: OperatingPoint, master: MasterStep
) -> ExtrapolatedVoltage:
    """Declare both lags.

    A step H holds the voltage of its middle. At its end the first lag is late by D = (H/2)·coth(H/2τ) and the second by
    (H²/4τ)/sinh²(H/2τ) more; both are τ where H is short."""
    with m.scope("bus_voltage"):
        shortest = m.parameter(
            "tau",
            0.002,
            "s",
            "Time constant of both lags of the bus voltage; at least communication_step",
            minimum=1e-3,
        )
        once, twice = (
            Phasor(
                *(
                    m.state(
                        f"{name}_{part}",
                        initial,
                        "pu",
                        f"Bus voltage through {text}, {part} part",
                        base="bus",
                    )
                    for part, initial in (("re", port.v_0.re), ("im", port.v_0.im))
                )
            )
            for name, text in (("once", "one lag"), ("twice", "two lags"))
        )
    tau = fmax(shortest, master.size)
    ratio = fmax(master.size / tau, SHORT)
    growth = exp(ratio)
    more = tau * ratio**2 / (growth - 2 + 1 / growth)
    return ExtrapolatedVoltage(
        once, twice, tau, tau * ratio / 2 * (growth + 1) / (growth - 1), more
    )


def frequency_of(m: ModelBuilder, seen: ExtrapolatedVoltage, omega_b: Expr, T: Expr) -> Expr:
    """Declare a filter of the bus voltage's frequency; return that frequency [pu], from states alone."""
    v = seen.twice
    turning = (v.conjugate() * ((seen.once - v) / seen.tau)).im
    square = fmax(v.re**2 + v.im**2, LEAST_SQUARE)
    return low_pass(m, "frequency", 1 + turning / square / omega_b, T, 1.0)
