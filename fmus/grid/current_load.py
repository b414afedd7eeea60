"""Loads whose active current keeps its magnitude: i = I_0·v/|v|, in phase with the voltage, so that P = I_0·|v|.

At a bus without capacitance v = Σ i / G, and a load that consists of a current only would leave |v| without an
equation. It is therefore the conductance of its operating point, G = P/v_0², and a correction that follows with a lag:

    i = G·v + c,    τ·dc/dt = (G·v_0·v/|v| − G·v) − c

In steady state, and for everything slow against τ, i = G·v_0·v/|v| exactly; within τ the load is an impedance, as real
ones are. With the inductances L that feed the bus, |v| obeys G·L·s² + s + 1/τ = 0, damped at any τ > 0.
"""

from dataclasses import dataclass

import casadi as ca

from fmus.grid.elements import Bus, DeclaredLoad
from fmus.grid.network import Load
from fmus.toolchain.frames import Phasor, power
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.port_variables import SYSTEM_BASE

RECOVERY_TIME = 1e-3
"""Default of τ [s]: its pole lies far above all electromechanical modes and well below the communication rate."""


@dataclass(frozen=True)
class CurrentLoad:
    """A declared load with its correction c at scale 1."""

    name: str
    bus: Bus
    load: DeclaredLoad
    correction: Phasor
    tau: ca.SX


def declare_current_load(m: ModelBuilder, load: Load, declared: DeclaredLoad, buses: dict[str, Bus]) -> CurrentLoad:
    """Make a declared load one of constant current.

    Parameters
    ----------
    m
        The grid's model.
    load
        The load's bus and name.
    declared
        The same load as a constant impedance, as `declare_load` returns it.
    buses
        By name; the correction is added to what is injected at the load's bus.
    """
    bus = buses[load.bus]
    with m.scope(load.name):
        tau = m.parameter(
            "tau", RECOVERY_TIME, "s", "Time after which the load is a constant current; before, an impedance",
            minimum=5e-4, maximum=1.0,
        )  # fmt: skip
        text = "Correction of the load's current at scale 1"
        correction = Phasor(
            m.state("c_re", 0.0, "pu", f"{text}, real part", SYSTEM_BASE),
            m.state("c_im", 0.0, "pu", f"{text}, imaginary part", SYSTEM_BASE),
        )
    bus.injected -= correction * declared.scale
    return CurrentLoad(load.name, bus, declared, correction, tau)


def current_load_equation(m: ModelBuilder, load: CurrentLoad) -> None:
    """Give the equation τ·dc/dt = G·(v_0/|v| − 1)·v − c, and declare the load's power."""
    v, G = load.bus.v, load.load.G
    wanted = v * (G * (load.bus.v_0.magnitude() / v.magnitude() - 1))
    rate = (wanted - load.correction) * (1 / load.tau)
    m.derivative(ca.SX(load.correction.re), rate.re)
    m.derivative(ca.SX(load.correction.im), rate.im)
    drawn = power(v, (v * G + load.correction) * load.load.scale)
    with m.scope(load.name):
        m.output("p", drawn.re, "pu", "Active power drawn", base=SYSTEM_BASE)
