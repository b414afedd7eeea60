"""Current limit: reactive current first, and what it leaves for active current returns at a limited rate."""

from dataclasses import dataclass

from fmus.gfl_l2ep.electrical import COLIB, Start
from fmus.toolchain.blocks import clamp
from fmus.toolchain.frames import Phasor
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, Scalar, fmax, fmin, sqrt

SMALLEST = 1e-3
"""Least part of the limit's square under a root, for a finite derivative."""


@dataclass(frozen=True)
class Limits:
    """Largest current, largest active current now, and largest reactive current of the voltage control [pu, S_n]."""

    I_max: Expr
    active: Expr
    reactive: Expr


def declare_limits(m: ModelBuilder, start: Start, reactive: Expr) -> Limits:
    """Declare the limit and the state that carries the active current's share.

    ``start``: the operating point. It leaves sqrt(I_max² − i_q0²) for the reactive current of the voltage control;
    ``reactive``: reactive current in the converter [pu, S_n]."""
    with m.scope("current_limit"):
        I_max = m.parameter("I_max", 1.0, "pu", "Largest current", base="S_n", minimum=0.1, source=COLIB)
        T = m.parameter("tau", 0.002, "s", "Lag of the active current's limit", minimum=1e-3, source=COLIB)
        recovery = m.parameter(
            "recovery", 0.5, "pu/s", "Fastest recovery of the active current's limit", base="S_n", minimum=0.01,
            source=COLIB,
        )  # fmt: skip
        m.require(
            I_max - start.i.magnitude(),
            "the power flow asks for more current than current_limit.I_max: lower P_0 or Q_0, or raise S_n",
        )
        most = m.state("I_active", _rest(I_max, start.i.im), "pu", "Largest active current", base="S_n")
        m.derivative(most, fmin((_rest(I_max, reactive) - most) / T, recovery))
    return Limits(I_max, clamp(most, 0, I_max), _rest(I_max, start.i.re))


def limited(limits: Limits, active: Expr, reactive: Expr) -> Phasor:
    """The current that is allowed [pu, S_n]."""
    return Phasor(clamp(active, -limits.active, limits.active), clamp(reactive, -limits.I_max, limits.I_max))


def _rest(most: Expr, other: Scalar) -> Expr:
    return sqrt(fmax(most**2 - other**2, SMALLEST * most**2))
