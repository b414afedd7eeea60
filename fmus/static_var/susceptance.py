"""A compensator as the network sees it: a susceptance at the bus, which takes no active power.

The bus voltage that its control measures goes through two lags that extrapolate it
(`fmus.converter_parts.bus_voltage`)."""

from collections.abc import Callable

from fmus.converter_parts.bus_voltage import extrapolated_voltage
from fmus.static_var.held_bus import HeldVoltage, held_voltage, named_by_bus
from fmus.toolchain.frames import Phasor, power
from fmus.toolchain.model import Model
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.phasor_port import (
    SourceEmf,
    declare_master_step,
    declare_phasor_outputs,
    phasor_builder,
)
from fmus.toolchain.port import DevicePort, declare_rating, device_port_of
from fmus.toolchain.symbols import Expr, fabs

MOST_POWER = 1e-4
"""Active power of the power flow that a compensator may have [pu, S_n]: rounding of a file."""

Control = Callable[[ModelBuilder, DevicePort, Expr, Phasor, HeldVoltage], Expr]
"""Builder, port, rating [MVA], measured voltage of the own bus and of that which is held [pu] → susceptance [pu, S_n];
above 0 capacitive."""


def susceptance_model(
    name: str, title: str, rating_mva: float, control: Control, *, elsewhere: bool = False
) -> Model:
    """The model of a compensator, phasor type.

    ``rating_mva``: default rating [MVA]; ``control``: gives its susceptance; ``elsewhere``: whether it holds another
    bus' voltage."""
    m = phasor_builder(name, title, kind="load")
    rating = declare_rating(m, rating_mva)
    port = device_port_of(m, rating, P_0=0.0)
    text = "Reactance of the port, across which the current is fed"
    X = m.parameter("X", 0.5, "pu", text, base="S_n", minimum=0.01)
    R = m.parameter("R", 0.0, "pu", "Resistance of the port", base="S_n", minimum=0.0)
    Z = Phasor(R, X)
    master = declare_master_step(m)
    seen = extrapolated_voltage(m, port, master)
    seen.follow(m, port.v)
    held = held_voltage(m, port, seen, elsewhere=elsewhere)
    B = control(m, port, rating, seen.value, held)

    def emf(time: Expr) -> Phasor:
        v = seen.after(time)
        return v + Z * Phasor(0.0, -B) * v

    declare_phasor_outputs(
        m, port, SourceEmf(behind=emf(-master.size / 2), ahead=emf(master.to_next)), Z
    )
    m.output("B", B, "pu", "Susceptance; above 0 capacitive", base="S_n")
    return named_by_bus(m.build(), elsewhere=elsewhere)


def initial_susceptance(m: ModelBuilder, port: DevicePort) -> Expr:
    """Require that the power flow gives no active power; return the susceptance that it asks for [pu, S_n]."""
    s_0, size_0 = power(port.v_0, port.i_0), port.v_0.magnitude()
    m.require(MOST_POWER - fabs(s_0.re), "P_0: a static var compensator feeds no active power")
    return s_0.im / size_0**2
