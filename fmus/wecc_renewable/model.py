"""A wind, solar or battery plant of WECC's generic models, phasor type: converter, control, and what sets references.

The current follows the angle of the terminal voltage at once, as in the specifications of REGCA1 and REGCB1: there is
no PLL. The emf of REGCA1 is the voltage that its current gives behind a reactance of the port, with an extrapolated
terminal voltage."""

from collections.abc import Callable
from dataclasses import dataclass

from fmus.converter_parts.bus_voltage import ExtrapolatedVoltage, extrapolated_voltage
from fmus.converter_parts.current_at_angle import port_of_current
from fmus.toolchain.frames import Phasor, power
from fmus.toolchain.model import Model
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.phasor_port import (
    MasterStep,
    declare_master_step,
    declare_phasor_outputs,
    phasor_builder,
)
from fmus.toolchain.port import DevicePort, declare_rating, device_port_of
from fmus.toolchain.symbols import Expr
from fmus.toolchain.variables import usual_beside
from fmus.wecc_renewable.converters import REGCA1, Converter, Kind
from fmus.wecc_renewable.electrical import (
    Electrical,
    Reeca1,
    commands,
    declare_electrical,
    in_dip,
)
from fmus.wecc_renewable.plant import Measured, measured_elsewhere, plant_references
from fmus.wecc_renewable.several_units import references_by_plant
from fmus.wecc_renewable.signals import References, Terminal
from fmus.wecc_renewable.turbine import Turbine, TurbineParts
from fmus.wecc_renewable.type_3 import Wt3, Wt3g1, port_of_machine
from fmus.wecc_renewable.type_4 import Wt4g1
from fmus.wecc_renewable.type_4 import commands as commands_of_type_4

S_N = 100.0  # default rating [MVA]: the base of networks
P_0 = 0.8  # default power [pu, S_n]
USUAL = usual_beside(__file__)


@dataclass(frozen=True)
class Makeup:
    """The parts of a plant: converter, control, the plant's controller and where it measures, and a turbine.

    ``is_one_of_several``: whether a controller of several units, a component of its own, changes the references."""

    converter: Kind = REGCA1
    control: type[Reeca1] = Reeca1
    has_plant: bool = False
    measures_elsewhere: bool = False
    is_one_of_several: bool = False
    turbine: TurbineParts | None = None


@dataclass(frozen=True)
class _Plant:
    """A plant's converter, electrical control and turbine, before its references are known."""

    port: DevicePort
    seen: ExtrapolatedVoltage
    converter: Converter
    terminal: Terminal
    turbine: Turbine | None
    electrical: Electrical


@dataclass(frozen=True)
class _Begun:
    """A model of a plant with what every one begins with; ``Z``: of its converter's emf [pu, S_n]."""

    m: ModelBuilder
    S_n: Expr
    port: DevicePort
    Z: Phasor
    master: MasterStep
    seen: ExtrapolatedVoltage

    def declare_outputs(self, converter: Converter) -> None:
        """Declare what the port and the currents that the converter feeds are."""
        m = self.m
        declare_phasor_outputs(m, self.port, converter.emf(m, self.master), self.Z)
        active, reactive = converter.fed()
        v = self.seen.value.magnitude()
        m.output("V", v, "pu", "Voltage magnitude at the terminal", base="bus")
        m.output("I_p_fed", active, "pu", "Active current", base="S_n")
        m.output("I_q_fed", reactive, "pu", "Reactive current", base="S_n")


def _begun(name: str, title: str, impedance: Callable[[ModelBuilder], Phasor]) -> _Begun:
    m = phasor_builder(name, title, kind="converter", usual=USUAL)
    S_n = declare_rating(m, S_N)
    port = device_port_of(m, S_n, P_0)
    Z = impedance(m)
    master = declare_master_step(m)
    seen = extrapolated_voltage(m, port, master)
    seen.follow(m, port.v)
    return _Begun(m, S_n, port, Z, master, seen)


def regca1_phasor() -> Model:
    """REGCA1 with REECA1 or REECB1, with constant references."""
    title = "Plant of REGCA1 with REECA1 or REECB1 (phasor type)"
    return composed("regca1_phasor", title, Makeup())


def regca1_repca1_phasor() -> Model:
    """REGCA1 with REECA1 or REECB1, behind the plant's controller REPCA1."""
    title = "Plant of REGCA1 with REECA1 or REECB1 and REPCA1 (phasor type)"
    return composed("regca1_repca1_phasor", title, Makeup(has_plant=True))


def regca1_repca1_remote_phasor() -> Model:
    """REGCA1 with REECA1 or REECB1, behind a REPCA1 that measures at another point of the network."""
    title = (
        "Plant of REGCA1 with REECA1 or REECB1 and a REPCA1 that measures elsewhere (phasor type)"
    )
    makeup = Makeup(has_plant=True, measures_elsewhere=True)
    return composed("regca1_repca1_remote_phasor", title, makeup)


