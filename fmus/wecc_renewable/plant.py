"""REPCA1: the controller of a plant, which sets its converter's references by what it measures at one point.

    RefFlag: V_ref − |v − (Rc + j·Xc)·i| (VCFlag), or V_ref − (v + Kc·Q); else Q_ref − Q: measured behind Tfltr
             → beyond dbd1…dbd2, within emin…emax → Kp + Ki/s within Qmin…Qmax → (1+s·Tft)/(1+s·Tfv) → Q or V reference
    Fflag:   P_ref − P behind Tp, + Ddn·(1 − f) or Dup·(1 − f) beyond fdbd1…fdbd2 → within femin…femax
             → Kpg + Kig/s within Pmin…Pmax → 1/(1+s·Tg) → P reference; else it is constant

Ddn acts above rated frequency, Dup below. Below Vfrz the integrator of the upper part waits. The point is a bus and a
branch of the network; the converter's own terminal, as in PSS/E, where the record names neither. The frequency is that
of the terminal.

Source: WECC's specification of REPC_A (EPRI, 2013), and its "Solar Plant Dynamic Modeling Guidelines" (2014)."""

from collections.abc import Mapping
from dataclasses import dataclass

from fmus.converter_parts.bus_voltage import LEAST_VOLTAGE, ExtrapolatedVoltage, frequency_of
from fmus.synchronous_generator.data_lines import Given, declared, number, power, pu, seconds
from fmus.toolchain.blocks import clamp, lead_lag, low_pass, low_pass_or_nothing
from fmus.toolchain.frames import Phasor
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.port_variables import SYSTEM_BASE
from fmus.toolchain.symbols import Expr, Scalar, fmax, fmin, if_else
from fmus.wecc_renewable.signals import (
    ROUNDING,
    SOURCE,
    Controller,
    References,
    controlled,
    dead_band,
)

LINES = (
    seconds("Tfltr", 0.02, "Filter of voltage and reactive power; 0 leaves it out"),
    number("Kp", 18.0, "Proportional gain of reactive power or voltage", 0),
    number("Ki", 5.0, "Integral gain of reactive power or voltage", 0, "1/s"),
    seconds("Tft", 0.0, "Lead of the reference"),
    seconds("Tfv", 0.05, "Lag of the reference; 0 leaves the stage out"),
    pu("Vfrz", 0.0, "Voltage below which the integrator of Ki waits", base="bus"),
    power("Rc", 0.0, "Resistance of the compensation"),
    power("Xc", 0.0, "Reactance of the compensation"),
    power("Kc", 0.02, "Voltage by reactive power, where VCFlag is false"),
    number("emax", 0.1, "Most error of reactive power or voltage"),
    number("emin", -0.1, "Least error of reactive power or voltage"),
    number("dbd1", -1.0, "Lower end of its dead band; at most 0"),
    number("dbd2", 1.0, "Upper end of its dead band; at least 0", 0),
    number("Qmax", 0.43, "Most reference of reactive power or voltage"),
    number("Qmin", -0.43, "Least reference of reactive power or voltage"),
    number("Kpg", 1.0, "Proportional gain of active power", 0),
    number("Kig", 0.05, "Integral gain of active power", 0, "1/s"),
    seconds("Tp", 0.25, "Filter of active power; 0 leaves it out"),
    pu("fdbd1", -1.0, "Lower end of the dead band of 1 − f; at most 0", base="f_n"),
    pu("fdbd2", 1.0, "Upper end of the dead band of 1 − f; at least 0", 0.0, base="f_n"),
    power("femax", 99.0, "Most error of active power"),
    power("femin", -99.0, "Least error of active power"),
    power("Pmax", 1.0, "Most reference of active power"),
    power("Pmin", 0.0, "Least reference of active power"),
    seconds("Tg", 0.1, "Lag of the reference of active power; 0 leaves it out"),
    power("Ddn", 0.0, "Active power by frequency above rated", 0),
    power("Dup", 0.0, "Active power by frequency below rated", 0),
    seconds("T_f", 0.04, "Filter of the bus frequency; PSS/E's own, no field of REPCA1", 1e-3),
)

SWITCHES: Mapping[str, str] = {
    "VCFlag": "Rc and Xc compensate; else Kc",
    "RefFlag": "The voltage is controlled; else the reactive power",
    "Fflag": "Active power is controlled, with frequency; else its reference is constant",
}


LEAST_LAG = 1e-3
"""Least lag [s] of what is measured elsewhere: no output follows an input at once."""


@dataclass(frozen=True)
class Measured:
    """Voltage [pu] and power [pu, S_n] at the measured point, and the operating point's."""

    v: Expr
    P: Expr
    Q: Expr
    v_0: Scalar
    P_0: Scalar
    Q_0: Scalar
    has_inputs: bool = False

    def filter(self, m: ModelBuilder, name: str, u: Expr, T: Expr, *, initial: Scalar) -> Expr:
        """Return a signal behind its lag; what comes from the network keeps one of `LEAST_LAG`."""
        if self.has_inputs:
            return low_pass(m, name, u, fmax(T, LEAST_LAG), initial)
        return low_pass_or_nothing(m, name, u, T, initial)


def measured_elsewhere(m: ModelBuilder, current_scale: Expr) -> Measured:
    """Declare the inputs of a point of the network; ``current_scale``: S_n by the base of the system."""
    v = m.input("v", "pu", "Voltage magnitude at the measured bus", base="bus", start=1.0)
    v_0 = m.parameter("v_0", 1.0, "pu", "Power flow: voltage at the measured bus", base="bus")
    return measured_branch(m, v, v_0, current_scale)


