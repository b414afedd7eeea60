"""PSS/E's DERA1, WECC's DER_A: distributed generation behind one bus, phasor type.

The current keeps the angle of the terminal voltage: there is no PLL, as in the specification. Its emf is the voltage
that this current gives behind a reactance of the port, with an extrapolated terminal voltage."""

from math import pi

from fmus.converter_parts.bus_voltage import (
    ExtrapolatedVoltage,
    extrapolated_voltage,
    frequency_of,
)
from fmus.converter_parts.current_at_angle import emf_of_current, port_of_current
from fmus.distributed_generation.control import (
    Seen,
    commands,
    declare_flags,
    declare_parameters,
)
from fmus.distributed_generation.tripping import share_left
from fmus.synchronous_generator.data_lines import Given
from fmus.toolchain.blocks import clamp, low_pass
from fmus.toolchain.frames import Phasor, power
from fmus.toolchain.model import Model
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.phasor_port import (
    declare_master_step,
    declare_phasor_outputs,
    phasor_builder,
)
from fmus.toolchain.port import DevicePort, device_port
from fmus.toolchain.symbols import Expr, if_else

S_N = 100.0  # default rating [MVA]: the base of networks
P_0 = 0.8  # default power [pu, S_n]
UNLIMITED = 1e4  # rate [pu/s] that is none


def dera1_phasor() -> Model:
    """Distributed generation by DER_A."""
    title = "Distributed generation of WECC's DER_A (phasor type)"
    m = phasor_builder("dera1_phasor", title, kind="converter")
    port = device_port(m, S_n=S_N, P_0=P_0)
    Z = port_of_current(m)
    master = declare_master_step(m)
    seen = extrapolated_voltage(m, port, master)
    seen.follow(m, port.v)
    fed = _declare_current(m, port, seen)
    at_start = power(port.v_0, port.i_0) / port.v_0.magnitude()
    source = emf_of_current(m, seen, Z, fed, at_start.conjugate(), master)
    declare_phasor_outputs(m, port, source, Z)
    m.output("V", seen.value.magnitude(), "pu", "Voltage magnitude at the terminal", base="bus")
    m.output("I_p_fed", fed.re, "pu", "Active current", base="S_n")
    m.output("I_q_fed", -fed.im, "pu", "Reactive current", base="S_n")
    return m.build()


def _declare_current(m: ModelBuilder, port: DevicePort, seen: ExtrapolatedVoltage) -> Phasor:
    """Declare control, trips and current; return the current at the voltage's angle [pu, S_n]."""
    flags, p = declare_flags(m), declare_parameters(m)
    v, v_0 = seen.value.magnitude(), port.v_0.magnitude()
    s_0 = power(port.v_0, port.i_0)
    active_0, reactive_0 = s_0.re / v_0, s_0.im / v_0
    changes = tuple(
        m.parameter(f"delta_{name}", 0, "pu", f"Change of {name}", base="S_n", tunable=True)
        for name in ("Pref", "Qref")
    )
    frequency = frequency_of(m, seen, port.omega_b, p.Trf)
    active = m.state("I_p", active_0, "pu", "Active current behind its lag", base="S_n")
    reactive = m.state("I_q", reactive_0, "pu", "Reactive current behind its lag", base="S_n")
    P = v * active * port.connected
    what = Seen(
        v,
        v_0,
        frequency,
        P=P,
        P_0=Expr(s_0.re),
        active_0=active_0,
        reactive_0=reactive_0,
        references=(changes[0], changes[1]),
    )
    active_asked, reactive_asked, filtered = commands(m, p, flags, what)
    trips = flags["VtripFlag"], flags["FtripFlag"]
    left = share_left(m, p, filtered, frequency * port.omega_b / (2 * pi), trips)
    share = low_pass(m, "share_lagged", left, p.Tv, 1.0)
    _follow(m, p, (active, active_asked * share), (reactive, reactive_asked * share))
    m.output("share", share, "1", "Share of the generation that trips leave")
    m.output("f", frequency, "pu", "Frequency that is seen", base="f_n")
    m.output("I_p_command", active_asked, "pu", "Command of active current", base="S_n")
    m.output("I_q_command", reactive_asked, "pu", "Command of reactive current", base="S_n")
    return Phasor(active, -reactive)


def _follow(
    m: ModelBuilder, p: Given, active: tuple[Expr, Expr], reactive: tuple[Expr, Expr]
) -> None:
    """Let both currents follow; the active one rises by rrpwr at most, a storage's falls so as well."""
    x, wanted = active
    rate = (wanted - x) / p.Tg
    up = if_else(x >= 0, p.rrpwr, UNLIMITED)
    down = if_else(x >= 0, -UNLIMITED, -p.rrpwr)
    m.derivative(x, clamp(rate, down, up))
    m.derivative(reactive[0], (reactive[1] - reactive[0]) / p.Tg)
