"""Machine, exciter and governor put together; one model for each excitation system."""

import casadi as ca

from fmus.synchronous_generator.data import (
    IEEE118,
    IEEEG1_NTS631,
    IEEEG1_STAMP,
    SG1,
    SG2,
    GovernorData,
    MachineData,
)
from fmus.synchronous_generator.exciters import Exciter, ac4a, st1, st4b
from fmus.synchronous_generator.governors import ieeeg1
from fmus.synchronous_generator.machine import Machine, declare_machine, machine_equations, terminal_voltage
from fmus.synchronous_generator.stabilizers import pss2a
from fmus.toolchain.frames import power
from fmus.toolchain.model import Model
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.port import DevicePort, declare_port_outputs, device_port


def synchronous_generator_ac4a() -> Model:
    """Generator with exciter AC4A; defaults of the IEEE 118-bus case."""
    return _generator("ac4a", ac4a, IEEE118, IEEEG1_STAMP)


def synchronous_generator_st1() -> Model:
    """Generator with exciter ST1; defaults are SG2 of the two-area case."""
    return _generator("st1", st1, SG2, IEEEG1_NTS631)


def synchronous_generator_st4b() -> Model:
    """Generator with exciter ST4B; defaults are SG1 of the two-area case."""
    return _generator("st4b", st4b, SG1, IEEEG1_NTS631)


def synchronous_generator_st4b_pss2a() -> Model:
    """Generator with exciter ST4B and stabiliser PSS2A; defaults are SG1 of the grid code's two-area system."""
    return _generator("st4b", st4b, SG1, IEEEG1_NTS631, stabilizer="pss2a")


def _generator(name: str, exciter: Exciter, data: MachineData, governor: GovernorData, stabilizer: str = "") -> Model:
    suffix, extra = (f"_{stabilizer}", f" {stabilizer.upper()} stabiliser,") if stabilizer else ("", "")
    m = ModelBuilder(
        f"synchronous_generator_{name}{suffix}",
        f"Synchronous generator with {name.upper()} exciter,{extra} IEEEG1 governor and step-up transformer (EMT-type)",
    )
    port = device_port(m, data.S_n, data.P_0)
    machine = declare_machine(m, port, data)
    v_s = _pss2a(m, machine, port) if stabilizer else 0.0
    E_fd, v_t = exciter(m, machine.start, lambda E: terminal_voltage(machine, port, E), machine.field_current, v_s)
    P_m = ieeeg1(m, machine.w, machine.start.T_e, governor)
    machine_equations(m, machine, port, E_fd, P_m)

    declare_port_outputs(m, port, machine.current.rotated(machine.delta))
    declare_generator_outputs(m, machine, v_t, E_fd, P_m)
    return m.build()


def declare_generator_outputs(m: ModelBuilder, machine: Machine, v_t: ca.SX, E_fd: ca.SX, P_m: ca.SX) -> None:
    """Declare what a generator shows beside its port.

    Parameters
    ----------
    m
        The generator's model.
    machine
        Gives speed, angle and torque.
    v_t
        Voltage magnitude at the terminal [pu, S_n].
    E_fd
        Field voltage; 1 pu gives 1 pu of voltage on open circuit.
    P_m
        Mechanical power [pu, S_n].
    """
    m.output("omega", machine.w, "pu", "Rotor speed", base="f_n")
    m.output("delta", machine.delta, "rad", "Rotor angle in the network frame")
    m.output("v_t", v_t, "pu", "Voltage magnitude at the machine's terminal", base="S_n")
    m.output("E_fd", E_fd, "pu", "Field voltage; 1 gives 1 pu on open circuit", base="E_fd")
    m.output("P_m", P_m, "pu", "Mechanical power", base="S_n")
    m.output("T_e", machine.torque, "pu", "Electrical torque", base="S_n")


def _pss2a(m: ModelBuilder, machine: Machine, port: DevicePort) -> ca.SX:
    """The stabiliser on this machine; the power at its terminal is that at the bus and the transformer's losses."""
    losses = machine.R_t * machine.current.magnitude() ** 2
    P_e = power(port.v.rotated(-machine.delta), machine.current).re + losses
    P_e_0 = power(port.v_0, port.i_0).re + machine.R_t * port.i_0.magnitude() ** 2
    return pss2a(m, machine.w - 1, ca.SX(P_e), ca.SX(P_e_0))
