"""Electrical side of the converter: its own voltage behind the reactance of its transformer, in the PLL's frame.

A modular multilevel converter needs no filter capacitor. The transformer is one reactance with an ideal ratio r at the
grid's side: u = v/r and i = r·i_bus, per unit on S_n. Names of the benchmark: its d is our q, its q our −d."""

from dataclasses import dataclass

from fmus.toolchain.frames import Phasor, QdState, power, qd_state
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.port import BREAKER_TIME, DevicePort
from fmus.toolchain.symbols import Expr

COLIB = "COLIB, four-VSC benchmark (Van Cutsem 2023), a wind park"


@dataclass(frozen=True)
class Start:
    """The operating point: frame [rad], u and i in it [pu, S_n], P + jQ at the bus, voltage of the converter."""

    theta: Expr
    u: Phasor
    i: Phasor
    s: Phasor
    v_c: Phasor


@dataclass(frozen=True)
class Transformer:
    """Resistance and reactance [pu, S_n], ratio at the grid's side, the operating point, and the current's state."""

    R: Expr
    X: Expr
    ratio: Expr
    start: Start
    i: QdState


def declare_transformer(m: ModelBuilder, port: DevicePort) -> Transformer:
    """Declare parameters and current; the equation follows once the control has formed the voltage."""
    with m.scope("transformer"):
        R = m.parameter("R", 0.005, "pu", "Resistance", base="S_n", minimum=0.0, source=COLIB)
        X = m.parameter("X", 0.12, "pu", "Reactance", base="S_n", minimum=0.01, source=COLIB)
        ratio = m.parameter("ratio", 1.0, "1", "Ratio at the grid's side", minimum=0.5, maximum=2.0)
        theta = port.v_0.angle()
        u = Phasor(port.v_0.magnitude() / ratio, 0)
        inside = port.i_0.rotated(-theta) * ratio
        start = Start(theta, u, inside, power(port.v_0, port.i_0), u + Phasor(R, X) * inside)
        return Transformer(R, X, ratio, start, qd_state(m, "i", inside, "Current of the converter"))


def transformer_equation(m: ModelBuilder, t: Transformer, port: DevicePort, v_c: Phasor, u: Phasor, w: Expr) -> None:
    """(X/ω_b)·di/dt = v_c − u − (R + j·w·X)·i; behind an open breaker the current fades.

    ``port``: the port, which gives the breaker's position; ``v_c``, ``u``: voltage of the converter, and of the bus
    behind the ratio, converter's frame [pu, S_n]; ``w``: frequency of that frame [pu, f_n]."""
    i = t.i.value
    closed = (v_c - u - Phasor(t.R, w * t.X) * i) * (port.omega_b / t.X)
    t.i.set_derivative(m, port.through_breaker(closed, i * (-1 / BREAKER_TIME)))
