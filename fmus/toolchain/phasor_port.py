"""The port of a device without network transients: an emf behind an impedance, beside the current that it gives.

A network solver takes the admittance y into its matrix and the emf e as its source, and so finds the bus voltage in
one solution: e follows from the device's states alone. The current i = (e − v)·y depends on the bus voltage directly;
a solver that fed it back would have an algebraic loop.
"""

import casadi as ca

from fmus.toolchain.frames import Phasor
from fmus.toolchain.model import ModelBuilder
from fmus.toolchain.port import SYSTEM_BASE, DevicePort, declare_port_outputs

INTERNAL_STEP, LONGEST_STEP = 1e-3, 2e-3
"""Internal step [s], default and maximum: parameters allow time constants of 1 ms, and Runge-Kutta of order 4 needs
steps below 2.78 of them."""


def phasor_builder(name: str, title: str) -> ModelBuilder:
    """A builder for a model without network transients."""
    return ModelBuilder(name, title, INTERNAL_STEP, LONGEST_STEP)


def declare_lead(m: ModelBuilder) -> ca.SX:
    """Declare the communication step and return by how much the emf is given ahead [s].

    A master holds the bus voltage during a step, so that it is half a step old on average. With the emfs of the middle
    of the coming step the network's voltages are those of the middle. Everything at the port is then for that time.
    """
    step = m.parameter(
        "communication_step",
        0.0,
        "s",
        "Communication step of the master: emf and admittance are given for the middle of the step to come; 0: for now",
        minimum=0.0,
        maximum=0.1,
    )
    return step / 2


def declare_phasor_outputs(m: ModelBuilder, port: DevicePort, emf: Phasor, impedance: Phasor) -> None:
    """Declare the port's outputs: current and powers as every device has them, emf and admittance.

    Parameters
    ----------
    emf
        Network frame [pu], at the time for which it is given.
    impedance
        Between emf and bus [pu, S_n], an expression of fixed parameters.
    """
    with m.scope("source"):
        R = m.calculated("R", impedance.re, "pu", "Resistance between emf and bus", base="S_n")
        X = m.calculated("X", impedance.im, "pu", "Reactance between emf and bus", base="S_n")
    y = Phasor(1.0, 0.0) / Phasor(R, X) * port.connected
    declare_port_outputs(m, port, (emf - port.v) * y)
    m.output("e_re", emf.re, "pu", "Emf behind the impedance, real part, network frame", base="bus")
    m.output("e_im", emf.im, "pu", "Emf behind the impedance, imaginary part, network frame", base="bus")
    y *= port.current_scale
    m.output("y_re", y.re, "pu", "Admittance between emf and bus, real part; 0 while open", base=SYSTEM_BASE)
    m.output("y_im", y.im, "pu", "Admittance between emf and bus, imaginary part; 0 while open", base=SYSTEM_BASE)
