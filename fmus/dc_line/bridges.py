"""Line-commutated bridges in series: the voltage on their DC side, and the reactive power that they draw.

    V = V_0·cos α − R_c·I,  V_0 = 3·√2/π·N·E·v,  R_c = 3/π·N·X_c
    cos(α + μ) = (V − R_c·I)/V_0
    Q = V_0·I·[μ/(2·sin(μ/2)) − cos(μ/2)·cos(2α + μ)]/(2·sin(α + μ/2))

α is the firing angle of a rectifier and the extinction angle γ of an inverter. Q is that of the fundamental, the usual
quotient of 2μ + sin 2α − sin 2(α + μ) and cos 2α − cos 2(α + μ) times V·I, in a form without a pole at V = 0.

Sources: E. W. Kimbark, "Direct Current Transmission" (1971), chapter 3; P. Kundur, "Power System Stability and Control"
(1994), section 10.2."""

from dataclasses import dataclass
from math import pi, sqrt

from fmus.toolchain.blocks import clamp
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, Scalar, atan2, cos, fmax, sin
from fmus.toolchain.symbols import sqrt as root

DEGREE = pi / 180

BENCHMARK = (
    "M. Szechtman et al., First benchmark model for HVDC control studies, Electra 135 (1991)"
)
"""Source of the defaults: 500 kV, 1000 MW."""

LEAST_KV = 1e-3
"""Voltage at no load [kV] below which no angle is told from a voltage."""

LEAST_SQUARE = 1e-12
"""Square of a sine [1] from which a root is taken: the root's slope stays finite at an angle of 0."""

LEAST_OVERLAP = 1e-6
"""Overlap [rad] below which its quotient with its sine is that of no overlap."""


@dataclass(frozen=True)
class Bridges:
    """Bridges of a station, by their parameters.

    ``valve_kv``: line-to-line voltage at the valves with 1 pu at the bus [kV]."""

    count: Expr
    x_ohm: Expr
    valve_kv: Expr

    @property
    def drop(self) -> Expr:
        """Voltage lost by commutation, per current [ohm]."""
        return 3 / pi * self.count * self.x_ohm

    def no_load(self, v: Scalar) -> Expr:
        """DC voltage without a current and with an angle of 0 [kV], at a bus voltage [pu]."""
        return 3 * sqrt(2) / pi * self.count * self.valve_kv * v

    def cosine(self, v: Expr, current: Scalar, kilovolts: Scalar) -> Expr:
        """Cosine of the angle that gives a DC voltage [kV] at a current [kA]."""
        return (kilovolts + self.drop * current) / fmax(self.no_load(v), LEAST_KV)

    def reactive(self, v: Expr, current: Scalar, kilovolts: Scalar) -> Expr:
        """Reactive power that the bridges draw [Mvar]."""
        begin = angle_of(self.cosine(v, current, kilovolts))
        end = angle_of(self.cosine(v, -Expr(current), kilovolts))
        half = fmax(end - begin, LEAST_OVERLAP) / 2
        middle = (begin + end) / 2
        share = half / sin(half) - cos(half) * cos(2 * middle)
        return self.no_load(v) * current * share / (2 * sin(middle))


def angle_of(cosine: Scalar) -> Expr:
    """Angle [rad] of 0 to π, of a cosine that may be beyond ±1 by rounding."""
    c = clamp(cosine, -1, 1)
    return atan2(root(fmax(1 - c**2, LEAST_SQUARE)), c)


def declare_bridges(m: ModelBuilder, x_ohm: float, valve_kv: float) -> Bridges:
    """Declare the bridges of a station.

    ``x_ohm``, ``valve_kv``: defaults."""
    count = m.parameter(
        "N", 2, "1", "Bridges in series", minimum=1, maximum=48, type="Integer", source=BENCHMARK
    )
    text = "Commutating reactance of a bridge"
    x = m.parameter("X_c", x_ohm, "ohm", text, minimum=1e-6, source=BENCHMARK)
    text = "Line-to-line voltage at the valves with 1 pu at the bus"
    E = m.parameter("E_n", valve_kv, "kV", text, minimum=1e-3, source=BENCHMARK)
    return Bridges(count, x, E)
