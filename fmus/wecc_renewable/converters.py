"""A plant's converter, as its controls and the network see it, and REGCA1 as one."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import NamedTuple

from fmus.converter_parts.bus_voltage import ExtrapolatedVoltage
from fmus.converter_parts.current_at_angle import at_angle_of, emf_of_current, port_of_current
from fmus.toolchain.frames import Phasor, power
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.phasor_port import MasterStep, SourceEmf
from fmus.toolchain.port import DevicePort
from fmus.toolchain.symbols import Expr
from fmus.wecc_renewable.injection import Injection, declare_injection


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


class Regca1(Converter):
    """REGCA1: a current at the angle of the terminal voltage."""

    _injection_of = staticmethod(declare_injection)

    def __init__(
        self, m: ModelBuilder, port: DevicePort, seen: ExtrapolatedVoltage, Z: Phasor
    ) -> None:
        s_0 = power(port.v_0, port.i_0)
        v_0 = port.v_0.magnitude()
        self._seen, self._Z = seen, Z
        self._at_start = s_0 / v_0
        self._injection: Injection = self._injection_of(
            m, seen.value.magnitude(), v_0, s_0.re, s_0.im
        )
        self.active_0, self.reactive_0 = self._injection.active_0, self._injection.reactive_0
        self._fed = Phasor(self._injection.active, -self._injection.reactive)
        self.current = at_angle_of(seen.value, self._fed) * port.connected

    def follow(self, m: ModelBuilder, active: Expr, reactive: Expr) -> None:
        """Let the currents follow their commands [pu, S_n]."""
        self._injection.follow(m, active, reactive)

    def emf(self, m: ModelBuilder, master: MasterStep) -> SourceEmf:
        """Return the emf across the port that gives the current."""
        start = self._at_start.conjugate()
        return emf_of_current(m, self._seen, self._Z, self._fed, start, master)

    def fed(self) -> tuple[Expr, Expr]:
        """Active and reactive current that it feeds [pu, S_n]."""
        return self._injection.active, self._injection.reactive


REGCA1 = Kind(port_of_current, Regca1)
