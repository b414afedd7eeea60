"""A station at its bus: a power that follows the bus voltage, fed across the reactance of a port.

The bus voltage that a station sees goes through two lags that extrapolate it (`fmus.converter_parts.bus_voltage`)."""

from collections.abc import Callable
from dataclasses import dataclass

from fmus.converter_parts.bus_voltage import (
    LEAST_SQUARE,
    ExtrapolatedVoltage,
    extrapolated_voltage,
)
from fmus.toolchain.frames import Phasor, power
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.phasor_port import (
    MasterStep,
    SourceEmf,
    declare_master_step,
    declare_phasor_outputs,
)
from fmus.toolchain.port import DevicePort, declare_rating, device_port_of
from fmus.toolchain.symbols import Expr, fmax
from fmus.toolchain.variables import usual_beside

USUAL = usual_beside(__file__)

Fed = Callable[[Expr, Expr], tuple[Expr, Expr]]
"""Bus voltage [pu], time after now [s] → active power into the bus [MW], reactive power out of it [Mvar]."""


@dataclass(frozen=True)
class Station:
    """A station's port, and what it sees of its bus.

    ``rating``: [MVA]; ``seen``: the bus voltage; ``master``: communication step; ``impedance``: of the port [pu,
    S_n]."""

    port: DevicePort
    rating: Expr
    seen: ExtrapolatedVoltage
    master: MasterStep
    impedance: Phasor

    @property
    def p_0(self) -> Expr:
        """Active power into the bus at the operating point [MW]."""
        return Expr(power(self.port.v_0, self.port.i_0).re) * self.rating

    @property
    def size_0(self) -> Expr:
        """Voltage of the bus at the operating point [pu]."""
        return self.port.v_0.magnitude()

    def size_after(self, time: Expr) -> Expr:
        """Voltage of the bus [pu], a time [s] after the end of a communication step."""
        return self.seen.after(time).magnitude()

    def feed(self, m: ModelBuilder, fed: Fed, drawn_0: Expr) -> None:
        """Declare the port's outputs, and the susceptance that the power flow's reactive power asks for.

        ``drawn_0``: reactive power out of the bus at the operating point [Mvar]."""
        q_0 = power(self.port.v_0, self.port.i_0).im + drawn_0 / self.rating
        text = "Susceptance beside the bridges, for the power flow's reactive power; above 0 capacitive"
        B = m.calculated("B_shunt", q_0 / self.size_0**2, "pu", text, base="S_n")

        def emf(time: Expr) -> Phasor:
            v = self.seen.after(time)
            p, q = fed(v.magnitude(), time)
            square = fmax(v.re**2 + v.im**2, LEAST_SQUARE)
            bridges = Phasor(p, q) / (self.rating * square)
            return v + self.impedance * (bridges + Phasor(0.0, -B)) * v

        behind, ahead = -self.master.size / 2, self.master.to_next
        declare_phasor_outputs(
            m, self.port, SourceEmf(behind=emf(behind), ahead=emf(ahead)), self.impedance
        )


def declare_station(m: ModelBuilder, P_0: float) -> Station:
    """Declare the port of a station of 1000 MVA, and what it sees of its bus.

    ``P_0``: default of the active power into the bus [pu, S_n]."""
    rating = declare_rating(m, 1000.0)
    port = device_port_of(m, rating, P_0)
    text = "Reactance of the port, across which the current is fed"
    X = m.parameter("X", 0.5, "pu", text, base="S_n", minimum=0.01)
    R = m.parameter("R", 0.0, "pu", "Resistance of the port", base="S_n", minimum=0.0)
    master = declare_master_step(m)
    seen = extrapolated_voltage(m, port, master)
    seen.follow(m, port.v)
    return Station(port, rating, seen, master, Phasor(R, X))
