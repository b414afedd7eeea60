"""WECC's SVSMO1, PSS/E's SVSMO1T2 and SVSMO1T3: a static var system of thyristors at a switched shunt.

    v → (1+sT_c1)/(1+sT_b1) → v_m
    V_ref + slow − v_m − X_c·B·v = e → deadband → within V_emin and V_emax → (1+sT_c2)/(1+sT_b2)
      → K_pv + K_iv/s, within B_min and B_max → 1/(1+sT_2) → B        [pu, S_n]

    deadband    the regulator rests while |e| ≤ V_dbd1; it acts from there on until |e| < V_dbd2 for T_dbd
    rating      above B_max up to B_shrt for T_shrt, then B_max
    slope       X_c1; with Flag2 = 1 X_c1 above V_up, X_c3 below V_low, X_c2 between
    slow        B above B_scs or below B_sis: (B_scs − eps − B) or (B_sis + eps − B) → K_ps + K_is/s, within V_rmin and
                V_rmax; V_ref + slow stays within V_refmin and V_refmax

At the start B follows from the power flow, and V_ref from B; V_refmin and V_refmax then give way to V_ref, as
PowerWorld has it. Mechanically switched shunts, and the strategy at low and high voltage (UV_1 to OV_tm2, PLL_delay)
with its trips, are left out.

Sources: P. Pourbeik et al., "Generic Model Structures for Simulating Static Var Systems in Power System Studies" (IEEE
Transactions on Power Systems, 2012); PowerWorld's guide; the order of the fields and the regulator as InterPSS has
them (`Svsmo1t2Model`)."""

from dataclasses import dataclass

from fmus.static_var.held_bus import HeldVoltage, holds_elsewhere
from fmus.static_var.susceptance import MOST_POWER, initial_susceptance, susceptance_model
from fmus.toolchain.blocks import (
    BYPASS_TIME,
    RETURN_TIME,
    clamp,
    close_limited_low_pass,
    lead_lag,
    limited_proportional_integral,
)
from fmus.toolchain.frames import Phasor
from fmus.toolchain.model import Model
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.port import DevicePort
from fmus.toolchain.symbols import Expr, fabs, fmax, fmin, if_else, logic_and, logic_or

SOURCE = "InterPSS' test of SVSMO1T2"

S_N = 100.0
"""Default rating [MVA]: PSS/E's system base, on which the susceptances are."""

ACTING = 0.5
"""Value of the latch of the deadband above which the regulator acts; at rest it is 0."""

LEAST_LIMIT = 1e-9
"""Distance of both limits of the regulator [pu, S_n]: a sign of a file that has none must not turn them around."""


def svsmo1_phasor(records: str = "SVSMO1T2") -> Model:
    """The static var system, phasor type.

    Parameters
    ----------
    records
        PSS/E's name of its record, SVSMO1T2 or SVSMO1T3; behind it the word ``elsewhere`` if it holds another bus'
        voltage.

    Raises
    ------
    ValueError
        If it is none of these.
    """
    elsewhere = holds_elsewhere(records, ("SVSMO1T2", "SVSMO1T3"))
    title = "Static var system SVSMO1 of WECC (phasor type)"
    return susceptance_model("svsmo1_phasor", title, S_N, _susceptance, elsewhere=elsewhere)


@dataclass(frozen=True)
class _Numbers:
    """Declares parameters of the model, with their units."""

    m: ModelBuilder

    def seconds(self, name: str, start: float, text: str) -> Expr:
        return self.m.parameter(name, start, "s", text, minimum=0, source=SOURCE)

    def voltage(self, name: str, start: float, text: str, least: float | None = None) -> Expr:
        return self.m.parameter(name, start, "pu", text, base="bus", minimum=least, source=SOURCE)

    def susceptance(self, name: str, start: float, text: str) -> Expr:
        return self.m.parameter(name, start, "pu", text, base="S_n", source=SOURCE)

    def reactive(self, name: str, start: float, text: str) -> Expr:
        return self.m.parameter(name, start, "Mvar", text, source=SOURCE)

    def gain(self, name: str, start: float, unit: str, text: str) -> Expr:
        base = "S_n" if unit == "pu" else ""
        return self.m.parameter(name, start, unit, text, base=base, minimum=0, source=SOURCE)


