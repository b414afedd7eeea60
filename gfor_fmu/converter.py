"""The grid-forming converter: electrical side, inner loops, droops and both POD controllers put together."""

from dataclasses import dataclass

from fmus.converter_parts.filter import declare_filter, filter_equations
from fmus.toolchain.frames import Phasor, power
from fmus.toolchain.model import Model
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.port import DevicePort, declare_port_outputs, device_port
from fmus.toolchain.symbols import Expr
from gfor_fmu.droop import Droop, declare_droop, frequency, voltage_reference
from gfor_fmu.inner_loops import inner_loops
from gfor_fmu.negative_sequence import declare_negative_sequence_drop
from gfor_fmu.phase_limit import declare_phase_limit
from gfor_fmu.pod import pod
from gfor_fmu.usual_ranges import FORMING
from gfor_fmu.virtual_impedance import declare_virtual_impedance

S_N = 1500.0  # default rating [MVA]: the two-area system's converter
P_0 = 0.9  # default dispatch [pu, S_n]: that of the same converter


@dataclass(frozen=True)
class OuterControl:
    """Droops and POD controllers, and their outputs: frequency, voltage reference, supplementary references [pu]."""

    droop: Droop
    omega: Expr
    u_ref: Phasor
    delta_p: Expr
    delta_q: Expr


@dataclass(frozen=True)
class Converter:
    """Outputs of every variant: current into the grid (network frame), control signals, internal magnitudes [pu,
    S_n]; the demanded current in parts of its limit where the model has the limit."""

    current: Phasor
    control: OuterControl
    u: Expr
    i_s: Expr
    current_demand: Expr | None = None


def grid_forming_converter() -> Model:
    """Average EMT-type model of a droop-controlled grid-forming converter, stiff DC side (the paper's Fig. 1)."""
    title = (
        "Grid-forming converter with P-f and Q-V droop, POD-P and POD-Q (EMT-type average model)"
    )
    m = ModelBuilder("gfor", title, kind="converter", usual=FORMING)
    port = device_port(m, S_n=S_N, P_0=P_0)
    converter = declare_converter(m, port)
    declare_port_outputs(m, port, converter.current)
    declare_converter_outputs(m, converter)
    return m.build()


def declare_converter(
    m: ModelBuilder, port: DevicePort, measured: Expr | None = None, *, of_phases: bool = False
) -> Converter:
    """Declare everything behind a port, whatever its inputs are.

    Parameters
    ----------
    m
        The model it belongs to.
    port
        The port.
    measured
        Frequency that the POD controllers act on [pu], as of `outer_control`.
    of_phases
        Whether the port has phases, and so the control a resistance to the negative sequence and a limit of each.
    """
    virtual = declare_virtual_impedance(m)
    electrical = declare_filter(m, port, virtual.rated)
    P, Q = m.algebraic("P"), m.algebraic("Q")
    droop = declare_droop(m, electrical.initial, Phasor(P, Q))
    control = outer_control(m, droop, port.omega_b, measured)
    beside = (
        declare_negative_sequence_drop(m, electrical, port.omega_b, control.omega)
        if of_phases
        else None
    )
    phases = declare_phase_limit(m, electrical, port.omega_b, control.omega) if of_phases else None
    v_c, limited = inner_loops(
        m,
        electrical,
        port.omega_b,
        control.omega,
        control.u_ref,
        virtual,
        beside=beside,
        phases=phases,
    )
    # Exactly the power at the capacitor while nothing is limited.
    s = power(electrical.u + limited.informed, electrical.i_g.value)
    m.close(P, s.re)
    m.close(Q, s.im)
    filter_equations(m, electrical, port, v_c, droop.theta, control.omega)
    current = electrical.i_g.value.rotated(droop.theta)
    return Converter(
        current, control, electrical.u.magnitude(), electrical.i_s.value.magnitude(), limited.share
    )


def outer_control(
    m: ModelBuilder, droop: Droop, omega_b: Expr, measured: Expr | None = None
) -> OuterControl:
    """Both POD controllers around the droops, and the angle that follows.

    Parameters
    ----------
    m
        The model it belongs to.
    droop
        The droops.
    omega_b
        Rated angular frequency [rad/s].
    measured
        Frequency that the POD controllers act on [pu]; by default the one that the converter imposes itself.
    """
    # The POD acts on the frequency that its own output changes. Only states lie between them (T_f),
    # so each controller can be given the deviation symbolically: first w as a function of ΔP, then ΔP.
    omega = m.algebraic("w")
    seen = omega if measured is None else measured
    delta_p = pod(m, "pod_p", seen - 1, sign=-1, T_S1=0.20, T_S2=0.37)
    delta_q = pod(m, "pod_q", seen - 1, sign=+1, T_S1=0.26, T_S2=0.29)
    m.close(omega, frequency(droop, delta_p))
    m.derivative(droop.theta, omega_b * (omega - 1))
    return OuterControl(droop, omega, voltage_reference(droop, delta_q), delta_p, delta_q)


def declare_converter_outputs(m: ModelBuilder, converter: Converter) -> None:
    """Declare the control's signals and the magnitudes inside."""
    control = converter.control
    m.output("omega", control.omega, "pu", "Frequency imposed by the converter", base="f_n")
    m.output(
        "delta_p_pod",
        control.delta_p,
        "pu",
        "Supplementary active-power reference of POD-P",
        base="S_n",
    )
    m.output(
        "delta_q_pod",
        control.delta_q,
        "pu",
        "Supplementary reactive-power reference of POD-Q",
        base="S_n",
    )
    m.output("u", converter.u, "pu", "Voltage magnitude at the filter capacitor", base="S_n")
    m.output("i_s", converter.i_s, "pu", "Current magnitude in the converter", base="S_n")
    if converter.current_demand is not None:
        m.output(
            "current_demand",
            converter.current_demand,
            "1",
            "Demanded current in parts of its limit; above 1 it acts",
        )
