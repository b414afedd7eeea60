"""WT4G1 and WT4E1: the first generic model of a wind turbine of type 4, behind a full converter.

    WT4G1: I_pcmd → 1/(1 + s·TIPcmd), rising by RIp_LVPL at most, below LVPL(v behind T_LVPL) → × gain(v), 0 at 0.4 pu
           and 1 at 0.8 pu = I_p;  I_qcmd → 1/(1 + s·TIQcmd) = I_q, of whose power v·I_q what the voltage exceeds VHVRCR
           by is taken off, down to −CURHVRCR
    WT4E1, reactive: as WT3E1 (Xc = 0) up to the voltage's reference, less v → KVi/s = I_qcmd, within ±IQMAX
    WT4E1, active: P behind T_POWER, less P_ref, less s·Kf/(1 + s·Tf) of the sum → Kpp + KIP/s within dPMN…dPMX = sum;
           P_ref less the sum = P_ord → / v, at most IPMAX = I_pcmd
    limiter: Iqmxv = 1.6 at 0 pu … QMX at 1 pu and above; PQFLAG = 0: IQMAX = least of Iqmxv, Iqhl and ImaxTD, and I_p
           by Iphl and what I_q leaves of ImaxTD; 1: I_p by Iphl and ImaxTD, and IQMAX what I_p leaves

Sources: PSS/E's diagrams as OPAL-RT's ephasorsim-modelica-library shows them, with its equations of the limiters;
InterPSS' `Wt4g1Model` and `Wt4e1Model`, and its trace of PSS/E."""

from fmus.converter_parts.bus_voltage import LEAST_VOLTAGE
from fmus.synchronous_generator.data_lines import Given, declared, number, power, pu, seconds
from fmus.toolchain.blocks import BYPASS_TIME, clamp, held_at_limits, low_pass_or_nothing
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, Scalar, fmax, fmin, if_else, sqrt
from fmus.wecc_renewable.converters import Regca1
from fmus.wecc_renewable.injection import UNLIMITED, Injection, Lag, allowed_by_voltage
from fmus.wecc_renewable.signals import ROUNDING, Terminal, through_points
from fmus.wecc_renewable.type_3 import voltage_asked

SOURCE = "example of OpenIPSL for PSS/E"

GAIN = ((0.4, 0.0), (0.8, 1.0))
"""Share of the active current that is fed, by voltage [pu], a constant of the record."""

CURRENT_AT_NO_VOLTAGE = 1.6
"""Reactive current [pu] that the limiter allows at a voltage of 0, a constant of the record."""

CONVERTER = (
    seconds("TIQcmd", 0.02, "Lag of the reactive current", 1e-3),
    seconds("TIPcmd", 0.02, "Lag of the active current", 1e-3),
    pu("VLVPL1", 0.4, "Voltage at which LVPL leaves no active current", base="bus"),
    pu("VLVPL2", 0.9, "Voltage below which LVPL limits the active current", base="bus"),
    power("GLVPL", 1.11, "Active current that LVPL leaves at VLVPL2", 0),
    pu("VHVRCR", 1.2, "Voltage above which reactive power is taken off", base="bus"),
    power("CURHVRCR", 2.0, "Most reactive power that is taken up above VHVRCR", 0),
    number("RIp_LVPL", 2.0, "Largest rate at which the active current rises", 0, "pu/s"),
    seconds("T_LVPL", 0.02, "Filter of the voltage that LVPL sees; 0 leaves it out"),
)
CONTROL = (
    number("PFAFLG", 0.0, "1: constant power factor, where VARFLG is 0", 0),
    number("VARFLG", 1.0, "1: voltage; 0: reactive power or power factor", 0),
    number("PQFLAG", 0.0, "1: active current first; 0: reactive current first", 0),
    seconds("Tfv", 0.15, "Filter of the voltage's regulator; 0 leaves it out"),
    number("KPV", 18.0, "Proportional gain of the voltage", 0),
    number("KIV", 5.0, "Integral gain of the voltage", 0, "1/s"),
    number("Kpp", 0.05, "Proportional gain of the power", 0),
    number("KIP", 0.15, "Integral gain of the power", 0, "1/s"),
    number("Kf", 0.0, "Gain of the rate feedback", 0, "s"),
    seconds("Tf", 0.08, "Lag of the rate feedback; 0 leaves it out"),
    power("QMX", 0.48, "Most reactive power"),
    power("QMN", -0.47, "Least reactive power"),
    power("IPMAX", 1.1, "Most active current", 1e-3),
    seconds("TRV", 0.1, "Filter of the voltage; 0 leaves it out"),
    power("dPMX", 0.5, "Most that the power's control takes off"),
    power("dPMN", -0.5, "Least that the power's control takes off"),
    seconds("T_POWER", 0.05, "Filter of the power; 0 leaves it out"),
    number("KQi", 0.15, "Voltage by reactive power, integral", 0, "1/s"),
    pu("VMINCL", 0.9, "Least reference of the voltage", base="bus"),
    pu("VMAXCL", 1.1, "Most reference of the voltage", base="bus"),
    number("KVi", 120.0, "Reactive current by voltage, integral", 1e-3, "1/s"),
    seconds("Tv", 0.05, "Lag of the voltage's proportional part; 0 leaves it out"),
    seconds("Tp", 0.05, "Filter of the power for the power factor; 0 leaves it out"),
    power("ImaxTD", 1.7, "Most current of the converter", 1e-3),
    power("Iphl", 1.11, "Hard limit of the active current", 1e-3),
    power("Iqhl", 1.11, "Hard limit of the reactive current", 1e-3),
)


