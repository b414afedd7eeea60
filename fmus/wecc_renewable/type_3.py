"""WT3G1, WT3E1, WT3T1 and WT3P1: the first generic model of a wind turbine of type 3, a doubly fed machine.

    WT3G1: I_pcmd, E_qcmd → 1/(1 + s·0.02) = I_p, E_q;  emf E_q + j·Xeq·I_p behind j·Xeq, in the frame of a PLL:
           Kpll·v_y/ω_b, and Kipll/s of that within ±Pllmax; both together within ±Pllmax = speed of the frame [pu]
    WT3E1, reactive: V_ref − (v − Xc·i) behind TRV → KIV/s, + KPV/(1 + s·Tv) → QMN…QMX → 1/(1 + s·Tfv) (VARFLG = 1);
           P behind Tp times tan φ (−1); constant (0) → QMN…QMX, less Q → KQi/s within VMINCL…VMAXCL, less v → KQV/s
           = E_qcmd, within v + XIQmin…v + XIQmax (VLTFLG = 1) or XIQmin…XIQmax (2)
    WT3E1, active: P → line of speed → 1/(1 + s·T_POWER) = ω_ref;  ω_g − ω_ref → Kpp + KIP/s → × ω_g → 1/(1 + s·TFP),
           by RPMN…RPMX, within PMN…PMX = P_ord → / v, at most IPMAX = I_pcmd
    WT3T1: 2·Ht·ω_t' = P_m/ω_t − T − Dshaft·(ω_t − ω_g);  2·Hg·ω_g' = T + Dshaft·(ω_t − ω_g) − P/ω_g − DAMP·(ω_g − 1);
           T' = K·(ω_t − ω_g), K = 2·Ht·Hg/H·(2π·Freq1)², Ht = Htfrac·H, one mass at 0;  P_m = P_m0 − Kaero·(θ − θ_0)
    WT3P1: ω_g − ω_ref → Kpp + Kip/s, and P_ord − PMX → Kpc + Kic/s, the integral within 0…TetaMax; both together
           → 1/(1 + s·Tp) within TetaMin…TetaMax, by RTetaMax at most = θ

The active part of WT3E1 and WT3P1 are per unit of turbines·Prated, the rest of S_n. At the operating point the pitch is
TetaMin, and linear models keep it there; the integral of WT3P1's speed is Kpc·(PMX − P_ord) then, and its sum TetaMin.

Sources: InterPSS' `Wt3g1Model` to `Wt3p1Model`, and its traces of PSS/E, which show the bases; OpenIPSL at 2be0558a and
STEPS at e5579d20 (WT3G1, WT3E1)."""

from math import pi

from fmus.converter_parts.bus_voltage import LEAST_VOLTAGE, ExtrapolatedVoltage
from fmus.synchronous_generator.data_lines import Given, declared, number, power, pu, seconds
from fmus.toolchain.blocks import (
    BYPASS_TIME,
    RETURN_TIME,
    clamp,
    held_at_limits,
    low_pass_or_nothing,
    reached,
)
from fmus.toolchain.frames import Phasor, polar
from fmus.toolchain.frames import power as power_of
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.phasor_port import MasterStep, SourceEmf, motion
from fmus.toolchain.port import DevicePort
from fmus.toolchain.symbols import Expr, fmax, fmin, if_else, logic_and, logic_or, sqrt
from fmus.wecc_renewable.converters import Converter
from fmus.wecc_renewable.signals import ROUNDING, Terminal, through_points

SOURCE = "example of GridDyn, a wind park of the synthetic grid ACTIVSg25k"
TYPICAL = "typical values of WECC's Wind Plant Dynamic Modeling Guidelines (2014)"

LAG = 0.02
"""Lag of the converter's commands [s], a constant of the record."""

LEAST_SPEED = 0.01
"""Speed [pu] below which no division by it takes place."""

REST = 1e-4
"""Speed [pu] and angle [deg] within which the pitch stays at its stop: more than a linear model's perturbations."""