def composed(name: str, title: str, makeup: Makeup) -> Model:
    """The plant of a makeup."""
    begun = _begun(name, title, makeup.converter.impedance)
    m, port, seen = begun.m, begun.port, begun.seen
    converter = makeup.converter.converter(m, port, seen, begun.Z)
    plant = _declared(m, port, seen, converter, makeup, begun.S_n)
    turbine, t = plant.turbine, plant.terminal
    own = plant.electrical.references
    start = own if turbine is None else References(turbine.reference_0(own.P, t), own.Q)
    references = _references(m, plant, start, makeup)
    asked = references.P
    if turbine is not None:
        asked = turbine.reference(m, t, asked, own.P, in_dip(t, plant.electrical))
    with m.scope("electrical"):
        speed = None if turbine is None else turbine.speed
        found = commands(m, t, plant.electrical, References(asked, references.Q), speed)
    if turbine is not None:
        beyond = found.power - plant.electrical.power_0 - (references.P - start.P)
        turbine.close(m, t, beyond)
    plant.converter.follow(m, found.active, found.reactive)
    begun.declare_outputs(plant.converter)
    m.output("I_p_command", found.active, "pu", "Command of active current", base="S_n")
    m.output("I_q_command", found.reactive, "pu", "Command of reactive current", base="S_n")
    if turbine is not None:
        turbine.declare_outputs(m)
    return m.build()


def type_3(name: str, title: str, *, has_pitch: bool) -> Model:
    """The turbine of WT3G1, WT3E1 and WT3T1, with WT3P1 or without."""
    begun = _begun(name, title, port_of_machine)
    m, port, seen = begun.m, begun.port, begun.seen
    converter = Wt3g1(m, port, seen, begun.Z, begun.S_n)
    turbine = Wt3(m, _terminal(port, seen, converter), converter, has_pitch=has_pitch)
    active, emf = turbine.close(m)
    converter.follow(m, active, emf)
    begun.declare_outputs(converter)
    m.output("I_p_command", active, "pu", "Command of active current", base="S_n")
    m.output("E_q_command", emf, "pu", "Command of the emf", base="bus")
    turbine.declare_outputs(m)
    return m.build()


def type_4(name: str, title: str) -> Model:
    """The turbine of WT4G1 and WT4E1."""
    begun = _begun(name, title, port_of_current)
    m, port, seen = begun.m, begun.port, begun.seen
    converter = Wt4g1(m, port, seen, begun.Z)
    with m.scope("electrical"):
        active, reactive = commands_of_type_4(m, _terminal(port, seen, converter), converter)
    converter.follow(m, active, reactive)
    begun.declare_outputs(converter)
    m.output("I_p_command", active, "pu", "Command of active current", base="S_n")
    m.output("I_q_command", reactive, "pu", "Command of reactive current", base="S_n")
    return m.build()


def _terminal(port: DevicePort, seen: ExtrapolatedVoltage, converter: Converter) -> Terminal:
    """The terminal as a plant's controls see it."""
    v = seen.value
    s_0, s = power(port.v_0, port.i_0), power(v, converter.current)
    return Terminal(
        v=v,
        i=converter.current,
        size=v.magnitude(),
        P=Expr(s.re),
        Q=Expr(s.im),
        v_0=port.v_0,
        i_0=port.i_0,
        size_0=port.v_0.magnitude(),
        P_0=s_0.re,
        Q_0=s_0.im,
    )


def _declared(
    m: ModelBuilder,
    port: DevicePort,
    seen: ExtrapolatedVoltage,
    converter: Converter,
    makeup: Makeup,
    rating: Expr,
) -> _Plant:
    terminal = _terminal(port, seen, converter)
    parts = makeup.turbine
    turbine = None if parts is None else Turbine(m, terminal, parts, rating)
    with m.scope("electrical"):
        electrical = declare_electrical(
            m,
            makeup.control(),
            terminal,
            converter.active_0,
            converter.reactive_0,
            None if turbine is None else turbine.speed_0,
        )
    return _Plant(port, seen, converter, terminal, turbine, electrical)


def _references(m: ModelBuilder, plant: _Plant, start: References, makeup: Makeup) -> References:
    if makeup.is_one_of_several:
        with m.scope("plant"):
            return references_by_plant(m, plant.port.current_scale, start)
    if makeup.has_plant:
        return _references_of_plant(m, plant, start, measures_elsewhere=makeup.measures_elsewhere)
    return _constant_references(m, start)


def _references_of_plant(
    m: ModelBuilder, plant: _Plant, start: References, *, measures_elsewhere: bool
) -> References:
    t = plant.terminal
    with m.scope("plant"):
        point = (
            measured_elsewhere(m, plant.port.current_scale)
            if measures_elsewhere
            else Measured(t.size, t.P, t.Q, t.size_0, t.P_0, t.Q_0)
        )
        return plant_references(m, point, plant.seen, plant.port.omega_b, start)


def _constant_references(m: ModelBuilder, start: References) -> References:
    change_P = m.parameter(
        "delta_Pref", 0, "pu", "Change of the active power's reference", base="S_n", tunable=True
    )
    change_Q = m.parameter(
        "delta_Qref",
        0,
        "pu",
        "Change of the reference of reactive power, or of voltage where that is controlled",
        base="S_n",
        tunable=True,
    )
    return References(start.P + change_P, start.Q + change_Q)
