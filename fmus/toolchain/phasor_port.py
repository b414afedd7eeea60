"""The port of a device without network transients: an emf behind an impedance, beside the current that it gives.

A network solver takes the admittance y into its matrix and the emf e as its source, and so finds the bus voltage in
one solution: e follows from the device's states alone. The current i = (e − v)·y depends on the bus voltage directly;
a solver that fed it back would have an algebraic loop."""

from dataclasses import dataclass
from typing import Any

from fmus.toolchain.frames import Phasor
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.port import DevicePort, declare_port_outputs
from fmus.toolchain.port_variables import SYSTEM_BASE
from fmus.toolchain.symbols import Expr

INTERNAL_STEP = 1e-3
"""Internal step [s], by default."""

LONGEST_STEP = 2e-3
"""Longest internal step [s]: parameters allow time constants of 1 ms, and Runge-Kutta of order 4 needs steps below 2.78
of them."""

# lag [s] of the derivative that carries an emf half a communication step ahead
DERIVATIVE_LAG = 5e-3


def phasor_builder(name: str, title: str, **what: Any) -> ModelBuilder:
    """A builder for a model without network transients."""
    return ModelBuilder(name, title, INTERNAL_STEP, LONGEST_STEP, **what)


@dataclass(frozen=True)
class SourceEmf:
    """An emf in the network frame [pu], half a communication step ago, and in half a step."""

    behind: Phasor
    ahead: Phasor


@dataclass(frozen=True)
class MasterStep:
    """Communication step of the master [s], 0 if it is not told, and how many steps its voltages are late."""

    size: Expr
    late: Expr

    @property
    def to_next(self) -> Expr:
        """Time from the last voltage's arrival to the middle of the step for which an emf is given [s]."""
        return (self.late + 0.5) * self.size


def declare_master_step(m: ModelBuilder) -> MasterStep:
    """Declare the master's step and delay as parameters."""
    step = m.parameter(
        "communication_step",
        0.0,
        "s",
        "Communication step of the master: emf and admittance are given for the middle of the step to come; 0: for now",
        minimum=0.0,
        maximum=0.1,
        tunable=True,
    )
    late = m.parameter(
        "steps_late",
        0,
        "1",
        "Steps by which the bus voltage comes late: 0 where the master steps devices and then the grid; Jacobi: 1",
        minimum=0,
        maximum=2,
        tunable=True,
        type="Integer",
    )
    return MasterStep(step, late)


def motion(m: ModelBuilder, name: str, value: Phasor, start: Phasor, text: str) -> Phasor:
    """Declare ``name_q`` and ``name_d``, the value through a lag; return its rate of change [pu/s] from states alone.

    ``name``: Of both states, before ``_q`` and ``_d``.
    ``value``, ``start``: In the device's frame [pu], a function of states; and its value at the operating point."""
    moving = []
    for part, now, initial in (("q", value.re, start.re), ("d", -value.im, -start.im)):
        slow = m.state(
            f"{name}_{part}", initial, "pu", f"{text} through a lag, {part} component", base="S_n"
        )
        moving.append((now - slow) / DERIVATIVE_LAG)
        m.derivative(slow, moving[-1])
    return Phasor(moving[0], -moving[1])


def source_emf(m: ModelBuilder, emf: Phasor, start: Phasor, angle: Expr, rate: Expr) -> SourceEmf:
    """Declare the master's step and delay as parameters; return the emf in the middle of the last step and of the next
    step.

    A master holds the bus voltage during a step, and so the voltage is half a step old on average. With the emfs of the
    middle of the coming step the network's voltages are those of the middle. The emf turns with its frame. A derivative
    with a short lag gives the motion of its components in that frame. Both emfs therefore follow from states alone.

    ``emf``, ``start``: In the device's frame [pu], a function of states; and its value at the operating point.
    ``angle``, ``rate``: Of the device's frame in the network frame [rad], and the rate of that [rad/s]."""
    master = declare_master_step(m)
    with m.scope("source"):
        change = motion(m, "e", emf, start, "Emf")

    def emf_after(time: Expr) -> Phasor:
        return (emf + change * time).rotated(angle + rate * time)

    return SourceEmf(behind=emf_after(-master.size / 2), ahead=emf_after(master.to_next))


def declare_phasor_outputs(
    m: ModelBuilder, port: DevicePort, emf: SourceEmf, impedance: Phasor
) -> None:
    """Declare the port's outputs: current and powers as every device has them, emf and admittance.

    Current and powers are read after a step, with the voltage that was held in the step, and therefore hold for its
    middle.

    ``emf``: In the network frame [pu], as `source_emf` returns it.
    ``impedance``: Between emf and bus [pu, S_n], an expression of fixed parameters."""
    with m.scope("source"):
        R = m.calculated("R", impedance.re, "pu", "Resistance between emf and bus", base="S_n")
        X = m.calculated("X", impedance.im, "pu", "Reactance between emf and bus", base="S_n")
    y = Phasor(1.0, 0.0) / Phasor(R, X) * port.connected
    declare_port_outputs(m, port, (emf.behind - port.v) * y)
    m.output(
        "e_re", emf.ahead.re, "pu", "Emf behind the impedance, real part, network frame", base="bus"
    )
    m.output(
        "e_im",
        emf.ahead.im,
        "pu",
        "Emf behind the impedance, imaginary part, network frame",
        base="bus",
    )
    y *= port.current_scale
    m.output(
        "y_re",
        y.re,
        "pu",
        "Admittance between emf and bus, real part; 0 while open",
        base=SYSTEM_BASE,
    )
    m.output(
        "y_im",
        y.im,
        "pu",
        "Admittance between emf and bus, imaginary part; 0 while open",
        base=SYSTEM_BASE,
    )