CONVERTER = (
    number("Kpll", 30.0, "Proportional gain of the PLL", 1e-3, "rad/s"),
    number("Kipll", 0.0, "Integral gain of the PLL, by the proportional part", 0, "1/s"),
    pu("Pllmax", 0.1, "Most speed of the PLL", 1e-3, base="f_n"),
    number("turbines", 0.0, "Number of turbines; 0: their rating is S_n", 0),
    number("Prated", 2.75, "Rated power of one turbine", 0, "MW"),
)
CONTROL = (
    number("VARFLG", 1.0, "1: voltage; 0: reactive power; −1: power factor", -1),
    number("VLTFLG", 1.0, "1: E_q is limited about the voltage; 2: by itself", 1),
    seconds("Tfv", 0.15, "Filter of the voltage's regulator; 0 leaves it out"),
    number("KPV", 18.0, "Proportional gain of the voltage", 0),
    number("KIV", 5.0, "Integral gain of the voltage", 0, "1/s"),
    power("Xc", 0.0, "Reactance behind which the voltage is controlled"),
    seconds("TFP", 0.05, "Lag of the power's order", 1e-3),
    number("Kpp", 3.0, "Proportional gain of the torque", 0),
    number("KIP", 0.6, "Integral gain of the torque", 0, "1/s"),
    pu("PMX", 1.12, "Most power", base="rating"),
    pu("PMN", 0.04, "Least power", base="rating"),
    power("QMX", 0.436, "Most reactive power"),
    power("QMN", -0.436, "Least reactive power"),
    pu("IPMAX", 1.1, "Most active current", 1e-3, base="rating"),
    seconds("TRV", 0.02, "Filter of the voltage; 0 leaves it out"),
    number("RPMX", 0.45, "Largest rate of the power's order", 0, "pu/s"),
    number("RPMN", -0.45, "Least rate of the power's order", None, "pu/s"),
    seconds("T_POWER", 5.0, "Filter of the speed's reference; 0 leaves it out"),
    number("KQi", 0.1, "Voltage by reactive power, integral", 0, "1/s"),
    pu("VMINCL", 0.9, "Least reference of the voltage", base="bus"),
    pu("VMAXCL", 1.1, "Most reference of the voltage", base="bus"),
    number("KQV", 40.0, "Emf by voltage, integral", 1e-3, "1/s"),
    pu("XIQmin", -0.5, "Least emf, less the voltage where VLTFLG is 1", base="bus"),
    pu("XIQmax", 0.4, "Most emf, less the voltage where VLTFLG is 1", base="bus"),
    seconds("Tv", 0.05, "Lag of the voltage's proportional part; 0 leaves it out"),
    seconds("Tp", 0.05, "Filter of the power for the power factor; 0 leaves it out"),
    pu("wPmin", 0.69, "Speed at PMN", 0.01, base="f_n"),
    pu("wP20", 0.78, "Speed at 20 % of the power", 0.01, base="f_n"),
    pu("wP40", 0.98, "Speed at 40 % of the power", 0.01, base="f_n"),
    pu("wP60", 1.12, "Speed at 60 % of the power", 0.01, base="f_n"),
    pu("Pmin", 0.74, "Least power at which the speed is wP100; above 0.6", 0.6, base="rating"),
    pu("wP100", 1.2, "Speed at the rated power", 0.01, base="f_n"),
)
SHAFT = (
    number("H", 4.94, "Inertia constant of turbine and generator", 1e-3, "s"),
    power("DAMP", 0.0, "Torque by the generator's speed away from the rated one"),
    power("Kaero", 0.007, "Power by the pitch angle [pu/deg]", 0),
    number("Htfrac", 0.875, "Share of the turbine in the inertia; 0: one mass", 0),
    number("Freq1", 1.8, "Frequency at which the shaft swings; above 0 with two masses", 0, "Hz"),
    power("Dshaft", 1.5, "Torque by the difference of both speeds", 0),
)
PITCH = (
    seconds("Tp", 0.3, "Lag of the blades; 0 leaves it out"),
    number("Kpp", 150.0, "Proportional gain of the speed", 0),
    number("Kip", 25.0, "Integral gain of the speed", 0, "1/s"),
    number("Kpc", 3.0, "Proportional gain of the power", 0),
    number("Kic", 30.0, "Integral gain of the power", 0, "1/s"),
    number("TetaMin", 0.0, "Least pitch angle", None, "deg"),
    number("TetaMax", 27.0, "Most pitch angle", None, "deg"),
    number("RTetaMax", 10.0, "Largest rate of the pitch angle", 0, "deg/s"),
    pu("PMX", 1.0, "Power above which the pitch rises", base="rating"),
)