def _susceptance(
    m: ModelBuilder, port: DevicePort, rating: Expr, v: Phasor, held: HeldVoltage
) -> Expr:
    """The susceptance [pu, S_n] at a bus voltage [pu]."""
    p = _Numbers(m)
    size, size_0 = v.magnitude(), port.v_0.magnitude()
    B_0 = initial_susceptance(m, port)
    T_lead = p.seconds("Tc1", 0.0, "Lead of the measurement")
    T_lag = p.seconds("Tb1", 0.012, "Lag of the measurement; 0 leaves it out")
    measured = lead_lag(m, "measured", held.now, T_lead, T_lag, held.start)
    slope, slope_0 = _slopes(m, p, held.now, held.start)
    T_firing = p.seconds("T2", 0.012, "Lag of the firing; 0 leaves it out")
    limits = _limits(m, p, B_0)
    B = m.state("susceptance", B_0, "pu", "first-order lag with limits", base="S_n")
    slow, slow_0 = _slow_control(m, p, B, B_0, rating)
    drop_0 = slope_0 * B_0 * size_0
    text = "Voltage reference, without the slow control's part"
    reference = m.calculated("Vref", held.start + drop_0 - slow_0, "pu", text, base="bus")
    lowest = fmin(p.voltage("Vrefmin", 0.8, "Lowest reference", 0), reference + slow_0)
    highest = fmax(p.voltage("Vrefmax", 1.2, "Highest reference", 0), reference + slow_0)
    raw = clamp(reference + slow, lowest, highest) - measured - slope * B * size
    error = _behind_deadband(m, p, raw)
    return _regulated(m, p, error, B, T_firing, limits)


@dataclass(frozen=True)
class _Limits:
    """Susceptances between which the regulator acts [pu, S_n], and the time above the continuous one [s]."""

    low: Expr
    continuous: Expr
    short: Expr
    time: Expr
    initial: Expr


def _limits(m: ModelBuilder, p: _Numbers, B_0: Expr) -> _Limits:
    B_short = p.susceptance("Bshrt", 1.1, "Largest susceptance for a short time")
    B_max = p.susceptance("Bmax", 0.95, "Largest susceptance")
    B_min = p.susceptance("Bmin", -0.3, "Smallest susceptance")
    time = p.seconds("Tshrt", 0.35, "Time above Bmax")
    text = "the power flow's reactive power asks for a susceptance outside of Bmin to Bmax"
    m.require(B_0 - B_min + MOST_POWER, f"{text}: raise Q_0, or lower Bmin")
    m.require(B_max - B_0 + MOST_POWER, f"{text}: lower Q_0, or raise Bmax")
    continuous = fmax(B_max, B_min + LEAST_LIMIT)
    return _Limits(B_min, continuous, fmax(B_short, continuous), time, B_0)


def _slopes(m: ModelBuilder, p: _Numbers, size: Expr, size_0: Expr) -> tuple[Expr, Expr]:
    """The slope [pu, S_n] at a voltage, and at the start."""
    is_broken = m.parameter(
        "Flag2", False, "1", "The slope changes with the voltage", type="Boolean", source=SOURCE
    )
    first = p.susceptance("Xc1", 0.023, "Slope; with Flag2 that above Vup")
    second = p.susceptance("Xc2", 0.0, "Slope between Vlow and Vup, by Flag2")
    third = p.susceptance("Xc3", 0.0, "Slope below Vlow, by Flag2")
    V_up = p.voltage("Vup", 1.08, "Voltage above which Xc1 is the slope, by Flag2", 0)
    V_low = p.voltage("Vlow", 0.92, "Voltage below which Xc3 is the slope, by Flag2", 0)

    def at(v: Expr) -> Expr:
        below = if_else(v < V_low, third, second)
        return if_else(logic_or(1 - is_broken, v >= V_up), first, below)

    return at(size), at(size_0)


