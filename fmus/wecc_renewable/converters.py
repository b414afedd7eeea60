"""A plant's converter, as its controls and the network see it, and REGCA1 as one."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import NamedTuple

from fmus.converter_parts.bus_voltage import ExtrapolatedVoltage
from fmus.toolchain.frames import Phasor, power
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.phasor_port import MasterStep, SourceEmf, motion
from fmus.toolchain.port import DevicePort
from fmus.toolchain.symbols import Expr
from fmus.wecc_renewable.injection import Injection, declare_injection
from fmus.wecc_renewable.signals import turned


class Converter(ABC):
    """A converter of a plant, declared.

    ``current``: that it feeds at the extrapolated voltage, in the network frame, from states [pu, S_n];
    ``active_0``, ``reactive_0``: commands of current at the operating point [pu, S_n]."""

    current: Phasor
    active_0: Expr
    reactive_0: Expr

    @abstractmethod
    def follow(self, m: ModelBuilder, active: Expr, reactive: Expr) -> None:
        """Let the currents follow their commands [pu, S_n]."""

    @abstractmethod
    def emf(self, m: ModelBuilder, master: MasterStep) -> SourceEmf:
        """Return the emf behind the port's impedance, half a step ago and in half a step."""

    @abstractmethod
    def fed(self) -> tuple[Expr, Expr]:
        """Active and reactive current that it feeds [pu, S_n]."""


class Kind(NamedTuple):
    """The declarations of a record's converter: its port's impedance first, then the rest."""

    impedance: Callable[[ModelBuilder], Phasor]
    converter: Callable[[ModelBuilder, DevicePort, ExtrapolatedVoltage, Phasor], Converter]


def port_of_current(m: ModelBuilder) -> Phasor:
    """Declare the impedance across which a current is fed."""
    text = (
        "Reactance of the port, across which the current is fed; it changes nothing in steady state"
    )
    X = m.parameter("X_port", 2.0, "pu", text, base="S_n", minimum=0.01, source="chosen here")
    R = m.parameter("R_port", 0.0, "pu", "Resistance of the port", base="S_n", minimum=0.0)
    return Phasor(R, X)


class Regca1(Converter):
    """REGCA1: a current at the angle of the terminal voltage."""

    def __init__(
        self, m: ModelBuilder, port: DevicePort, seen: ExtrapolatedVoltage, Z: Phasor
    ) -> None:
        s_0 = power(port.v_0, port.i_0)
        v_0 = port.v_0.magnitude()
        self._seen, self._Z = seen, Z
        self._at_start = s_0 / v_0
        self._injection: Injection = declare_injection(
            m, seen.value.magnitude(), v_0, s_0.re, s_0.im
        )
        self.active_0, self.reactive_0 = self._injection.active_0, self._injection.reactive_0
        self._fed = Phasor(self._injection.active, -self._injection.reactive)
        self.current = turned(self._fed, seen.value) * port.connected

    def follow(self, m: ModelBuilder, active: Expr, reactive: Expr) -> None:
        """Let the currents follow their commands [pu, S_n]."""
        self._injection.follow(m, active, reactive)

    def emf(self, m: ModelBuilder, master: MasterStep) -> SourceEmf:
        """Return the emf across the port that gives the current."""
        with m.scope("source"):
            start = self._at_start.conjugate()
            moving = motion(m, "i", self._fed, start, "Current at the voltage's angle")

        def emf(time: Expr) -> Phasor:
            v = self._seen.after(time)
            return v + self._Z * turned(self._fed + moving * time, v)

        return SourceEmf(behind=emf(-master.size / 2), ahead=emf(master.to_next))

    def fed(self) -> tuple[Expr, Expr]:
        """Active and reactive current that it feeds [pu, S_n]."""
        return self._injection.active, self._injection.reactive


REGCA1 = Kind(port_of_current, Regca1)