def port_of_machine(m: ModelBuilder) -> Phasor:
    """Declare the reactance behind which the emf stands."""
    text = "Reactance between emf and terminal, ZSORCE of the network data"
    X = m.parameter("Xeq", 0.8, "pu", text, base="S_n", minimum=1e-3, source=SOURCE)
    return Phasor(0.0, X)


class Wt3g1(Converter):
    """WT3G1: active current and emf behind a reactance, in the frame of a PLL.

    ``to_turbines``: turbines' rating over S_n, in whose per unit the control is."""

    def __init__(
        self,
        m: ModelBuilder,
        port: DevicePort,
        seen: ExtrapolatedVoltage,
        Z: Phasor,
        rating: Expr,
    ) -> None:
        p = declared(m, CONVERTER, SOURCE)
        self._Z = Z
        s_0, v_0 = power_of(port.v_0, port.i_0), port.v_0.magnitude()
        X = Expr(Z.im)
        self.to_turbines = if_else(p.turbines * p.Prated > 0, p.turbines * p.Prated / rating, 1)
        self.active_0, self.reactive_0 = s_0.re / v_0, v_0 + X * s_0.im / v_0
        self._I_p, self._E_q = (
            m.state(name, start, "pu", f"{text} behind its lag", base=base)
            for name, start, text, base in (
                ("I_p", self.active_0, "Active current", "S_n"),
                ("E_q", self.reactive_0, "Emf", "bus"),
            )
        )
        with m.scope("pll"):
            self._angle = m.state("angle", port.v_0.angle(), "rad", "Angle in the network's frame")
            integral = m.state("integral", 0.0, "pu", "Integral part of its speed", base="f_n")
            self._inside = seen.value.rotated(-self._angle)
            straight = p.Kpll * self._inside.im / port.omega_b
            rate = held_at_limits(integral, p.Kipll * straight, -p.Pllmax, p.Pllmax)
            m.derivative(integral, if_else(p.Kipll > 0, rate, -integral / BYPASS_TIME))
            deviation = clamp(straight + integral, -p.Pllmax, p.Pllmax)
            self._speed = port.omega_b * deviation
            m.derivative(self._angle, self._speed)
        self._E = Phasor(self._E_q, X * self._I_p)
        self._E_0 = Phasor(self.reactive_0, X * self.active_0)
        self._flow = (self._E - self._inside) / Z
        self.current = self._flow * polar(1.0, self._angle) * port.connected

    def follow(self, m: ModelBuilder, active: Expr, reactive: Expr) -> None:
        """Let active current [pu, S_n] and emf [pu] follow their commands."""
        m.derivative(self._I_p, (active - self._I_p) / LAG)
        m.derivative(self._E_q, (reactive - self._E_q) / LAG)

    def emf(self, m: ModelBuilder, master: MasterStep) -> SourceEmf:
        """Return the emf behind the reactance."""
        with m.scope("source"):
            moving = motion(m, "e", self._E, self._E_0, "Emf in its frame")

        def emf(time: Expr) -> Phasor:
            return (self._E + moving * time) * polar(1.0, self._angle + self._speed * time)

        return SourceEmf(behind=emf(-master.size / 2), ahead=emf(master.to_next))

    def fed(self) -> tuple[Expr, Expr]:
        """Active and reactive current that it feeds [pu, S_n]."""
        size = fmax(self._inside.magnitude(), LEAST_VOLTAGE)
        in_phase = self._flow * self._inside.conjugate() / size
        return Expr(in_phase.re), -Expr(in_phase.im)