def _behind_deadband(m: ModelBuilder, p: _Numbers, raw: Expr) -> Expr:
    """The error that the regulator sees; 0 while it rests."""
    outer = p.voltage("Vdbd1", 0.0, "Error from which on the regulator acts; 0: always", 0)
    inner = p.voltage("Vdbd2", 0.0, "Error below which it rests again after Tdbd", 0)
    wait = p.seconds("Tdbd", 0.0, "Time below Vdbd2 after which it rests")
    high = p.voltage("Vemax", 0.45, "Largest error")
    low = p.voltage("Vemin", -0.45, "Smallest error")
    with m.scope("deadband"):
        latch = m.state("latch", 0.0, "1", "The regulator acts; it holds above 0.5")
        acts = latch > ACTING
        is_near = logic_and(acts, fabs(raw) < inner)
        near = m.state("near", 0.0, "s", "Time below Vdbd2")
        m.derivative(near, if_else(is_near, 1, -near / BYPASS_TIME))
        rests = logic_and(is_near, near >= wait)
        goes_on = logic_or(fabs(raw) > outer, logic_and(acts, 1 - rests))
        target = if_else(logic_and(outer > 0, goes_on), 1, 0)
        m.derivative(latch, (target - latch) / RETURN_TIME)
    seen = if_else(logic_or(outer <= 0, acts), raw, 0)
    return clamp(seen, low, high)


def _regulated(
    m: ModelBuilder, p: _Numbers, error: Expr, B: Expr, T_firing: Expr, limits: _Limits
) -> Expr:
    """The susceptance behind the regulator and the firing; its state is declared already."""
    T_lead = p.seconds("Tc2", 0.0, "Lead of the transient gain")
    T_lag = p.seconds("Tb2", 0.0, "Lag of the transient gain; 0 leaves the stage out")
    K_P = p.gain("Kpv", 42.0, "pu", "Proportional gain, susceptance per voltage")
    K_I = p.gain("Kiv", 210.0, "1/s", "Integral gain, susceptance per voltage and second")
    reduced = lead_lag(m, "gain", error, T_lead, T_lag)
    x = m.state("regulator", limits.initial, "pu", "integrator with limits", base="S_n")
    wanted = K_P * reduced + x
    above = wanted > limits.continuous
    time = m.state("above", 0.0, "s", "Time for which more than Bmax is asked for")
    m.derivative(time, if_else(above, 1, -time / BYPASS_TIME))
    late = logic_and(above, time >= limits.time)
    high = if_else(late, limits.continuous, limits.short)
    outward = logic_or(
        logic_and(wanted > high, reduced > 0), logic_and(wanted < limits.low, reduced < 0)
    )
    m.derivative(x, if_else(outward, 0, K_I * reduced))
    asked = clamp(wanted, limits.low, high)
    return close_limited_low_pass(m, B, asked, T_firing, limits.low, high)


def _slow_control(
    m: ModelBuilder, p: _Numbers, B: Expr, B_0: Expr, rating: Expr
) -> tuple[Expr, Expr]:
    """Return the slow control's part of the reference [pu], and that at the start."""
    K_P = p.gain("Kps", 0.0, "pu", "Proportional gain of the slow control, voltage per susceptance")
    K_I = p.gain("Kis", 0.0, "1/s", "Integral gain of the slow control")
    high = p.voltage("Vrmax", 0.0, "Largest part of the slow control in the reference")
    low = p.voltage("Vrmin", 0.0, "Smallest part of the slow control in the reference")
    margin = p.reactive("Eps", 0.4, "What the slow control adds beyond an end of its band") / rating
    above = p.reactive("Bscs", 19.0, "Upper end of the slow control's band") / rating
    below = p.reactive("Bsis", -18.0, "Lower end of the slow control's band") / rating

    def missing(at: Expr) -> Expr:
        too_low = if_else(at < below, below + margin - at, 0)
        return if_else(at > above, above - margin - at, too_low)

    start = clamp(K_P * missing(B_0), low, high)
    with m.scope("slow"):
        slow = limited_proportional_integral(
            m, "integrator", missing(B), K_P, K_I, low=low, high=high, initial=0
        )
    return slow, start
