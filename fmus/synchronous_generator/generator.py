"""Machine, exciter and governor put together; one model for each excitation system."""

from functools import partial

from fmus.synchronous_generator.declarations import MACHINE
from fmus.synchronous_generator.excitation.common import Exciter, Regulated
from fmus.synchronous_generator.limiters.common import WITHOUT, Limiters
from fmus.synchronous_generator.machine import (
    Machine,
    declare_machine,
    machine_equations,
    terminal_voltage,
)
from fmus.synchronous_generator.stabilization.norm631 import pss2a
from fmus.synchronous_generator.turbines.without_limits import ieeeg1
from fmus.synchronous_generator.variants import (
    AC4A,
    ST1,
    ST4B,
    Governor,
    Stabilizer,
    Variant,
    declare_machine_outputs,
    of_power,
    of_speed,
    seen_by_controls,
)
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
    title = variant.title("EMT-type", stabilizer)
    m = ModelBuilder(variant.model_name(stabilizer), title, kind="machine", usual=MACHINE)
    port = device_port(m, variant.data.S_n, variant.data.P_0)
    machine = declare_machine(m, port, variant.data)
    governor = of_speed(partial(ieeeg1, data=variant.governor))
    pss = of_power(pss2a) if stabilizer else None
    return with_controls(m, port, machine, variant.exciter, governor, pss)


def with_controls(
    m: ModelBuilder,
    port: DevicePort,
    g: Machine,
    exciter: Exciter,
    governor: Governor,
    stabilizer: Stabilizer | None,
    limiters: Limiters = WITHOUT,
) -> Model:
    """A machine with stator transients and its controls."""
    shaft = seen_by_controls(m, g, port, terminal_voltage(g, port, g.field_current))
    v_s = 0.0 if stabilizer is None else stabilizer(m, shaft)
    seen = Regulated(
        g.start,
        lambda E: terminal_voltage(g, port, E),
        g.field_current,
        v_s,
        i=g.current,
        v_0=g.start.terminal(g.R_t, g.X_t),
    )
    E_fd, v_t = limiters.regulate(m, seen, exciter)
    P_m = governor(m, shaft)
    m.close(shaft.P_m, P_m)
    machine_equations(m, g, port, E_fd, P_m)
    declare_port_outputs(m, port, g.current.rotated(g.delta))
    declare_machine_outputs(m, g, v_t, E_fd, P_m)
    return m.build()