class Wt3:
    """WT3E1 with WT3T1, and WT3P1 where it is there; declared with its speeds at the operating point."""

    def __init__(
        self, m: ModelBuilder, t: Terminal, converter: Wt3g1, *, has_pitch: bool = False
    ) -> None:
        self._t, self._converter = t, converter
        self._per = 1 / converter.to_turbines
        with m.scope("electrical"):
            self._p = p = declared(m, CONTROL, SOURCE)
        with m.scope("shaft"):
            self._shaft = declared(m, SHAFT, TYPICAL)
        self._pitch: Given | None = None
        if has_pitch:
            with m.scope("pitch"):
                self._pitch = declared(m, PITCH, TYPICAL)
        self._P_0 = t.P_0 * self._per
        self._Q_0 = Expr(t.Q_0)  # per unit of S_n
        m.require(0.2 - p.PMN, "electrical.PMN, at which the speed is wPmin, lies below 0.2 pu")
        self.speed_0 = self._speed_of(self._P_0)
        with m.scope("shaft"):
            self.speed, self._of_turbine = (
                m.state(f"speed_of_{name}", self.speed_0, "pu", f"Speed of the {name}", base="f_n")
                for name in ("generator", "turbine")
            )

    def _speed_of(self, P: Expr) -> Expr:
        """The speed that belongs to a power [pu, rating]."""
        p = self._p
        points = (
            (p.PMN, p.wPmin),
            (0.2, p.wP20),
            (0.4, p.wP40),
            (0.6, p.wP60),
            (p.Pmin, p.wP100),
        )
        return through_points(P, points)

    def close(self, m: ModelBuilder) -> tuple[Expr, Expr]:
        """Declare control, pitch and shaft, and return the commands of active current [pu, S_n] and of emf [pu]."""
        with m.scope("electrical"):
            emf = self._reactive(m)
            P_ord, reference = self._active(m)
            p, v = self._p, fmax(self._t.size, LEAST_VOLTAGE)
            m.require(
                p.IPMAX - self._P_0 / self._t.size_0 + ROUNDING,
                "the power flow asks for more active current than electrical.IPMAX: raise it or Prated",
            )
            active = fmin(P_ord / v, p.IPMAX) / self._per
        self._angle, start = Expr(0), Expr(0)
        if self._pitch is not None:
            self._angle, start = self._blades(m, P_ord, reference), self._pitch.TetaMin
        self._mechanical = self._turn(m, self._angle - start)
        return active, emf

    def _reactive(self, m: ModelBuilder) -> Expr:
        """The command of the emf [pu]."""
        p, t = self._p, self._t
        size = sqrt(t.P**2 + t.Q**2 + 1e-12) / fmax(t.size, LEAST_VOLTAGE)
        size_0 = sqrt(t.P_0**2 + t.Q_0**2 + 1e-12) / t.size_0
        seen = t.size - p.Xc * size, t.size_0 - p.Xc * size_0
        target = voltage_asked(m, t, p, seen, by_voltage=p.VARFLG > 0, by_angle=p.VARFLG < 0)
        start = self._converter.reactive_0
        base, base_0 = (if_else(p.VLTFLG < 1.5, v, 0) for v in (t.size, t.size_0))
        within(m, start - base_0, p, "XIQmin", "XIQmax")
        emf = m.state("emf", start, "pu", "Integral of the voltage's error", base="bus")
        low, high = base + p.XIQmin, base + p.XIQmax
        m.derivative(emf, held_at_limits(emf, p.KQV * (target - t.size), low, high))
        return clamp(emf, low, high)

    def _active(self, m: ModelBuilder) -> tuple[Expr, Expr]:
        """The order of power [pu, rating], and the reference of the speed [pu]."""
        p = self._p
        wanted = self._speed_of(self._t.P * self._per)
        reference = low_pass_or_nothing(m, "speed_asked", wanted, p.T_POWER, self.speed_0)
        error = self.speed - reference
        start = self._P_0 / self.speed_0
        torque = m.state("torque", start, "pu", "Integral of the speed", base="rating")
        m.derivative(torque, if_else(p.KIP > 0, p.KIP * error, (start - torque) / BYPASS_TIME))
        order = m.state("P_ord", self._P_0, "pu", "Order of power", base="rating")
        asked = (torque + p.Kpp * error) * self.speed
        rate = clamp((asked - reached(order, p.PMN, p.PMX)) / p.TFP, p.RPMN, p.RPMX)
        within(m, self._P_0, p, "PMN", "PMX")
        m.derivative(order, held_at_limits(order, rate, p.PMN, p.PMX))
        return clamp(order, p.PMN, p.PMX), reference

    def _blades(self, m: ModelBuilder, P_ord: Expr, reference: Expr) -> Expr:
        """The pitch angle [deg]."""
        p = self._pitch
        assert p is not None
        speed, beyond = self.speed - reference, P_ord - p.PMX
        start = clamp(p.TetaMin - p.Kpc * (self._P_0 - p.PMX), p.TetaMin, p.TetaMax)
        with m.scope("pitch"):
            of_speed = m.state("of_speed", start, "deg", "Integral of the speed")
            of_power = m.state("of_power", 0.0, "deg", "Integral of the power")
            angle = m.state("angle", p.TetaMin, "deg", "Pitch angle")
            m.require(p.PMX - self._P_0, "pitch.PMX must exceed the power of the operating point")
            at_stop = logic_and(of_power <= REST, beyond <= REST)
            rising = held_at_limits(of_power, p.Kic * beyond, 0.0, p.TetaMax)
            m.derivative(of_power, if_else(at_stop, -of_power / RETURN_TIME, rising))
            by_speed, by_power = of_speed + p.Kpp * speed, clamp(of_power, 0, p.TetaMax)
            wanted = by_speed + by_power + p.Kpc * beyond
            small = (p.Kpp + p.Kpc + 1) * REST
            still = logic_and(_is_small(speed), _is_small(of_speed - start))
            rests = logic_and(still, wanted <= p.TetaMin + small)
            moving = held_at_limits(of_speed, p.Kip * speed, p.TetaMin, p.TetaMax)
            m.derivative(of_speed, if_else(rests, (start - of_speed) / RETURN_TIME, moving))
            lag = if_else(p.Tp > 0, p.Tp, RETURN_TIME)
            limited = if_else(rests, p.TetaMin, clamp(wanted, p.TetaMin, p.TetaMax))
            m.derivative(angle, clamp((limited - angle) / lag, -p.RTetaMax, p.RTetaMax))
        return angle

    def _turn(self, m: ModelBuilder, pitched: Expr) -> Expr:
        """Give the shaft's rates; the power of the wind [pu, S_n]."""
        p, w_0 = self._shaft, self.speed_0
        w, w_t = (fmax(x, LEAST_SPEED) for x in (self.speed, self._of_turbine))
        start = self._t.P_0 / w_0 + p.DAMP * (w_0 - 1)
        P_m = start * w_0 - p.Kaero * pitched
        braking = self._t.P / w + p.DAMP * (self.speed - 1)
        one = p.Htfrac <= 0
        turbine, generator = (if_else(one, 1, share) * p.H for share in (p.Htfrac, 1 - p.Htfrac))
        m.require(1 - p.Htfrac, "shaft.Htfrac: the turbine's share of the inertia lies below 1")
        m.require(
            if_else(one, 1, p.Freq1),
            "shaft.Freq1 lies above 0 where shaft.Htfrac does: two masses swing; or set Htfrac = 0",
        )
        with m.scope("shaft"):
            twist = m.state("torque", start, "pu", "Torque of the shaft", base="S_n")
        between = self._of_turbine - self.speed
        through = twist + p.Dshaft * between
        alone = (P_m / w - braking) / (2 * p.H)
        m.derivative(self.speed, if_else(one, alone, (through - braking) / (2 * generator)))
        m.derivative(
            self._of_turbine,
            if_else(one, -between / BYPASS_TIME, (P_m / w_t - through) / (2 * turbine)),
        )
        stiff = 2 * turbine * generator / p.H * (2 * pi * p.Freq1) ** 2
        m.derivative(twist, if_else(one, (start - twist) / BYPASS_TIME, stiff * between))
        return P_m

    def declare_outputs(self, m: ModelBuilder) -> None:
        """Declare what is seen of the turbine."""
        m.output("speed", self.speed, "pu", "Speed of the generator's shaft", base="f_n")
        m.output("pitch_angle", self._angle, "deg", "Pitch angle")
        m.output("P_mechanical", self._mechanical, "pu", "Power of the wind", base="S_n")


