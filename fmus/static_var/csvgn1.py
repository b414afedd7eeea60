"""PSS/E's CSVGN1: a static var compensator, a fixed capacitor beside a reactor that thyristors control.

    v − V_ref → K·(1+sT_1)(1+sT_2)/((1+sT_3)(1+sT_4)) → within V_MIN and V_MAX → 1/(1+sT_5), within R_MIN/S_n and 1 → y
    B = (C_BASE − S_n·y)/S_n        [pu, S_n]

y is the reactor's share of S_n, which is MBASE; a higher voltage asks for more of it. At the start y follows from the
reactive power of the power flow, and V_ref from y.

Sources: PSS/E's CSVGN1 as PowerSimulationsDynamics.jl and PowerWorld's guide describe it; the order of its fields as in
the 14-generator benchmark of the IEEE PES."""

from fmus.converter_parts.bus_voltage import extrapolated_voltage
from fmus.toolchain.blocks import clamp, lead_lag, limited_low_pass
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

SOURCE = "14-generator benchmark of the IEEE PES, bus 205"

S_N = 430.0
"""Default rating [MVA]."""

MOST_POWER = 1e-4
"""Active power of the power flow that a compensator may have [pu, S_n]: rounding of a file."""

LAG = 1e-3
"""Smallest time constant of the stage behind T_3 [s]: PSS/E asks for more than 0."""


def csvgn1_phasor() -> Model:
    """The static var compensator, phasor type."""
    title = "Static var compensator CSVGN1 of PSS/E (phasor type)"
    m = phasor_builder("csvgn1_phasor", title, kind="load")
    rating = declare_rating(m, S_N)
    port = device_port_of(m, rating, P_0=0.0)
    text = "Reactance of the port, across which the current is fed"
    X = m.parameter("X", 0.5, "pu", text, base="S_n", minimum=0.01)
    R = m.parameter("R", 0.0, "pu", "Resistance of the port", base="S_n", minimum=0.0)
    Z = Phasor(R, X)
    master = declare_master_step(m)
    seen = extrapolated_voltage(m, port, master)
    seen.follow(m, port.v)
    B = _susceptance(m, port, rating, seen.value)

    def emf(time: Expr) -> Phasor:
        v = seen.after(time)
        return v + Z * Phasor(0.0, -B) * v

    declare_phasor_outputs(
        m, port, SourceEmf(behind=emf(-master.size / 2), ahead=emf(master.to_next)), Z
    )
    m.output("B", B, "pu", "Susceptance; above 0 capacitive", base="S_n")
    return m.build()


def _susceptance(m: ModelBuilder, port: DevicePort, rating: Expr, v: Phasor) -> Expr:
    """The compensator's susceptance [pu, S_n] at a bus voltage [pu]."""

    def number(name: str, start: float, unit: str, text: str, least: float | None = None) -> Expr:
        base = "S_n" if unit == "pu" else ""
        return m.parameter(name, start, unit, text, base=base, minimum=least, source=SOURCE)

    K = number("K", 15.3846, "pu", "Gain, reactor's share per voltage", 1e-3)
    leads = number("T1", 0.0, "s", "Lead", 0), number("T2", 1.0, "s", "Second lead", 0)
    T3 = number("T3", 0.074641, "s", "Lag", LAG)
    T4 = number("T4", 1.0, "s", "Second lag; 0 leaves the stage out", 0)
    T5 = number("T5", 0.005359, "s", "Lag of the thyristors' control; 0 leaves it out", 0)
    least = number("RMIN", 0.0, "Mvar", "Smallest reactor", 0)
    V_MAX = number("VMAX", 1.0, "pu", "Upper limit of the control")
    V_MIN = number("VMIN", 0.0, "pu", "Lower limit of the control")
    C_BASE = number("CBASE", 300.0, "Mvar", "Fixed capacitor")
    s_0, size_0 = power(port.v_0, port.i_0), port.v_0.magnitude()
    y_0 = C_BASE / rating - s_0.im / size_0**2
    m.require(MOST_POWER - fabs(s_0.re), "P_0: a static var compensator feeds no active power")
    for low, high, name in ((V_MIN, V_MAX, "VMIN to VMAX"), (least / rating, 1, "RMIN to S_n")):
        text = f"the power flow's reactive power asks for a reactor outside of {name}"
        m.require(y_0 - low + MOST_POWER, f"{text}: lower Q_0, or change CBASE")
        m.require(high - y_0 + MOST_POWER, f"{text}: raise Q_0, or change CBASE")
    reference = m.calculated("Vref", size_0 - y_0 / K, "pu", "Voltage reference", base="bus")
    first = lead_lag(m, "first", K * (v.magnitude() - reference), leads[0], T3, y_0)
    second = lead_lag(m, "second", first, leads[1], T4, y_0)
    asked = clamp(second, V_MIN, V_MAX)
    y = limited_low_pass(m, "reactor", asked, T5, least / rating, 1, initial=y_0)
    return C_BASE / rating - y
