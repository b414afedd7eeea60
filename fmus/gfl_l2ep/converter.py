"""Both variants: at a bus whose voltage is instantaneous, and at one of a network of admittances."""

from fmus.converter_parts.bus_voltage import extrapolated_voltage
from fmus.converter_parts.usual_ranges import FOLLOWING
from fmus.gfl_l2ep.control import Following, following_converter
from fmus.toolchain.frames import Phasor
from fmus.toolchain.model import Model
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.phasor_port import (
    SourceEmf,
    declare_master_step,
    declare_phasor_outputs,
    motion,
    phasor_builder,
)
from fmus.toolchain.port import declare_port_outputs, device_port
from fmus.toolchain.symbols import Expr

S_N = 2400.0  # default rating [MVA]: that of a wind park of the benchmark
P_0 = 0.83  # default dispatch [pu, S_n]: that of the same park

BEHIND = Phasor(0.1, 10.0)
"""Impedance [pu, S_n] behind which the phasor variant gives its current: the larger, the less does the error of the
extrapolated bus voltage matter."""


def gfl_l2ep() -> Model:
    """Average EMT-type model: the grid-following converter of the four-VSC benchmark."""
    title = "Grid-following converter of L2EP in the four-VSC benchmark (EMT type)"
    m = ModelBuilder("gfl_l2ep", title, kind="converter", usual=FOLLOWING)
    port = device_port(m, S_n=S_N, P_0=P_0)
    found = following_converter(m, port, port.v)
    declare_port_outputs(m, port, found.into_bus.rotated(found.frame.theta))
    _declare_signals(m, found)
    return m.build()


def gfl_l2ep_phasor() -> Model:
    """The same equations at a network of admittances: the benchmark's phasor model keeps di/dt of its transformer."""
    title = "Grid-following converter of L2EP in the four-VSC benchmark (phasor type)"
    m = phasor_builder("gfl_l2ep_phasor", title, kind="converter", usual=FOLLOWING)
    port = device_port(m, S_n=S_N, P_0=P_0)
    master = declare_master_step(m)
    seen = extrapolated_voltage(m, port, master)
    found = following_converter(m, port, seen.value)
    seen.follow(m, port.v)
    start = port.i_0.rotated(-port.v_0.angle())
    with m.scope("transformer"):
        moving = motion(m, "slow", found.into_bus, start, "Current into the bus")
    turning = port.omega_b * (found.frame.w - 1)

    def emf(time: Expr) -> Phasor:
        current = (found.into_bus + moving * time).rotated(found.frame.theta + turning * time)
        return seen.after(time) + BEHIND * current

    source = SourceEmf(behind=emf(-master.size / 2), ahead=emf(master.to_next))
    declare_phasor_outputs(m, port, source, BEHIND)
    _declare_signals(m, found)
    return m.build()


def _declare_signals(m: ModelBuilder, found: Following) -> None:
    m.output("omega", found.frame.w, "pu", "Frequency that the PLL sees", base="f_n")
    m.output(
        "u_c",
        found.u_c,
        "pu",
        "Voltage magnitude behind the transformer, which mode 1 holds",
        base="S_n",
    )
    m.output("i", found.i, "pu", "Current magnitude in the converter", base="S_n")
    m.output(
        "current_demand",
        found.demand,
        "1",
        "Current that the outer control asks for, in parts of the limit",
    )
