"""REGCA1: a controlled current at the angle of the terminal voltage, with limits for low and high voltages.

    I_pcmd → 1/(1+s·Tg), rising by Rrpwr at most, below LVPL(v filtered) → × gain(v) → I_p
    I_qcmd → 1/(1+s·Tg), by Iqrmax or Iqrmin at most → − Khv·(v − Volim) above Volim, down to Iolim → I_q

I_q above 0 feeds reactive power. Iqrmax holds where the power flow's Q is above 0, Iqrmin where it is below.

Sources: WECC, "Solar Plant Dynamic Modeling Guidelines" (2014) and its specification of REGC_A (EPRI, 2013)."""

from dataclasses import dataclass

from fmus.synchronous_generator.data_lines import declared, number, power, pu, seconds
from fmus.toolchain.blocks import clamp, held_at_limits, low_pass_or_nothing, reached
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, Scalar, fmax, fmin, if_else, logic_and
from fmus.wecc_renewable.signals import ROUNDING, SOURCE, through_points

UNLIMITED = 1e4
"""Current [pu] that stands for none of a limit: far above what any converter feeds."""

LINES = (
    seconds("Tg", 0.02, "Lag of the current's control", 1e-3),
    number("Rrpwr", 10.0, "Largest rate at which the active current rises", 0, "pu/s"),
    pu("Brkpt", 0.9, "Voltage below which LVPL limits the active current", base="bus"),
    pu("Zerox", 0.4, "Voltage at which LVPL leaves no active current", base="bus"),
    power("Lvpl1", 1.22, "Active current that LVPL leaves at Brkpt", 0),
    pu("Volim", 1.2, "Voltage above which reactive current is taken off", base="bus"),
    pu("Lvpnt1", 0.9, "Voltage below which the active current falls", base="bus"),
    pu("Lvpnt0", 0.5, "Voltage at which no active current is left", base="bus"),
    power("Iolim", -1.3, "Least reactive current above Volim; below 0"),
    seconds("Tfltr", 0.02, "Filter of the voltage that LVPL sees; 0 leaves it out"),
    power("Khv", 0.0, "Reactive current taken off by voltage above Volim", 0),
    number("Iqrmax", 100.0, "Largest rate of the reactive current where Q_0 > 0", 0, "pu/s"),
    number("Iqrmin", -100.0, "Least rate of the reactive current where Q_0 < 0", None, "pu/s"),
)


@dataclass(frozen=True)
class Injection:
    """The current source: what it feeds, and its commands at the operating point [pu, S_n].

    ``lags``: active and reactive current behind Tg, and how fast and how far each goes."""

    active: Expr
    reactive: Expr
    active_0: Expr
    reactive_0: Expr
    lags: tuple["Lag", "Lag"]

    def follow(self, m: ModelBuilder, active: Expr, reactive: Expr) -> None:
        """Let both currents follow their commands [pu, S_n]."""
        for lag, command in zip(self.lags, (active, reactive), strict=True):
            lag.follow(m, command)


@dataclass(frozen=True)
class Lag:
    """A current behind its lag, with the limits of its rate and of itself."""

    x: Expr
    T: Expr
    rates: tuple[Scalar, Scalar]
    high: Scalar = UNLIMITED

    def follow(self, m: ModelBuilder, u: Expr) -> None:
        """Let the current follow its command [pu, S_n]."""
        limits = -UNLIMITED, self.high
        rate = clamp((u - reached(self.x, *limits)) / self.T, *self.rates)
        m.derivative(self.x, held_at_limits(self.x, rate, *limits))


def declare_injection(m: ModelBuilder, v: Expr, v_0: Expr, P_0: Scalar, Q_0: Scalar) -> Injection:
    """Declare REGCA1 behind the terminal voltage [pu]; P_0, Q_0: of the operating point [pu, S_n]."""
    limits_power = m.switch("Lvplsw", True, "LVPL limits the active current at low voltage")
    p = declared(m, LINES, SOURCE)
    for low, high in ((p.Zerox, p.Brkpt), (p.Lvpnt0, p.Lvpnt1)):
        m.require(high - low + ROUNDING, f"{high.name()} must not lie below {low.name()}")
    m.require(v_0 - p.Lvpnt0, "v_0: below Lvpnt0 there is no active current; raise v_0")
    gain_points = ((p.Lvpnt0, 0.0), (p.Lvpnt1, 1.0))
    active_0 = P_0 / v_0 / through_points(v_0, gain_points)
    reactive_0 = Q_0 / v_0 + p.Khv * fmax(v_0 - p.Volim, 0)
    seen = low_pass_or_nothing(m, "lvpl_voltage", v, p.Tfltr, v_0)
    allowed, allowed_0 = (
        if_else(limits_power, allowed_by_voltage(p.Zerox, p.Brkpt, p.Lvpl1, voltage), UNLIMITED)
        for voltage in (seen, v_0)
    )
    m.require(
        allowed_0 - active_0 + ROUNDING,
        "the power flow asks for more active current than LVPL allows at v_0: raise v_0, or Lvpl1",
    )
    active = m.state("I_p", active_0, "pu", "Active current behind its lag", base="S_n")
    reactive = m.state("I_q", reactive_0, "pu", "Reactive current behind its lag", base="S_n")
    rising = if_else(Expr(Q_0) > 0, p.Iqrmax, UNLIMITED)
    falling = if_else(Expr(Q_0) < 0, p.Iqrmin, -UNLIMITED)
    left = fmax(clamp(reactive, -UNLIMITED, UNLIMITED) - p.Khv * fmax(v - p.Volim, 0), p.Iolim)
    return Injection(
        clamp(active, -UNLIMITED, allowed) * through_points(v, gain_points),
        if_else(logic_and(v > p.Volim, p.Khv > 0), left, reactive),
        active_0,
        reactive_0,
        (
            Lag(active, p.Tg, (-UNLIMITED, fmin(p.Rrpwr, UNLIMITED)), allowed),
            Lag(reactive, p.Tg, (falling, rising)),
        ),
    )


def allowed_by_voltage(zero: Expr, full: Expr, at_full: Expr, v: Expr) -> Expr:
    """The active current that LVPL leaves at a voltage [pu, S_n]; above ``full`` it limits nothing."""
    return if_else(v > full, UNLIMITED, through_points(v, ((zero, 0.0), (full, at_full))))
