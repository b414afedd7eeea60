"""WTDTA1, WTARA1, WTPTA1 and WTTQA1: the shaft, the aerodynamics, the pitch and the torque of a wind turbine.

    shaft:         2·Ht·ω_t' = P_m/ω_t − T − Dshaft·(ω_t − ω_g);  2·Hg·ω_g' = T + Dshaft·(ω_t − ω_g) − P/ω_g
                   − DAMP·(ω_g − ω_0);  T' = K·(ω_t − ω_g), K = 2·Ht·Hg/H·(2π·Freq1)², Ht = Htfrac·H; one mass at 0
    aerodynamics:  P_m = P_m0 − Ka·θ·(θ − Theta0)
    pitch:         ω_t − ω_ref + Kcc·(P_ord − P_ref) → Kpw + Kiw/s, and P_ord − P_ref → Kpc + Kic/s; both together
                   → 1/(1 + s·Tp) within TetaMin…TetaMax, by RTetaMin and RTetaMax at most = θ
    torque:        P → 1/(1 + s·Tp) → the line (P1, Spd1)…(P4, Spd4) → 1/(1 + s·Twref) = ω_ref
                   Tflag: (P_ref − P)/ω_g; else ω_g − ω_ref → Kpp + Kip/s within Temin…Temax → × ω_g = the reference

P_ref is the plant's reference. The torque's integrator waits in a dip. Torque and line are per unit of TRATE, the rest
of S_n. Without WTTQA1 the speed is 1, and ω_ref with it. Where the pitch is at its least angle at the operating point,
as below rated wind, linear models keep it there.

ANDES' WTTQA1 has the other sign of both errors, with which a speed above its reference takes torque away; GridPACK,
Dynawo and the shaft's stability want the one above. Freq1 is in Hz, as PowerWorld's help has it.

Sources: WECC, "WECC Second Generation Wind Turbine Models" (2014), as PowerWorld's help, Dynawo, GridPACK and InterPSS
describe them."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi

from fmus.synchronous_generator.data_lines import Given, Line, declared, number, power, pu, seconds
from fmus.toolchain.blocks import BYPASS_TIME, RETURN_TIME, clamp, low_pass, low_pass_or_nothing
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, fmax, if_else, logic_and, logic_or
from fmus.wecc_renewable.signals import (
    ROUNDING,
    Controller,
    Terminal,
    controlled,
    through_rising_points,
)

SOURCE = "typical values of WECC's Wind Plant Dynamic Modeling Guidelines (2014)"

LEAST_SPEED = 0.01
"""Speed [pu] below which no division by it takes place."""

REST = 1e-4
"""Error [pu] and angle [deg] within which the pitch stays at a stop: more than a linear model's perturbations."""

SHAFT = (
    number("H", 5.0, "Inertia constant of turbine and generator", 1e-3, "s"),
    power("DAMP", 0.0, "Torque by the generator's speed away from that of the operating point"),
    number("Htfrac", 0.9, "Share of the turbine in the inertia; 0: one mass", 0),
    number("Freq1", 1.8, "Frequency at which the shaft swings; above 0 with two masses", 0, "Hz"),
    power("Dshaft", 1.5, "Torque by the difference of both speeds", 0),
)
AERODYNAMICS = (
    number("Ka", 0.007, "Power by the square of the pitch angle", 0, "1"),
    number("Theta0", 0.0, "Pitch angle at the operating point", None, "deg"),
)
PITCH = (
    number("Kiw", 25.0, "Integral gain of the speed", 0, "1/s"),
    number("Kpw", 150.0, "Proportional gain of the speed", 0),
    number("Kic", 30.0, "Integral gain of the power", 0, "1/s"),
    number("Kpc", 3.0, "Proportional gain of the power", 0),
    number("Kcc", 0.0, "Speed by power", 0),
    seconds("Tp", 0.3, "Lag of the blades; 0 leaves it out"),
    number("TetaMax", 27.0, "Most pitch angle", None, "deg"),
    number("TetaMin", 0.0, "Least pitch angle", None, "deg"),
    number("RTetaMax", 10.0, "Largest rate of the pitch angle", 0, "deg/s"),
    number("RTetaMin", -10.0, "Least rate of the pitch angle", None, "deg/s"),
)
TORQUE = (
    number("Kpp", 3.0, "Proportional gain of the torque", 0),
    number("Kip", 0.6, "Integral gain of the torque", 0, "1/s"),
    seconds("Tp", 0.05, "Filter of the power; 0 leaves it out"),
    seconds("Twref", 60.0, "Lag of the speed's reference", 1e-3),
    pu("Temax", 1.2, "Most torque", base="TRATE"),
    pu("Temin", 0.0, "Least torque", base="TRATE"),
    *(
        line
        for k, (P, speed) in enumerate(((0.2, 0.58), (0.4, 0.72), (0.6, 0.86), (0.8, 1.0)), 1)
        for line in (
            pu(f"P{k}", P, f"Point {k} of the line of speed: power", base="TRATE"),
            pu(f"Spd{k}", speed, f"Point {k} of the line of speed: speed", 0.01, base="f_n"),
        )
    ),
    number("TRATE", 0.0, "Rating of the turbine; 0: S_n", 0, "MVA"),
)