def voltage_asked(
    m: ModelBuilder,
    t: Terminal,
    p: Given,
    controlled: tuple[Expr, Expr],
    *,
    by_voltage: Expr,
    by_angle: Expr,
) -> Expr:
    """The reference of the voltage [pu], by the controlled voltage, the power factor or the reactive power.

    ``controlled``: voltage, and at the operating point."""
    (seen, seen_0), Q_0 = controlled, Expr(t.Q_0)
    change = m.parameter(
        "delta_ref",
        0.0,
        "pu",
        "Change of the voltage's reference, or of the reactive power's where VARFLG is not 1",
        base="S_n",
        tunable=True,
    )
    behind = low_pass_or_nothing(m, "voltage", seen, p.TRV, seen_0)
    error = if_else(by_voltage, seen_0 + change - behind, 0)
    straight = low_pass_or_nothing(m, "straight", p.KPV * error, p.Tv, 0.0)
    slow = m.state("integral", Q_0, "pu", "Integral of the voltage", base="S_n")
    free = slow + straight
    outward = logic_or(logic_and(free > p.QMX, error > 0), logic_and(free < p.QMN, error < 0))
    resting = (Q_0 - slow) / BYPASS_TIME
    acts = logic_and(by_voltage, p.KIV > 0)
    m.derivative(slow, if_else(acts, if_else(outward, 0, p.KIV * error), resting))
    of_voltage = low_pass_or_nothing(m, "order", clamp(free, p.QMN, p.QMX), p.Tfv, Q_0)
    measured = low_pass_or_nothing(m, "power", t.P, p.Tp, t.P_0)
    of_angle = measured * Q_0 / if_else(by_angle, t.P_0, 1)
    asked = if_else(by_voltage, of_voltage, if_else(by_angle, of_angle, Q_0) + change)
    within(m, Q_0, p, "QMN", "QMX")
    within(m, t.size_0, p, "VMINCL", "VMAXCL")
    target = m.state("voltage_asked", t.size_0, "pu", "Reference of the voltage", base="bus")
    rate = p.KQi * (clamp(asked, p.QMN, p.QMX) - t.Q)
    limited = held_at_limits(target, rate, p.VMINCL, p.VMAXCL)
    m.derivative(target, if_else(p.KQi > 0, limited, (t.size_0 - target) / BYPASS_TIME))
    return clamp(target, p.VMINCL, p.VMAXCL)


def _is_small(x: Expr) -> Expr:
    """Return whether a signal lies within `REST`."""
    return logic_and(x <= REST, x >= -REST)


def within(m: ModelBuilder, value: Expr, p: Given, low: str, high: str) -> None:
    """Require the operating point's value within two limits of the control."""
    for margin, name in ((getattr(p, high) - value, high), (value - getattr(p, low), low)):
        text = f"electrical.{name}: the power flow asks for more; change it, Prated, or the unit's powers"
        m.require(margin + ROUNDING, text)