def measured_branch(m: ModelBuilder, v: Expr, v_0: Expr, scale: Expr) -> Measured:
    """Declare the power into a branch beside a measured voltage; ``scale``: S_n by the base of the system."""
    turned = m.switch("reversed", False, "The end that is measured is where p and q leave")
    toward = if_else(turned, -1, 1) / scale
    P, Q = (
        m.input(name, "pu", f"{text} power into the measured branch", base=SYSTEM_BASE) * toward
        for name, text in (("p", "Active"), ("q", "Reactive"))
    )
    P_0, Q_0 = (
        m.parameter(name, 0.0, "pu", f"Power flow: {text} power into it", base=SYSTEM_BASE) * toward
        for name, text in (("p_0", "active"), ("q_0", "reactive"))
    )
    return Measured(v, P, Q, v_0, P_0, Q_0, has_inputs=True)


def plant_references(
    m: ModelBuilder, t: Measured, seen: ExtrapolatedVoltage, omega_b: Expr, start: References
) -> References:
    """Declare the controller; return the references that it sets.

    ``seen``: the terminal's voltage, for its frequency; ``start``: references of the operating point."""
    flags = {name: m.switch(name, False, text) for name, text in SWITCHES.items()}
    p = declared(m, LINES, SOURCE)
    change_Q, change_V, change_P = (
        m.parameter(f"delta_{name}", 0, "pu", f"Change of {name}", base=base, tunable=True)
        for name, base in (("Qref", "S_n"), ("Vref", "bus"), ("Pref", "S_n"))
    )
    regulated, regulated_0 = (
        regulated_voltage(p, flags["VCFlag"], *point)
        for point in ((t.v, t.P, t.Q), (Expr(t.v_0), t.P_0, t.Q_0))
    )
    v = t.filter(m, "V_filtered", regulated, p.Tfltr, initial=regulated_0)
    Q = t.filter(m, "Q_filtered", t.Q, p.Tfltr, initial=t.Q_0)
    error = if_else(flags["RefFlag"], regulated_0 + change_V - v, t.Q_0 + change_Q - Q)
    least, most = _around(m, start.Q, (p.Qmin, p.Qmax), Expr(1.0))
    reactive = reactive_control(m, p, error, Limits(least, most), t.v < p.Vfrz, initial=start.Q)

    measured = t.filter(m, "P_filtered", t.P, p.Tp, initial=t.P_0)
    power_error = t.P_0 + change_P - measured
    power_error += droop(p, 1 - frequency_of(m, seen, omega_b, p.T_f))
    floor, ceiling = _around(m, start.P, (p.Pmin, p.Pmax), flags["Fflag"])
    slow = active_control(
        m, p, power_error, Limits(floor, ceiling), flags["Fflag"], initial=start.P
    )
    return References(if_else(flags["Fflag"], slow, start.P + change_P), reactive)


@dataclass(frozen=True)
class Limits:
    """Least and most output of a control."""

    low: Expr
    high: Expr


def reactive_control(
    m: ModelBuilder, p: Given, error: Expr, limits: Limits, frozen: Expr, *, initial: Scalar
) -> Expr:
    """Declare what turns an error of reactive power or voltage into a reference; ``initial``: of its output."""
    limited = clamp(dead_band(error, p.dbd1, p.dbd2), p.emin, p.emax)
    how = Controller(p.Kp, p.Ki, limits.low, limits.high, 1.0, frozen)
    of_voltage = controlled(m, "Q_control", limited, how, initial=initial)
    return lead_lag(m, "lead_lag", of_voltage, p.Tft, p.Tfv, initial)


def droop(p: Given, away: Expr) -> Expr:
    """Active power [pu, S_n] by how far the frequency is below the rated one [pu]."""
    beyond = dead_band(away, p.fdbd1, p.fdbd2)
    return p.Dup * fmax(beyond, 0) + p.Ddn * fmin(beyond, 0)


def active_control(
    m: ModelBuilder, p: Given, error: Expr, limits: Limits, in_use: Expr, *, initial: Scalar
) -> Expr:
    """Declare what turns an error of active power into a reference; ``initial``: of its output."""
    how = Controller(p.Kpg, p.Kig, limits.low, limits.high, in_use, Expr(0.0))
    wanted = controlled(m, "P_control", clamp(error, p.femin, p.femax), how, initial=initial)
    return low_pass_or_nothing(m, "P_reference", wanted, p.Tg, initial)


def _around(
    m: ModelBuilder, start: Expr, limits: tuple[Expr, Expr], counts: Expr
) -> tuple[Expr, Expr]:
    """Limits of a reference; an operating point outside of them is refused where the reference counts."""
    low, high = limits
    for margin, limit, side in ((start - low, low, "below"), (high - start, high, "above")):
        text = f"the operating point asks for a reference {side} {limit.name()}"
        m.require(if_else(counts, margin, 1) + ROUNDING, f"{text}; change it, P_0, Q_0 or v_0")
    return fmin(low, start), fmax(high, start)


def regulated_voltage(p: Given, compensates: Expr, v: Expr, P: Scalar, Q: Scalar) -> Expr:
    """Voltage that is controlled [pu]."""
    current = Phasor(P, -Q) / fmax(v, LEAST_VOLTAGE)  # in the frame of v
    inside = (Phasor(v, 0.0) - Phasor(p.Rc, p.Xc) * current).magnitude()
    return if_else(compensates, inside, v + p.Kc * Q)
