"""The case studies' generators, and the outputs that all generators have."""

from collections.abc import Callable
from dataclasses import dataclass

from fmus.synchronous_generator.data import (
    IEEE118,
    IEEEG1_NTS631,
    IEEEG1_STAMP,
    SG1,
    SG2,
    GovernorData,
    MachineData,
)
from fmus.synchronous_generator.excitation.common import Exciter
from fmus.synchronous_generator.excitation.without_ceilings import ac4a, st1, st4b
from fmus.synchronous_generator.machine import Machine, terminal_power
from fmus.toolchain.frames import Phasor
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.port import DevicePort
from fmus.toolchain.symbols import Expr


@dataclass(frozen=True)
class Shaft:
    """Signals that a governor and a stabiliser see of their machine: speed, power, voltage, and the same at the start.

    ``w``: speed [pu]; ``P_m_0``: mechanical power [pu, S_n]; ``P_e``, ``P_e_0``: electrical power at the terminal [pu,
    S_n]; ``v_t``, ``v_t_0``: voltage magnitude there [pu, S_n]; ``phase``: change of the voltage's angle there over ω_b
    [s], whose derivative is the deviation of the frequency [pu]; ``P_m``: mechanical power now [pu, S_n], for
    stabilisers alone; ``S_n``: the rating [MVA], of parts chosen by name."""

    w: Expr
    P_m_0: Expr
    P_e: Expr
    P_e_0: Expr
    v_t: Expr
    v_t_0: Expr
    phase: Expr
    P_m: Expr
    S_n: Expr | None


Governor = Callable[[ModelBuilder, Shaft], Expr]
"""Mechanical power [pu, S_n]."""

Stabilizer = Callable[[ModelBuilder, Shaft], Expr]
"""Signal to the voltage regulator [pu, S_n]."""


def of_speed(governor: Callable[[ModelBuilder, Expr, Expr], Expr]) -> Governor:
    """A governor of speed and mechanical power at the start alone."""
    return lambda m, shaft: governor(m, shaft.w, shaft.P_m_0)


def of_power(stabilizer: Callable[[ModelBuilder, Expr, Expr, Expr], Expr]) -> Stabilizer:
    """A stabiliser of w − 1 and of electrical power, now and at the start."""
    return lambda m, shaft: stabilizer(m, shaft.w - 1, shaft.P_e, shaft.P_e_0)


def seen_by_controls(
    m: ModelBuilder, machine: Machine, port: DevicePort, terminal: Phasor
) -> Shaft:
    """Return what governor and stabiliser see; the mechanical power stays open until it is known.

    ``terminal``: voltage there in the rotor's frame [pu]. Angles are counted in the rotor's frame, in which they stay
    far from ±π, and the rotor's angle is a state, so nothing jumps."""
    start = machine.start
    delta_0 = (port.v_0 * start.v.conjugate()).angle()
    at_start = delta_0 + start.terminal(machine.R_t, machine.X_t).angle()
    phase = (machine.delta + terminal.angle() - at_start) / port.omega_b
    return Shaft(
        machine.w,
        start.T_e,
        *terminal_power(machine, port),
        terminal.magnitude(),
        start.v_t,
        phase,
        m.algebraic("P_m_of_controls"),
        machine.S_n,
    )


@dataclass(frozen=True)
class Variant:
    """An excitation system, and default values of machine and governor.

    ``name``: of the exciter, as models are called: ``st4b``."""

    name: str
    exciter: Exciter
    data: MachineData
    governor: GovernorData

    def model_name(self, suffix: str = "") -> str:
        """Name of the model; the suffix is a stabiliser's, or that of another model of the stator."""
        return "_".join(["synchronous_generator", self.name, *([suffix] if suffix else [])])

    def title(self, kind: str, stabilizer: str = "") -> str:
        """The model's title; ``kind`` says how its stator is modelled, such as ``phasor type``."""
        extra = f" {stabilizer.upper()} stabiliser," if stabilizer else ""
        return (
            f"Synchronous generator with {self.name.upper()} exciter,{extra} IEEEG1 governor and step-up transformer "
            f"({kind})"
        )


AC4A = Variant("ac4a", ac4a, IEEE118, IEEEG1_STAMP)  # the generators of the IEEE 118-bus case
ST1 = Variant("st1", st1, SG2, IEEEG1_NTS631)  # SG2 of the two-area case

ST4B = Variant("st4b", st4b, SG1, IEEEG1_NTS631)
"""SG1 of the two-area case, and with PSS2A SG1 of the grid code's two-area system."""


def declare_machine_outputs(
    m: ModelBuilder, machine: Machine, v_t: Expr, E_fd: Expr, P_m: Expr
) -> None:
    """Declare what a generator shows beside its port.

    ``machine``: gives speed, angle and torque; ``v_t``: voltage magnitude at the terminal [pu, S_n]; ``E_fd``: field
    voltage; 1 pu gives 1 pu of voltage on open circuit; ``P_m``: mechanical power [pu, S_n]."""
    m.output("omega", machine.w, "pu", "Rotor speed", base="f_n")
    m.output("delta", machine.delta, "rad", "Rotor angle in the network frame")
    m.output("v_t", v_t, "pu", "Voltage magnitude at the machine's terminal", base="S_n")
    m.output("E_fd", E_fd, "pu", "Field voltage; 1 gives 1 pu on open circuit", base="E_fd")
    m.output("P_m", P_m, "pu", "Mechanical power", base="S_n")
    m.output("T_e", machine.torque, "pu", "Electrical torque", base="S_n")
