"""The generator whose machine, exciter, governor and stabiliser are chosen by name, EMT-type and phasor type.

A part that is not named is not there: the field voltage and the mechanical torque are then constant."""

from dataclasses import replace

from fmus.synchronous_generator.declarations import MACHINE
from fmus.synchronous_generator.generator import with_controls
from fmus.synchronous_generator.machine import flux_state
from fmus.synchronous_generator.parts import NONE, chosen_parts
from fmus.synchronous_generator.phasor_generator import with_controls as phasor_with_controls
from fmus.toolchain.model import Model
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.phasor_port import phasor_builder
from fmus.toolchain.port import declare_rating, device_port_of
from fmus.toolchain.port_variables import LARGEST_POWER_ON_BASE
from fmus.toolchain.symbols import if_else

S_N = 100.0  # default rating [MVA]: the base of networks
P_0 = 0.8  # default power [pu, S_n]


def synchronous_generator(
    machine: str = "genrou",
    exciter: str = "manual",
    governor: str = "constant_torque",
    stabilizer: str = NONE,
    oel: str = NONE,
    uel: str = NONE,
) -> Model:
    """Generator of these parts with stator transients.

    Parameters
    ----------
    machine, exciter, governor, stabilizer, oel, uel
        Names of `parts.MACHINES`, `parts.EXCITERS`, `parts.GOVERNORS`, `parts.STABILIZERS`, `parts.OELS` and
        `parts.UELS`; a governor with an end of `parts.WITH_POD` has a POD-P.

    Raises
    ------
    ValueError
        If there is no such part, the parts do not fit each other, or the machine is one for phasors alone.
    """
    parts = chosen_parts(machine, exciter, governor, stabilizer, (oel, uel))
    m = ModelBuilder(parts.model_name(), parts.title("EMT-type"), kind="machine", usual=MACHINE)
    S_n = declare_rating(m, S_N)
    port = device_port_of(m, S_n, P_0, LARGEST_POWER_ON_BASE)
    g = replace(parts.machine(m, port, S_n, flux_state), S_n=S_n)
    if g.at_rated_speed:
        raise ValueError(
            f"machine = {machine!r}: its emf is that of rated speed, which stator transients contradict; take "
            "machine = 'genrou', or model = 'synchronous_generator_phasor'"
        )
    made = with_controls(
        m, port, g, parts.exciter, parts.governor, parts.stabilizer, limiters=parts.limiters
    )
    return replace(made, of_parts=True)


def synchronous_generator_phasor(
    machine: str = "genrou",
    exciter: str = "manual",
    governor: str = "constant_torque",
    stabilizer: str = NONE,
    oel: str = NONE,
    uel: str = NONE,
) -> Model:
    """Generator of these parts without stator transients, an emf behind an impedance.

    Parameters
    ----------
    machine, exciter, governor, stabilizer, oel, uel
        As `synchronous_generator`.

    Raises
    ------
    ValueError
        If there is no such part, or the parts do not fit each other.
    """
    parts = chosen_parts(machine, exciter, governor, stabilizer, (oel, uel))
    m = phasor_builder(
        parts.model_name("phasor"), parts.title("phasor type"), kind="machine", usual=MACHINE
    )
    S_n = declare_rating(m, S_N)
    port = device_port_of(m, S_n, P_0, LARGEST_POWER_ON_BASE)
    g = parts.machine(m, port, S_n, lambda m, name, start, text: m.algebraic(name))
    with m.scope("machine"):
        with_speed = m.switch(
            "speed_in_emf", not g.at_rated_speed, "Emf is w·e''; else e'', as of rated speed"
        )
    g = replace(g, S_n=S_n, emf_speed=if_else(with_speed, g.w, 1))
    made = phasor_with_controls(
        m, port, g, parts.exciter, parts.governor, parts.stabilizer, limiters=parts.limiters
    )
    return replace(made, of_parts=True)