def declare_currents(m: ModelBuilder, v: Expr, v_0: Expr, P_0: Scalar, Q_0: Scalar) -> Injection:
    """Declare WT4G1 behind the terminal voltage [pu]; P_0, Q_0: of the operating point [pu, S_n]."""
    p = declared(m, CONVERTER, SOURCE)
    m.require(p.VLVPL2 - p.VLVPL1 + ROUNDING, "VLVPL2 must not lie below VLVPL1")
    m.require(v_0 - GAIN[0][0], "v_0: below 0.4 pu there is no active current; raise v_0")
    active_0 = P_0 / v_0 / through_points(v_0, GAIN)
    reactive_0 = (Q_0 + fmax(v_0 - p.VHVRCR, 0)) / v_0
    seen = low_pass_or_nothing(m, "lvpl_voltage", v, p.T_LVPL, v_0)
    allowed, allowed_0 = (
        allowed_by_voltage(p.VLVPL1, p.VLVPL2, p.GLVPL, voltage) for voltage in (seen, v_0)
    )
    m.require(
        allowed_0 - active_0 + ROUNDING,
        "the power flow asks for more active current than LVPL allows at v_0: raise v_0, or GLVPL",
    )
    active = m.state("I_p", active_0, "pu", "Active current behind its lag", base="S_n")
    reactive = m.state("I_q", reactive_0, "pu", "Reactive current behind its lag", base="S_n")
    left = fmax(reactive * v - (v - p.VHVRCR), -p.CURHVRCR) / fmax(v, LEAST_VOLTAGE)
    return Injection(
        clamp(active, -UNLIMITED, allowed) * through_points(v, GAIN),
        if_else(v > p.VHVRCR, left, reactive),
        active_0,
        reactive_0,
        (
            Lag(active, p.TIPcmd, (-UNLIMITED, fmin(p.RIp_LVPL, UNLIMITED)), allowed),
            Lag(reactive, p.TIQcmd, (-UNLIMITED, UNLIMITED)),
        ),
    )


class Wt4g1(Regca1):
    """WT4G1: a current at the angle of the terminal voltage."""

    _injection_of = staticmethod(declare_currents)


def commands(m: ModelBuilder, t: Terminal, converter: Wt4g1) -> tuple[Expr, Expr]:
    """Declare WT4E1, and return the commands of active and of reactive current [pu, S_n]."""
    p = declared(m, CONTROL, SOURCE)
    v = fmax(t.size, LEAST_VOLTAGE)
    order = _order_of_power(m, t, p)
    target = voltage_asked(
        m,
        t,
        p,
        (t.size, t.size_0),
        by_voltage=p.VARFLG > 0,
        by_angle=p.PFAFLG > 0,
    )
    start = converter.reactive_0
    reactive = m.state("I_q_asked", start, "pu", "Integral of the voltage's error", base="S_n")
    hard = fmin(fmin(p.IPMAX, p.Iphl), p.ImaxTD)

    def limits(size: Expr, active: Expr, reactive: Expr) -> tuple[Expr, Expr]:
        """Most active and most reactive current."""
        by_voltage = p.QMX + (CURRENT_AT_NO_VOLTAGE - p.QMX) * fmax(1 - size, 0)
        most = fmin(fmin(by_voltage, p.Iqhl), p.ImaxTD)
        first = clamp(active, -hard, hard)
        beside = fmin(most, _rest(p.ImaxTD, first))
        high = if_else(p.PQFLAG > 0, beside, most)
        of_active = fmin(hard, _rest(p.ImaxTD, clamp(reactive, -high, high)))
        return if_else(p.PQFLAG > 0, hard, of_active), high

    most_0, high_0 = limits(t.size_0, converter.active_0, start)
    for margin in (high_0 - start, high_0 + start, most_0 - converter.active_0):
        m.require(
            margin + ROUNDING,
            "the power flow asks for more current than electrical.IPMAX, Iphl, Iqhl, ImaxTD and QMX leave",
        )
    asked = order / v
    most, high = limits(t.size, asked, reactive)
    m.derivative(reactive, held_at_limits(reactive, p.KVi * (target - t.size), -high, high))
    return fmin(asked, most), clamp(reactive, -high, high)


def _order_of_power(m: ModelBuilder, t: Terminal, p: Given) -> Expr:
    """The order of power [pu, S_n]."""
    change = m.parameter(
        "delta_Pref", 0.0, "pu", "Change of the power's reference", base="S_n", tunable=True
    )
    reference = t.P_0 + change
    error = low_pass_or_nothing(m, "P_filtered", t.P, p.T_POWER, t.P_0) - reference
    slow = m.state("power_integral", 0.0, "pu", "Integral of the power", base="S_n")
    fed_back = m.state("power_fed_back", 0.0, "pu", "Slow part of the sum", base="S_n")
    has_feedback = p.Tf > 0
    lag = if_else(has_feedback, p.Tf, BYPASS_TIME)
    gain = if_else(has_feedback, p.Kf / lag, 0)
    free = slow + p.Kpp * (error - gain * (slow - fed_back)) / (1 + p.Kpp * gain)
    taken = clamp(free, p.dPMN, p.dPMX)
    m.derivative(fed_back, (taken - fed_back) / lag)
    rate = p.KIP * (error - gain * (taken - fed_back))
    m.derivative(slow, if_else(p.KIP > 0, rate, -slow / BYPASS_TIME))
    return reference - taken


def _rest(most: Expr, taken: Expr) -> Expr:
    """Return the part of the most current that one part leaves."""
    return sqrt(fmax(most**2 - taken**2, 1e-9))
