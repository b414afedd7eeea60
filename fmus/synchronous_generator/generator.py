"""Machine, exciter and governor put together; one model for each excitation system."""

from fmus.synchronous_generator.governors import ieeeg1
from fmus.synchronous_generator.machine import declare_machine, machine_equations, terminal_power, terminal_voltage
from fmus.synchronous_generator.stabilizers import pss2a
from fmus.synchronous_generator.usual import MACHINE
from fmus.synchronous_generator.variants import AC4A, ST1, ST4B, Variant, declare_generator_outputs
from fmus.toolchain.model import Model
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.port import declare_port_outputs, device_port


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
    m = ModelBuilder(
        variant.model_name(stabilizer), variant.title("EMT-type", stabilizer), kind="machine", usual=MACHINE
    )
    port = device_port(m, variant.data.S_n, variant.data.P_0)
    machine = declare_machine(m, port, variant.data)
    v_s = pss2a(m, machine.w - 1, *terminal_power(machine, port)) if stabilizer else 0.0
    E_fd, v_t = variant.exciter(
        m, machine.start, lambda E: terminal_voltage(machine, port, E), machine.field_current, v_s
    )
    P_m = ieeeg1(m, machine.w, machine.start.T_e, variant.governor)
    machine_equations(m, machine, port, E_fd, P_m)

    declare_port_outputs(m, port, machine.current.rotated(machine.delta))
    declare_generator_outputs(m, machine, v_t, E_fd, P_m)
    return m.build()
