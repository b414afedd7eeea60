"""DER_A's commands of current: power or power factor, support of voltage, droop of frequency, limits.

    reactive:  Q_ref, or P·tan φ (PfFlag), P behind Tp → / v → 1/(1+s·Tiq)
               + Kqv·(Vref0 − v) beyond dbd1…dbd2, within Iql1…Iqh1
    active:    FreqFlag: P_ref − P behind Tp, + Ddn·(1 − f) or Dup·(1 − f) beyond fdbd1…fdbd2 → femin…femax
               → Kpg + Kig/s within Pmin…Pmax; else P_ref
               → by dPmin…dPmax → 1/(1+s·Tpord) within Pmin…Pmax → / v
    limits:    I_p² + I_q² ≤ Imax², PQFlag says which comes first; GenFlag: I_p ≥ 0, else −I_p alike (storage)

v is the terminal voltage behind Trv, f the frequency behind Trf. Ddn acts above rated frequency, Dup below.

Source: WECC's specification of DER_A (P. Pourbeik, 2019)."""

from collections.abc import Mapping
from dataclasses import dataclass

from fmus.converter_parts.bus_voltage import LEAST_VOLTAGE
from fmus.synchronous_generator.data_lines import Given, declared, number, power, pu, seconds
from fmus.toolchain.blocks import BYPASS_TIME, clamp, held_at_limits, low_pass_or_nothing
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, fabs, fmax, fmin, if_else, sqrt
from fmus.wecc_renewable.signals import (
    ROUNDING,
    Controller,
    controlled,
    dead_band,
)

SOURCE = "NERC, Parameterization of the DER_A Model (2019), mixture of old and new inverters"

LINES = (
    seconds("Trv", 0.02, "Filter of the terminal voltage; 0 leaves it out"),
    seconds("Trf", 0.02, "Filter of the frequency", 1e-3),
    pu("dbd1", -99.0, "Lower end of the dead band of Kqv; at most 0", base="bus"),
    pu("dbd2", 99.0, "Upper end of the dead band of Kqv; at least 0", 0.0, base="bus"),
    power("Kqv", 0.0, "Reactive current by voltage beyond the dead band", 0),
    pu("Vref0", 0.0, "Voltage reference of Kqv; 0: that of the operating point", 0.0, base="bus"),
    seconds("Tp", 0.02, "Filter of the active power; 0 leaves it out"),
    seconds("Tiq", 0.02, "Lag of the reactive current; 0 leaves it out"),
    power("Ddn", 0.0, "Active power by frequency above rated", 0),
    power("Dup", 0.0, "Active power by frequency below rated", 0),
    pu("fdbd1", -99.0, "Lower end of the dead band of 1 − f; at most 0", base="f_n"),
    pu("fdbd2", 99.0, "Upper end of the dead band of 1 − f; at least 0", 0.0, base="f_n"),
    power("femax", 99.0, "Most error of active power"),
    power("femin", -99.0, "Least error of active power"),
    power("Pmax", 1.0, "Most active power"),
    power("Pmin", 0.0, "Least active power"),
    number("dPmax", 99.0, "Largest rate of the active power", 0, "pu/s"),
    number("dPmin", -99.0, "Least rate of the active power", None, "pu/s"),
    seconds("Tpord", 0.02, "Lag of the active power; 0 leaves it out"),
    power("Kpg", 0.1, "Proportional gain of active power", 0),
    number("Kig", 10.0, "Integral gain of active power", 0, "1/s"),
    power("Imax", 1.2, "Most current", 1e-3),
    pu("vl0", 0.44, "Voltage at which low voltage leaves none", 0.0, base="bus"),
    pu("vl1", 0.49, "Voltage below which low voltage takes a share away", 0.0, base="bus"),
    pu("vh0", 1.2, "Voltage at which high voltage leaves none", 0.0, base="bus"),
    pu("vh1", 1.15, "Voltage above which high voltage takes a share away", 0.0, base="bus"),
    seconds("tvl0", 0.16, "Time below vl0 after which all is lost"),
    seconds("tvl1", 0.16, "Time below vl1 after which what is lost stays so"),
    seconds("tvh0", 0.16, "Time above vh0 after which all is lost"),
    seconds("tvh1", 0.16, "Time above vh1 after which what is lost stays so"),
    number("Vrfrac", 1.0, "Share of the lost that comes back with the voltage", 0),
    number("fltrp", 59.3, "Frequency below which all is lost", 0, "Hz"),
    number("fhtrp", 60.5, "Frequency above which all is lost", 0, "Hz"),
    seconds("tfl", 0.16, "Time below fltrp after which it is"),
    seconds("tfh", 0.16, "Time above fhtrp after which it is"),
    seconds("Tg", 0.02, "Lag of the current's control", 1e-3),
    number("rrpwr", 2.0, "Largest rate at which the active current rises again", 0, "pu/s"),
    seconds("Tv", 0.02, "Lag of the share that trips leave", 1e-3),
    pu("Vpr", 0.8, "Voltage below which frequency trips nothing", 0.0, base="bus"),
    power("Iqh1", 1.0, "Most reactive current of Kqv"),
    power("Iql1", -1.0, "Least reactive current of Kqv"),
)

SWITCHES: Mapping[str, tuple[bool, str]] = {
    "PfFlag": (True, "The power factor is held; else the reactive power"),
    "FreqFlag": (False, "The power answers to the frequency; else it follows its reference"),
    "PQFlag": (False, "Active current comes first; else reactive current"),
    "GenFlag": (True, "It feeds alone, and draws no power; else it is a storage"),
    "VtripFlag": (True, "Voltage trips a share"),
    "FtripFlag": (False, "Frequency trips all"),
}


