"""Machine, exciter and governor put together; one model for each excitation system."""

import casadi as ca

from fmus.synchronous_generator.governors import ieeeg1
from fmus.synchronous_generator.machine import Machine, declare_machine, machine_equations, terminal_voltage
from fmus.synchronous_generator.stabilizers import pss2a
from fmus.synchronous_generator.variants import AC4A, ST1, ST4B, Variant, declare_generator_outputs
from fmus.toolchain.frames import power
from fmus.toolchain.model import Model
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.port import DevicePort, declare_port_outputs, device_port


def synchronous_generator_ac4a() -> Model:
    """Generator with exciter AC4A; defaults of the IEEE 118-bus case."""
    return _generator(AC4A)


def synchronous_generator_st1() -> Model:
    """Generator with exciter ST1; defaults are SG2 of the two-area case."""
    return _generator(ST1)


def synchronous_generator_st4b() -> Model:
    """Generator with exciter ST4B; defaults are SG1 of the two-area case."""
    return _generator(ST4B)


def synchronous_generator_st4b_pss2a() -> Model:
    """Generator with exciter ST4B and stabiliser PSS2A; defaults are SG1 of the grid code's two-area system."""
    return _generator(ST4B, stabilizer="pss2a")


def _generator(variant: Variant, stabilizer: str = "") -> Model:
    m = ModelBuilder(variant.model_name(stabilizer), variant.title("EMT-type", stabilizer))
    port = device_port(m, variant.data.S_n, variant.data.P_0)
    machine = declare_machine(m, port, variant.data)
    v_s = _pss2a(m, machine, port) if stabilizer else 0.0
    E_fd, v_t = variant.exciter(
        m, machine.start, lambda E: terminal_voltage(machine, port, E), machine.field_current, v_s
    )
    P_m = ieeeg1(m, machine.w, machine.start.T_e, variant.governor)
    machine_equations(m, machine, port, E_fd, P_m)

    declare_port_outputs(m, port, machine.current.rotated(machine.delta))
    declare_generator_outputs(m, machine, v_t, E_fd, P_m)
    return m.build()


def _pss2a(m: ModelBuilder, machine: Machine, port: DevicePort) -> ca.SX:
    """The stabiliser on this machine; the power at its terminal is that at the bus and the transformer's losses."""
    losses = machine.R_t * machine.current.magnitude() ** 2
    P_e = power(port.v.rotated(-machine.delta), machine.current).re + losses
    P_e_0 = power(port.v_0, port.i_0).re + machine.R_t * port.i_0.magnitude() ** 2
    return pss2a(m, machine.w - 1, ca.SX(P_e), ca.SX(P_e_0))
