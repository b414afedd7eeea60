"""A wind, solar or battery plant of WECC's generic models, phasor type: REGCA1 with REECA1 or REECB1, and REPCA1.

The current follows the angle of the terminal voltage at once, as in the specifications: there is no PLL. Its emf is
the voltage that this current gives behind a reactance of the port, with an extrapolated terminal voltage."""

from dataclasses import dataclass

from fmus.converter_parts.bus_voltage import ExtrapolatedVoltage, extrapolated_voltage
from fmus.toolchain.frames import Phasor, power
from fmus.toolchain.model import Model
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.phasor_port import (
    SourceEmf,
    declare_master_step,
    declare_phasor_outputs,
    motion,
    phasor_builder,
)
from fmus.toolchain.port import DevicePort, device_port
from fmus.toolchain.symbols import Expr, fmax
from fmus.toolchain.variables import usual_beside
from fmus.wecc_renewable.electrical import Electrical, commands, declare_electrical
from fmus.wecc_renewable.injection import Injection, declare_injection
from fmus.wecc_renewable.plant import Measured, measured_elsewhere, plant_references
from fmus.wecc_renewable.signals import LEAST_VOLTAGE, References, Terminal

S_N = 100.0  # default rating [MVA]: the base of networks
P_0 = 0.8  # default power [pu, S_n]
USUAL = usual_beside(__file__)


@dataclass(frozen=True)
class _Plant:
    """A plant's converter and electrical control, before its references are known."""

    port: DevicePort
    seen: ExtrapolatedVoltage
    injection: Injection
    terminal: Terminal
    electrical: Electrical


def regca1_phasor() -> Model:
    """REGCA1 with REECA1 or REECB1, with constant references."""
    title = "Plant of REGCA1 with REECA1 or REECB1 (phasor type)"
    m = phasor_builder("regca1_phasor", title, kind="converter", usual=USUAL)
    return _closed(m, with_plant=False)


def regca1_repca1_phasor() -> Model:
    """REGCA1 with REECA1 or REECB1, behind the plant's controller REPCA1."""
    title = "Plant of REGCA1 with REECA1 or REECB1 and REPCA1 (phasor type)"
    m = phasor_builder("regca1_repca1_phasor", title, kind="converter", usual=USUAL)
    return _closed(m, with_plant=True)


def regca1_repca1_remote_phasor() -> Model:
    """REGCA1 with REECA1 or REECB1, behind a REPCA1 that measures at another point of the network."""
    title = (
        "Plant of REGCA1 with REECA1 or REECB1 and a REPCA1 that measures elsewhere (phasor type)"
    )
    m = phasor_builder("regca1_repca1_remote_phasor", title, kind="converter", usual=USUAL)
    return _closed(m, with_plant=True, measures_elsewhere=True)


def _closed(m: ModelBuilder, *, with_plant: bool, measures_elsewhere: bool = False) -> Model:
    port = device_port(m, S_n=S_N, P_0=P_0)
    text = (
        "Reactance of the port, across which the current is fed; it changes nothing in steady state"
    )
    X = m.parameter("X_port", 2.0, "pu", text, base="S_n", minimum=0.01, source="chosen here")
    R = m.parameter("R_port", 0.0, "pu", "Resistance of the port", base="S_n", minimum=0.0)
    Z = Phasor(R, X)
    master = declare_master_step(m)
    seen = extrapolated_voltage(m, port, master)
    seen.follow(m, port.v)
    plant = _declared(m, port, seen)
    references = (
        _references_of_plant(m, plant, measures_elsewhere=measures_elsewhere)
        if with_plant
        else _constant_references(m, plant)
    )
    with m.scope("electrical"):
        active, reactive = commands(m, plant.terminal, plant.electrical, references)
    plant.injection.follow(m, active, reactive)
    fed = Phasor(plant.injection.active, -plant.injection.reactive)
    at_start = power(port.v_0, port.i_0) / port.v_0.magnitude()
    with m.scope("source"):
        moving = motion(m, "i", fed, at_start.conjugate(), "Current at the voltage's angle")

    def emf(time: Expr) -> Phasor:
        v = seen.after(time)
        return v + Z * _turned(fed + moving * time, v)

    source = SourceEmf(behind=emf(-master.size / 2), ahead=emf(master.to_next))
    declare_phasor_outputs(m, port, source, Z)
    m.output("V", seen.value.magnitude(), "pu", "Voltage magnitude at the terminal", base="bus")
    m.output("I_p_fed", plant.injection.active, "pu", "Active current", base="S_n")
    m.output("I_q_fed", plant.injection.reactive, "pu", "Reactive current", base="S_n")
    m.output("I_p_command", active, "pu", "Command of active current", base="S_n")
    m.output("I_q_command", reactive, "pu", "Command of reactive current", base="S_n")
    return m.build()


def _turned(current: Phasor, v: Phasor) -> Phasor:
    """A current at a voltage's angle, in the network frame."""
    return current * v / fmax(v.magnitude(), LEAST_VOLTAGE)


def _declared(m: ModelBuilder, port: DevicePort, seen: ExtrapolatedVoltage) -> _Plant:
    v = seen.value
    size, size_0, s_0 = v.magnitude(), port.v_0.magnitude(), power(port.v_0, port.i_0)
    injection = declare_injection(m, size, size_0, s_0.re, s_0.im)
    i = _turned(Phasor(injection.active, -injection.reactive), v) * port.connected
    s = power(v, i)
    terminal = Terminal(
        v=v,
        i=i,
        size=size,
        P=Expr(s.re),
        Q=Expr(s.im),
        v_0=port.v_0,
        i_0=port.i_0,
        size_0=size_0,
        P_0=s_0.re,
        Q_0=s_0.im,
    )
    with m.scope("electrical"):
        electrical = declare_electrical(m, terminal, injection.active_0, injection.reactive_0)
    return _Plant(port, seen, injection, terminal, electrical)


def _references_of_plant(m: ModelBuilder, plant: _Plant, *, measures_elsewhere: bool) -> References:
    t, start = plant.terminal, plant.electrical.references
    with m.scope("plant"):
        point = (
            measured_elsewhere(m, plant.port.current_scale)
            if measures_elsewhere
            else Measured(t.size, t.P, t.Q, t.size_0, t.P_0, t.Q_0)
        )
        return plant_references(m, point, plant.seen, plant.port.omega_b, start)


def _constant_references(m: ModelBuilder, plant: _Plant) -> References:
    start = plant.electrical.references
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
