"""The control of a reactor beside a fixed capacitor, as PSS/E's CSVGN1, CSVGN3 and CSVGN4 have it.

    v − V_ref → K·(1+sT_1)(1+sT_2)/((1+sT_3)(1+sT_4)) → within V_MIN and V_MAX → 1/(1+sT_5), within R_MIN/S_n and 1 → y
    B = (C_BASE − S_n·y)/S_n        [pu, S_n]

Sources: `fmus.static_var.csvgn1`, `fmus.static_var.csvgn3`."""

from fmus.static_var.held_bus import HeldVoltage
from fmus.static_var.susceptance import MOST_POWER, initial_susceptance
from fmus.toolchain.blocks import clamp, lead_lag, limited_low_pass
from fmus.toolchain.frames import Phasor
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.port import DevicePort
from fmus.toolchain.symbols import Expr, if_else

SOURCE = "14-generator benchmark of the IEEE PES, bus 205"

LAG = 1e-3
"""Smallest time constant of the stage behind T_3 [s]: PSS/E asks for more than 0."""

OVERRIDE = 0.15
"""Default distance of the voltage from its reference from which on the override acts [pu]."""


def reactor_susceptance(
    m: ModelBuilder, port: DevicePort, rating: Expr, v: Phasor, held: HeldVoltage
) -> Expr:
    """The compensator's susceptance [pu, S_n] at a bus voltage [pu], by its regulator alone."""
    return _susceptance(m, port, rating, held, None)


def overridden_susceptance(
    m: ModelBuilder, port: DevicePort, rating: Expr, v: Phasor, held: HeldVoltage
) -> Expr:
    """The same with the override: further than V_OV from its reference, the voltage asks for all, or for no reactor."""
    text = "Distance of the voltage from its reference from which on the override acts"
    V_OV = m.parameter("VOV", OVERRIDE, "pu", text, base="bus", minimum=0, source=SOURCE)
    return _susceptance(m, port, rating, held, V_OV)


def _susceptance(
    m: ModelBuilder, port: DevicePort, rating: Expr, held: HeldVoltage, override: Expr | None
) -> Expr:
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
    y_0 = C_BASE / rating - initial_susceptance(m, port)
    for low, high, name in ((V_MIN, V_MAX, "VMIN to VMAX"), (least / rating, 1, "RMIN to S_n")):
        text = f"the power flow's reactive power asks for a reactor outside of {name}"
        m.require(y_0 - low + MOST_POWER, f"{text}: lower Q_0, or change CBASE")
        m.require(high - y_0 + MOST_POWER, f"{text}: raise Q_0, or change CBASE")
    reference = m.calculated("Vref", held.start - y_0 / K, "pu", "Voltage reference", base="bus")
    error = held.now - reference
    first = lead_lag(m, "first", K * error, leads[0], T3, y_0)
    second = lead_lag(m, "second", first, leads[1], T4, y_0)
    asked = clamp(second, V_MIN, V_MAX)
    if override is not None:
        text = "the override acts at the power flow's point already: raise VOV, or K"
        m.require(override - y_0 / K, text)
        m.require(override + y_0 / K, text)
        asked = if_else(error > override, 1, if_else(error < -override, least / rating, asked))
    y = limited_low_pass(m, "reactor", asked, T5, least / rating, 1, initial=y_0)
    return C_BASE / rating - y