@dataclass(frozen=True)
class TurbineParts:
    """Which records a turbine has beside WTDTA1."""

    aerodynamics: bool = False
    pitch: bool = False
    torque: bool = False


class Turbine:
    """A turbine, declared: its speeds [pu], and the references that its torque sets."""

    def __init__(self, m: ModelBuilder, t: Terminal, parts: TurbineParts, rating: Expr) -> None:
        self._given = {
            name: _declared_in(m, name, lines)
            for name, lines, there in (
                ("shaft", SHAFT, True),
                ("aerodynamics", AERODYNAMICS, parts.aerodynamics),
                ("pitch", PITCH, parts.pitch),
                ("torque", TORQUE, parts.torque),
            )
            if there
        }
        self._P_0 = Expr(t.P_0)
        self._per_turbine = Expr(1)
        if parts.torque:
            with m.scope("torque"):
                text = "The torque follows the error of power; else that of speed"
                self._by_power = m.switch("Tflag", False, text)
            own = self._given["torque"].TRATE
            self._per_turbine = rating / if_else(own > 0, own, rating)
        self.speed_0 = self._speed_of(self._P_0 * self._per_turbine)
        m.require(self.speed_0 - LEAST_SPEED, "the line P1, Spd1 to P4, Spd4 gives no speed at P_0")
        with m.scope("shaft"):
            self.speed, self._of_turbine = (
                m.state(f"speed_of_{name}", self.speed_0, "pu", f"Speed of the {name}", base="f_n")
                for name in ("generator", "turbine")
            )
            start = self._P_0 / self.speed_0
            self._twist = m.state("torque", start, "pu", "Torque of the shaft", base="S_n")
        self._reference_speed = self.speed_0
        self._pitch = self._angle_0

    @property
    def _angle_0(self) -> Expr:
        """Pitch angle at the operating point [deg]."""
        given = self._given.get("aerodynamics")
        if given is not None:
            return given.Theta0
        pitch = self._given.get("pitch")
        return Expr(0) if pitch is None else pitch.TetaMin

    def _speed_of(self, P: Expr) -> Expr:
        """The speed that belongs to a power [pu, TRATE]."""
        p = self._given.get("torque")
        if p is None:
            return Expr(1)
        points = [(getattr(p, f"P{k}"), getattr(p, f"Spd{k}")) for k in range(1, 5)]
        return through_rising_points(P, points)

    def reference_0(self, own: Expr, t: Terminal) -> Expr:
        """The plant's reference at the operating point, by that of the control [pu, S_n]."""
        return Expr(t.P_0) if "torque" in self._given else own

    def reference(self, m: ModelBuilder, t: Terminal, asked: Expr, own: Expr, dip: Expr) -> Expr:
        """The control's reference by the plant's [pu, S_n].

        ``own``: of the operating point; ``dip``: whether there is one."""
        p = self._given.get("torque")
        if p is None:
            return asked
        scale = self._per_turbine
        chosen = self._by_power
        with m.scope("torque"):
            P = low_pass_or_nothing(m, "P_filtered", t.P * scale, p.Tp, self._P_0 * scale)
            self._reference_speed = low_pass(
                m, "reference_speed", self._speed_of(P), p.Twref, self.speed_0
            )
            by_power = (asked * scale - P) / fmax(self.speed, LEAST_SPEED)
            error = if_else(chosen, by_power, self.speed - self._reference_speed)
            start = own * scale / self.speed_0
            for margin, name in ((p.Temax - start, "Temax"), (start - p.Temin, "Temin")):
                text = f"the power flow asks for a torque beyond {name}; change it, or P_0"
                m.require(margin + ROUNDING, text)
            how = Controller(p.Kpp, p.Kip, p.Temin, p.Temax, 1.0, dip)
            torque = controlled(m, "integrator", error, how, initial=start)
        return torque * self.speed / scale

    def close(self, m: ModelBuilder, t: Terminal, beyond: Expr) -> None:
        """Give the rates of the shaft and of the pitch.

        ``beyond``: power that is asked for, less the plant's reference, less the same at the operating point."""
        if "pitch" in self._given:
            self._pitch = self._angle(m, beyond)
        P_m = self._P_0
        if "aerodynamics" in self._given:
            a = self._given["aerodynamics"]
            P_m = P_m - a.Ka * self._pitch * (self._pitch - a.Theta0)
        self._mechanical = P_m
        p = self._given["shaft"]
        w, w_t = (fmax(x, LEAST_SPEED) for x in (self.speed, self._of_turbine))
        braking = t.P / w + p.DAMP * (self.speed - self.speed_0)
        one = p.Htfrac <= 0
        turbine, generator = (if_else(one, 1, share) * p.H for share in (p.Htfrac, 1 - p.Htfrac))
        m.require(1 - p.Htfrac, "shaft.Htfrac: the turbine's share of the inertia lies below 1")
        no_shaft = (
            "shaft.Freq1 lies above 0 where shaft.Htfrac does: two masses swing; or set Htfrac = 0"
        )
        m.require(if_else(one, 1, p.Freq1), no_shaft)
        between = self._of_turbine - self.speed
        through = self._twist + p.Dshaft * between
        alone = (P_m / w - braking) / (2 * p.H)
        m.derivative(self.speed, if_else(one, alone, (through - braking) / (2 * generator)))
        following = -between / BYPASS_TIME
        m.derivative(
            self._of_turbine, if_else(one, following, (P_m / w_t - through) / (2 * turbine))
        )
        stiff = 2 * turbine * generator / p.H * (2 * pi * p.Freq1) ** 2
        resting = (self._P_0 / self.speed_0 - self._twist) / BYPASS_TIME
        m.derivative(self._twist, if_else(one, resting, stiff * between))

    def _angle(self, m: ModelBuilder, beyond: Expr) -> Expr:
        """The pitch angle [deg]."""
        p = self._given["pitch"]
        start = self._angle_0
        for margin, name in ((p.TetaMax - start, "TetaMax"), (start - p.TetaMin, "TetaMin")):
            m.require(
                margin + ROUNDING, f"the operating point's Theta0 lies beyond {name}; change it"
            )
        limits = p.TetaMin, p.TetaMax
        speed = self._of_turbine - self._reference_speed + p.Kcc * beyond
        with m.scope("pitch"):
            at_rest = clamp(0, *limits)
            of_speed = _stopped(m, "of_speed", speed, (p.Kpw, p.Kiw), limits, start - at_rest)
            of_power = _stopped(m, "of_power", beyond, (p.Kpc, p.Kic), limits, at_rest)
            wanted = clamp(of_speed + of_power, *limits)
            angle = m.state("angle", start, "deg", "Pitch angle")
            rate = (wanted - angle) / if_else(p.Tp > 0, p.Tp, RETURN_TIME)
            m.derivative(angle, clamp(rate, p.RTetaMin, p.RTetaMax))
        return angle

    def declare_outputs(self, m: ModelBuilder) -> None:
        """Declare what is seen of the turbine."""
        m.output("speed", self.speed, "pu", "Speed of the generator's shaft", base="f_n")
        m.output("pitch_angle", self._pitch, "deg", "Pitch angle")
        m.output("P_mechanical", self._mechanical, "pu", "Power of the wind", base="S_n")


def _declared_in(m: ModelBuilder, scope: str, lines: Sequence[Line]) -> Given:
    with m.scope(scope):
        return declared(m, lines, SOURCE)


def _stopped(
    m: ModelBuilder,
    name: str,
    u: Expr,
    gains: tuple[Expr, Expr],
    limits: tuple[Expr, Expr],
    start: Expr,
) -> Expr:
    """K_P + K_I/s within limits; what rests at one is held there until the error leads away by `REST` [deg]."""
    (low, high), (K_P, K_I) = limits, gains
    x = m.state(name, start, "deg", "Integrator of the pitch angle")
    down = logic_and(x <= low + REST, u <= REST)
    up = logic_and(x >= high - REST, u >= -REST)
    y = K_P * u + x
    outward = logic_or(logic_and(y > high, u > 0), logic_and(y < low, u < 0))
    moving = if_else(outward, 0, K_I * u)
    m.derivative(
        x, if_else(down, (low - x) / RETURN_TIME, if_else(up, (high - x) / RETURN_TIME, moving))
    )
    return if_else(down, low, if_else(up, high, clamp(y, low, high)))