@dataclass(frozen=True)
class Seen:
    """Signals that the control sees: voltage's size, frequency, active power [pu], and the operating point.

    ``active_0``, ``reactive_0``: currents at the operating point [pu, S_n]; ``references``: changes of the references
    of active and reactive power [pu, S_n]."""

    v: Expr
    v_0: Expr
    frequency: Expr
    P: Expr
    P_0: Expr
    active_0: Expr
    reactive_0: Expr
    references: tuple[Expr, Expr]


def declare_flags(m: ModelBuilder) -> Mapping[str, Expr]:
    """Declare the record's flags, by name."""
    return {name: m.switch(name, start, text) for name, (start, text) in SWITCHES.items()}


def commands(
    m: ModelBuilder, p: Given, flags: Mapping[str, Expr], seen: Seen
) -> tuple[Expr, Expr, Expr]:
    """Declare the control; return its commands of active and reactive current [pu, S_n], and the filtered voltage."""
    v = low_pass_or_nothing(m, "V_filtered", seen.v, p.Trv, seen.v_0)
    divisor = fmax(v, LEAST_VOLTAGE)
    measured = low_pass_or_nothing(m, "P_filtered", seen.P, p.Tp, seen.P_0)
    extra_0, extra = (_extra(p, at, seen.v_0) for at in (seen.v_0, v))
    Q_0 = (seen.reactive_0 - extra_0) * seen.v_0
    has_power = fabs(seen.P_0) > ROUNDING
    of_factor = if_else(has_power, Q_0 / if_else(has_power, seen.P_0, 1) * measured, Q_0)
    asked = if_else(flags["PfFlag"], of_factor, Q_0) + seen.references[1]
    lagged = low_pass_or_nothing(m, "I_q_reference", asked / divisor, p.Tiq, Q_0 / seen.v_0)
    power_asked = _power(m, p, flags["FreqFlag"], seen, measured)
    free_p, free_q = power_asked / divisor, lagged + extra
    first, generates = flags["PQFlag"], flags["GenFlag"]
    alone_p = clamp(free_p, if_else(generates, 0, -p.Imax), p.Imax)
    alone_q = clamp(free_q, -p.Imax, p.Imax)
    rest_p, rest_q = (sqrt(fmax(p.Imax**2 - used**2, 1e-12)) for used in (alone_q, alone_p))
    most_p, most_q = if_else(first, p.Imax, rest_p), if_else(first, rest_q, p.Imax)
    _require_within(m, p, flags, seen)
    active = clamp(free_p, if_else(generates, 0, -most_p), most_p)
    return active, clamp(free_q, -most_q, most_q), v


def _extra(p: Given, v: Expr, v_0: Expr) -> Expr:
    """Reactive current of Kqv at a voltage [pu, S_n]."""
    reference = if_else(p.Vref0 > 0, p.Vref0, v_0)
    return clamp(p.Kqv * dead_band(reference - v, p.dbd1, p.dbd2), p.Iql1, p.Iqh1)


def _power(m: ModelBuilder, p: Given, by_frequency: Expr, seen: Seen, measured: Expr) -> Expr:
    """Active power that is asked for, behind its rates, limits and lag [pu, S_n]."""
    beyond = dead_band(1 - seen.frequency, p.fdbd1, p.fdbd2)
    droop = p.Dup * fmax(beyond, 0) + p.Ddn * fmin(beyond, 0)
    reference = seen.P_0 + seen.references[0]
    error = clamp(reference - measured + droop, p.femin, p.femax)
    least, most = fmin(p.Pmin, seen.P_0), fmax(p.Pmax, seen.P_0)
    how = Controller(p.Kpg, p.Kig, least, most, by_frequency, Expr(0.0))
    of_control = controlled(m, "P_control", error, how, initial=seen.P_0)
    wanted = if_else(by_frequency, of_control, reference)
    x = m.state("P_ord", seen.P_0, "pu", "Active power that is asked for", base="S_n")
    left_out = p.Tpord <= 0
    rate = clamp((wanted - x) / if_else(left_out, BYPASS_TIME, p.Tpord), p.dPmin, p.dPmax)
    m.derivative(x, held_at_limits(x, rate, least, most))
    return clamp(if_else(left_out, wanted, x), least, most)


def _require_within(m: ModelBuilder, p: Given, flags: Mapping[str, Expr], seen: Seen) -> None:
    """Refuse an operating point beyond a limit, or at which a share is tripped."""
    current = sqrt(seen.active_0**2 + seen.reactive_0**2)
    generates, trips = flags["GenFlag"], flags["VtripFlag"]
    for margin, text in (
        (
            p.Pmax - seen.P_0,
            "the power flow asks for more active power than Pmax: lower P_0, or raise Pmax",
        ),
        (
            seen.P_0 - p.Pmin,
            "the power flow asks for less active power than Pmin: raise P_0, or lower Pmin",
        ),
        (
            p.Imax - current,
            "P_0 and Q_0 ask for more than Imax at v_0: raise S_n or Imax, or lower them",
        ),
        (
            if_else(generates, seen.P_0, 1),
            "P_0 draws power, and GenFlag says that it generates: raise P_0, or set GenFlag = false",
        ),
        (
            if_else(trips, seen.v_0 - p.vl1, 1),
            "v_0 lies below vl1, where a share is off: raise v_0, or lower vl1",
        ),
        (
            if_else(trips, p.vh1 - seen.v_0, 1),
            "v_0 lies above vh1, where a share is off: lower v_0, or raise vh1",
        ),
    ):
        m.require(margin + ROUNDING, text)


def declare_parameters(m: ModelBuilder) -> Given:
    """Declare the record's numbers."""
    return declared(m, LINES, SOURCE)
