"""The generator whose machine, exciter, governor and stabiliser are chosen by name, EMT-type and phasor type.

A part that is not named is not there: the field voltage and the mechanical torque are then constant.
"""

from fmus.synchronous_generator.machine import (
    Machine,
    flux_state,
    machine_equations,
    rotor_equations,
    terminal_power,
    terminal_voltage,
)
from fmus.synchronous_generator.parts import NONE, Parts, chosen_parts
from fmus.synchronous_generator.phasor_generator import close_stator, declare_phasor_port, phasor_terminal_voltage
from fmus.synchronous_generator.usual import MACHINE
from fmus.synchronous_generator.variants import declare_generator_outputs
from fmus.toolchain.frames import Phasor
from fmus.toolchain.model import Model
from fmus.toolchain.model_builder import ModelBuilder, Scalar
from fmus.toolchain.phasor_port import phasor_builder
from fmus.toolchain.port import DevicePort, declare_port_outputs, declare_rating, device_port_of

S_N, P_0 = 100.0, 0.8
"""Defaults of rating [MVA] and power [pu]."""


def synchronous_generator(
    machine: str = "genrou", exciter: str = "manual", governor: str = "constant_torque", stabilizer: str = NONE
) -> Model:
    """Generator of these parts with stator transients.

    Parameters
    ----------
    machine, exciter, governor, stabilizer
        Names of `parts.MACHINES`, `parts.EXCITERS`, `parts.GOVERNORS` and `parts.STABILIZERS`.

    Raises
    ------
    ValueError
        If there is no such part, the parts do not fit each other, or the machine is one for phasors alone.
    """
    parts = chosen_parts(machine, exciter, governor, stabilizer)
    m = ModelBuilder(parts.model_name(), parts.title("EMT-type"), kind="machine", usual=MACHINE)
    S_n = declare_rating(m, S_N)
    port = device_port_of(m, S_n, P_0)
    g = parts.machine(m, port, S_n, flux_state)
    if g.at_rated_speed:
        raise ValueError(
            f"machine = {machine!r}: its emf is that of rated speed, which stator transients contradict; take "
            "machine = 'genrou', or model = 'synchronous_generator_phasor'"
        )
    v_s = _signal(m, parts, g, port)
    E_fd, v_t = parts.exciter(m, g.start, lambda E: terminal_voltage(g, port, E), g.field_current, v_s)
    P_m = parts.governor(m, g.w, g.start.T_e)
    machine_equations(m, g, port, E_fd, P_m)
    declare_port_outputs(m, port, g.current.rotated(g.delta))
    declare_generator_outputs(m, g, v_t, E_fd, P_m)
    return m.build()


def synchronous_generator_phasor(
    machine: str = "genrou", exciter: str = "manual", governor: str = "constant_torque", stabilizer: str = NONE
) -> Model:
    """Generator of these parts without stator transients, an emf behind an impedance.

    Parameters
    ----------
    machine, exciter, governor, stabilizer
        As `synchronous_generator`.

    Raises
    ------
    ValueError
        If there is no such part, or the parts do not fit each other.
    """
    parts = chosen_parts(machine, exciter, governor, stabilizer)
    m = phasor_builder(parts.model_name("phasor"), parts.title("phasor type"), kind="machine", usual=MACHINE)
    S_n = declare_rating(m, S_N)
    port = device_port_of(m, S_n, P_0)
    g = parts.machine(m, port, S_n, lambda m, name, start, text: m.algebraic(name))
    emf = Phasor(g.d.emf, g.q.emf) * (1.0 if g.at_rated_speed else g.w)
    close_stator(m, g, port, emf)
    v_t = phasor_terminal_voltage(g, port, emf)
    v_s = _signal(m, parts, g, port)
    E_fd, _ = parts.exciter(m, g.start, lambda E: v_t, g.field_current, v_s)
    P_m = parts.governor(m, g.w, g.start.T_e)
    rotor_equations(m, g, port, E_fd, P_m)
    declare_phasor_port(m, g, port, emf)
    declare_generator_outputs(m, g, v_t, E_fd, P_m)
    return m.build()


def _signal(m: ModelBuilder, parts: Parts, g: Machine, port: DevicePort) -> Scalar:
    """The stabiliser's signal; 0 without one."""
    return 0.0 if parts.stabilizer is None else parts.stabilizer(m, g.w - 1, *terminal_power(g, port))
