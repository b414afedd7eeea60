"""The converter's control alone: what the converter computes between its measurements and its bridge.

The equations are those of `grid_forming_converter`, cut where a real converter is cut. The control measures three
phase quantities: the voltage u across the capacitor branch, the current i_s in the converter-side inductor and the
current i_g behind the capacitor. It gives the voltage of the bridge. Filter, transformer and bridge are left to the
host: `control_part` says what it must build."""

from dataclasses import fields

from fmus.converter_parts.control_part import CircuitElement, ControlPart
from fmus.converter_parts.filter import FilterData, MeasuredFilter, declare_filter_data
from fmus.toolchain.frames import Phasor, QdState, of_phases, phases, power
from fmus.toolchain.model import Model
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.port import declare_operating_point, declare_rating
from fmus.toolchain.symbols import Expr, sqrt
from gfor_fmu.converter import P_0, S_N, OuterControl, outer_control
from gfor_fmu.droop import declare_droop
from gfor_fmu.inner_loops import inner_loops
from gfor_fmu.three_phases import V_N
from gfor_fmu.usual_ranges import FORMING
from gfor_fmu.virtual_impedance import declare_virtual_impedance

# parameter with which the bridge voltage makes up for the time until it is applied
LEAD = "output_lead"
_THIRD = (1.0, -0.5, -0.5)  # phases a, b, c of a cosine of amplitude 1 at the angle 0


def grid_forming_control() -> Model:
    """The control part of `grid_forming_converter` with instantaneous phase quantities in kV and kA."""
    m = ModelBuilder(
        "gfor_control",
        "Control of the grid-forming converter: measured u, i_s, i_g to bridge voltage",
        usual=FORMING,
    )
    rating = declare_rating(m, S_N)
    V_n = m.parameter(
        "V_n", V_N, "kV", "Rated voltage at the filter, line to line, rms", minimum=1e-3
    )
    angle_0 = m.parameter(
        "angle_0",
        0.0,
        "rad",
        "Angle of the network frame at the start; phase a is v·cos(angle_0 + theta_0) there",
    )
    lead = m.parameter(
        LEAD,
        0.0,
        "s",
        "Time by which the bridge voltage leads: from the sample to the middle of its use",
        minimum=0.0,
    )
    # Of phase quantities: 1 pu is the amplitude of the rated phase voltage, and the current that gives S_n with it.
    volt, ampere = V_n * sqrt(2 / 3), rating / V_n * sqrt(2 / 3)
    start_volt, start_ampere = V_N * (2 / 3) ** 0.5, S_N / V_N * (2 / 3) ** 0.5
    u = _measured(
        m, "u", "kV", "Voltage of phase {} across the capacitor branch, to neutral", start_volt
    )
    i_s = _measured(
        m,
        "i_s",
        "kA",
        "Current of phase {} in the converter-side inductor, to the grid",
        P_0 * start_ampere,
    )
    i_g = _measured(
        m, "i_g", "kA", "Current of phase {} behind the capacitor, to the grid", P_0 * start_ampere
    )
    angle = m.state(
        "frame.angle", angle_0, "rad", "Angle of the network frame, φ_0 + ω_b·t", stepwise=True
    )

    point = declare_operating_point(m, P_0)
    m.derivative(angle, point.omega_b)
    virtual = declare_virtual_impedance(m)
    data = declare_filter_data(m, point, virtual.rated)
    theta = m.algebraic("theta")
    seen = [of_phases(value, angle).rotated(-theta) for value in (u, i_s, i_g)]
    scaled = seen[0] / volt, seen[1] / ampere, seen[2] / ampere
    measured = _as_measured(data, *scaled)
    P, Q = m.algebraic("P"), m.algebraic("Q")
    droop = declare_droop(m, data.initial, Phasor(P, Q))
    m.close(theta, droop.theta)
    control = outer_control(m, droop, point.omega_b)
    bridge, limited = inner_loops(m, measured, point.omega_b, control.omega, control.u_ref, virtual)
    felt = power(measured.u + limited.informed, measured.i_g.value)
    m.close(P, felt.re)
    m.close(Q, felt.im)

    ahead = angle + droop.theta + control.omega * point.omega_b * lead
    for name, value in zip("abc", phases(bridge * volt, ahead), strict=True):
        m.output(f"v_{name}", value, "kV", f"Voltage of the bridge in phase {name}, to neutral")
    _declare_signals(m, measured, control, rating)
    return m.build()


def _measured(
    m: ModelBuilder, name: str, unit: str, text: str, peak: float
) -> tuple[Expr, Expr, Expr]:
    a, b, c = (
        m.input(f"{name}_{phase}", unit, text.format(phase), start=peak * part)
        for phase, part in zip("abc", _THIRD, strict=True)
    )
    return a, b, c


def _as_measured(data: FilterData, u: Phasor, i_s: Phasor, i_g: Phasor) -> MeasuredFilter:
    """The filter's data with its measured quantities in place of states, converter's frame [pu, S_n]."""
    known = {field.name: getattr(data, field.name) for field in fields(FilterData)}
    as_pair = [QdState(Expr(value.re), -Expr(value.im)) for value in (i_s, i_g)]
    return MeasuredFilter(**known, i_s=as_pair[0], i_g=as_pair[1], u=u)


def _declare_signals(
    m: ModelBuilder, f: MeasuredFilter, control: OuterControl, rating: Expr
) -> None:
    s = power(f.u, f.i_g.value) * rating
    m.output("p", s.re, "MW", "Active power at the filter capacitor")
    m.output("q", s.im, "Mvar", "Reactive power at the filter capacitor")
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


def control_part() -> ControlPart:
    """The control of `gfor`, and the circuit that a host builds around it."""
    return ControlPart(
        model=grid_forming_control(),
        lead=LEAD,
        circuit=(
            CircuitElement(
                "L_c", "converter-side inductor, bridge to capacitor", "filter.X_c", "inductance"
            ),
            CircuitElement("R_c", "in series with L_c", "filter.R_c", "resistance"),
            CircuitElement(
                "C_c", "filter capacitor, each phase to neutral", "filter.B_c", "capacitance"
            ),
            CircuitElement("R_cap", "in series with C_c", "filter.B_c", "damping"),
            CircuitElement(
                "L_t", "step-up transformer, capacitor to bus", "transformer.X_t", "inductance"
            ),
            CircuitElement("R_t", "in series with L_t", "transformer.R_t", "resistance"),
        ),
    )
