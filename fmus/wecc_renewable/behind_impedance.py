"""REGCB1 and REGCC1: a controlled voltage behind an impedance, Re + j·Xe of the network data (ZSORCE).

    I_pcmd → 1/(1 + s·Tg), rising by rrpwr at most where it feeds, falling by it where it draws; RateFlag: as a power,
             times v behind Tfltr before the lag and divided by it after
    I_qcmd → 1/(1 + s·Tg), rising by Iqrmax at most where Q_0 > 0, falling by Iqrmin at most where Q_0 < 0
    REGCB1: E = v + (Re + j·Xe)·(I_p − j·I_q) in the frame of the terminal voltage → 1/(1 + s·Te)
    REGCC1: both currents less those that flow → Kip + Kii/s → the same, in the frame of a PLL:
            v_q → Kppll + Kipll/s within wmin…wmax = its speed

What flows stays within Imax; PQFLAG says which current comes first. A rate of 0, or of the other sign, is none.

Sources: WECC's specifications of REGC_B and REGC_C (EPRI, 2019 and 2021), as PowerWorld's help, Dynawo, GridPACK and
InterPSS describe them."""

from collections.abc import Sequence
from dataclasses import dataclass

from fmus.converter_parts.bus_voltage import LEAST_VOLTAGE, ExtrapolatedVoltage
from fmus.synchronous_generator.data_lines import Line, declared, number, power, seconds
from fmus.toolchain.blocks import BYPASS_TIME, clamp, low_pass_or_nothing
from fmus.toolchain.frames import Phasor, polar
from fmus.toolchain.frames import power as power_of
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.phasor_port import MasterStep, SourceEmf, motion
from fmus.toolchain.port import DevicePort
from fmus.toolchain.symbols import Expr, fmax, if_else, logic_and, logic_or, sqrt
from fmus.wecc_renewable.converters import Converter, Kind
from fmus.wecc_renewable.injection import UNLIMITED
from fmus.wecc_renewable.signals import ROUNDING, Controller, controlled

SOURCE = "example of GridPACK, four converters in Kundur's two areas"
CHOSEN = "chosen here"

LEAST_LAG = 1e-3
"""Least lag [s] of the emf of REGCC1, whose current loop goes through it."""

LINES = (
    seconds("Tg", 0.02, "Lag of the commands", 1e-3),
    seconds("Tfltr", 0.02, "Filter of the voltage by which RateFlag divides; 0 leaves it out"),
    number("Iqrmax", 100.0, "Largest rate of the reactive current where Q_0 > 0", None, "pu/s"),
    number("Iqrmin", -100.0, "Least rate of the reactive current where Q_0 < 0", None, "pu/s"),
    number("rrpwr", 10.0, "Largest rate of the active current away from 0", None, "pu/s"),
    seconds("Te", 0.02, "Lag of the emf; 0 leaves it out"),
    power("Imax", 1.2, "Most current", 1e-3),
)
LOOPS = (
    number("Kip", 5.0, "Proportional gain of the current", 0),
    number("Kii", 70.0, "Integral gain of the current", 0, "1/s"),
    number("Kppll", 20.0, "Proportional gain of the PLL [rad/s by pu]", 0, "rad/s"),
    number("Kipll", 1500.0, "Integral gain of the PLL [rad/s² by pu]", 0),
    number("wmax", 12.0, "Most speed of the PLL", 0, "rad/s"),
    number("wmin", -12.0, "Least speed of the PLL", None, "rad/s"),
)


def port_of_emf(m: ModelBuilder) -> Phasor:
    """Declare the impedance behind which the emf stands."""
    text = "between emf and terminal, ZSORCE of the network data"
    R = m.parameter("Re", 0.0, "pu", f"Resistance {text}", base="S_n", minimum=0.0, source=CHOSEN)
    X = m.parameter("Xe", 0.15, "pu", f"Reactance {text}", base="S_n", minimum=1e-3, source=CHOSEN)
    return Phasor(R, X)


@dataclass(frozen=True)
class _Rates:
    """How fast a current may fall and rise [pu/s]."""

    low: Expr
    high: Expr


class BehindImpedance(Converter):
    """REGCB1: the frame is that of the terminal voltage."""

    lines: Sequence[Line] = LINES

    def __init__(
        self, m: ModelBuilder, port: DevicePort, seen: ExtrapolatedVoltage, Z: Phasor
    ) -> None:
        self._by_power = m.switch("RateFlag", False, "rrpwr is of the power; else of the current")
        self._active_first = m.switch("PQFLAG", False, "Active current comes first; else reactive")
        self._p = p = declared(m, self.lines, SOURCE)
        s_0, v_0 = power_of(port.v_0, port.i_0), port.v_0.magnitude()
        self._seen, self._Z, self._port = seen, Z, port
        self.active_0, self.reactive_0 = s_0.re / v_0, s_0.im / v_0
        flows = sqrt(self.active_0**2 + self.reactive_0**2)
        m.require(
            p.Imax - flows + ROUNDING,
            "the power flow asks for more current than Imax: raise it or S_n",
        )
        v = fmax(
            low_pass_or_nothing(m, "v_of_rate", seen.value.magnitude(), p.Tfltr, v_0), LEAST_VOLTAGE
        )
        self._divisor = if_else(self._by_power, v, 1)
        start = if_else(self._by_power, s_0.re, self.active_0)
        self._I_p = m.state(
            "I_p", start, "pu", "Active current or power behind its lag", base="S_n"
        )
        self._I_q = m.state(
            "I_q", self.reactive_0, "pu", "Reactive current behind its lag", base="S_n"
        )
        rrpwr = if_else(p.rrpwr > 0, p.rrpwr, UNLIMITED)
        feeds = self._I_p >= 0
        self._of_active = _Rates(
            if_else(feeds, -UNLIMITED, -rrpwr), if_else(feeds, rrpwr, UNLIMITED)
        )
        rising, falling = (
            if_else(p.Iqrmax > 0, p.Iqrmax, UNLIMITED),
            if_else(p.Iqrmin < 0, p.Iqrmin, -UNLIMITED),
        )
        Q_0 = Expr(s_0.im)
        self._of_reactive = _Rates(
            if_else(Q_0 < 0, falling, -UNLIMITED), if_else(Q_0 > 0, rising, UNLIMITED)
        )
        start_E = Phasor(v_0, 0.0) + Z * Phasor(self.active_0, -self.reactive_0)
        self._E_0 = start_E
        self._unit, self._inside = self._frame(m, port)
        self._declare_loops(m)
        self._E = self._emf(m)
        self._flow = self._limited()
        self.current = self._flow * self._unit * port.connected

    def _frame(self, m: ModelBuilder, port: DevicePort) -> tuple[Phasor, Phasor]:
        """Direction of the frame in the network's, and the terminal voltage in it [pu]."""
        v = self._seen.value
        size = fmax(v.magnitude(), LEAST_VOLTAGE)
        return v / size, Phasor(size, 0.0)

    def _declare_loops(self, m: ModelBuilder) -> None:
        """Declare what stands between the currents that are asked for and the emf."""

    def _emf(self, m: ModelBuilder) -> Phasor:
        """Declare the emf in the frame, behind its lag [pu]."""
        target = self._inside + self._Z * Phasor(self._I_p / self._divisor, -self._I_q)
        T = self._p.Te
        return Phasor(
            low_pass_or_nothing(m, "E_re", Expr(target.re), T, self._E_0.re),
            low_pass_or_nothing(m, "E_im", Expr(target.im), T, self._E_0.im),
        )

    def _limited(self) -> Phasor:
        """The current that flows, within Imax, in the frame [pu, S_n]."""
        return limited_current((self._E - self._inside) / self._Z, self._p.Imax, self._active_first)

    def follow(self, m: ModelBuilder, active: Expr, reactive: Expr) -> None:
        """Let the currents follow their commands [pu, S_n]."""
        for x, u, rates in (
            (self._I_p, active * self._divisor, self._of_active),
            (self._I_q, reactive, self._of_reactive),
        ):
            m.derivative(x, clamp((u - x) / self._p.Tg, rates.low, rates.high))

    def _direction(self, time: Expr) -> Phasor:
        """Direction of the frame at a time after the end of a communication step [s]."""
        v = self._seen.after(time)
        return v / fmax(v.magnitude(), LEAST_VOLTAGE)

    def emf(self, m: ModelBuilder, master: MasterStep) -> SourceEmf:
        """Return the emf, with the current that flows within Imax."""
        unlimited = (self._E - self._inside) / self._Z
        # exactly the emf where the limit does not act
        E = self._E + self._Z * (self._flow - unlimited)
        with m.scope("source"):
            moving = motion(m, "e", E, self._E_0, "Emf in its frame")

        def emf(time: Expr) -> Phasor:
            return (E + moving * time) * self._direction(time)

        return SourceEmf(behind=emf(-master.size / 2), ahead=emf(master.to_next))

    def fed(self) -> tuple[Expr, Expr]:
        """Active and reactive current that it feeds [pu, S_n]."""
        in_phase = (
            self._flow * self._inside.conjugate() / fmax(self._inside.magnitude(), LEAST_VOLTAGE)
        )
        return Expr(in_phase.re), -Expr(in_phase.im)


class WithCurrentLoop(BehindImpedance):
    """REGCC1: the currents have a loop, and the frame is that of a PLL."""

    lines = (*LINES, *LOOPS)

    def _frame(self, m: ModelBuilder, port: DevicePort) -> tuple[Phasor, Phasor]:
        """Direction of the PLL in the network's frame, and the terminal voltage in it [pu]."""
        p = self._p
        with m.scope("pll"):
            self._angle = m.state("angle", port.v_0.angle(), "rad", "Angle in the network's frame")
            v = self._seen.value.rotated(-self._angle)
            across = m.state("v_q_integral", 0.0, "s", "Integral of the voltage across its axis")
            free = p.Kppll * v.im + p.Kipll * across
            self._speed = clamp(free, p.wmin, p.wmax)
            outward = logic_or(
                logic_and(free > p.wmax, v.im > 0), logic_and(free < p.wmin, v.im < 0)
            )
            resting = if_else(p.Kipll > 0, v.im, -across / BYPASS_TIME)
            m.derivative(across, if_else(outward, 0, resting))
            m.derivative(self._angle, self._speed)
        return polar(1.0, self._angle), v

    def _declare_loops(self, m: ModelBuilder) -> None:
        """Declare the emf's lag before its loops, whose current goes through it."""
        self._E = Phasor(
            *(
                m.state(f"E_{part}", initial, "pu", "Emf behind its lag", base="bus")
                for part, initial in (("re", self._E_0.re), ("im", self._E_0.im))
            )
        )

    def _emf(self, m: ModelBuilder) -> Phasor:
        """Close both loops, and the emf's lag behind them [pu]."""
        p = self._p
        flows = self._limited()
        loops = []
        for name, asked, now, start in (
            ("active_loop", self._I_p / self._divisor, Expr(flows.re), self.active_0),
            ("reactive_loop", self._I_q, -Expr(flows.im), self.reactive_0),
        ):
            how = Controller(p.Kip, p.Kii, -p.Imax, p.Imax, 1.0, Expr(0.0))
            loops.append(controlled(m, name, asked - now, how, initial=start))
        target = self._inside + self._Z * Phasor(loops[0], -loops[1])
        T = fmax(p.Te, LEAST_LAG)
        m.derivative(Expr(self._E.re), (target.re - self._E.re) / T)
        m.derivative(Expr(self._E.im), (target.im - self._E.im) / T)
        return self._E

    def _direction(self, time: Expr) -> Phasor:
        """Direction of the PLL at a time after the end of a communication step [s]."""
        return polar(1.0, self._angle + self._speed * time)


def limited_current(i: Phasor, most: Expr, active_first: Expr) -> Phasor:
    """A current within a limit, of which one part comes first [pu, S_n]."""

    def rest(first: Expr) -> Expr:
        return sqrt(fmax(most**2 - first**2, 1e-12))

    re_first, im_first = clamp(i.re, -most, most), clamp(i.im, -most, most)
    re_later = clamp(i.re, -rest(im_first), rest(im_first))
    im_later = clamp(i.im, -rest(re_first), rest(re_first))
    return Phasor(
        if_else(active_first, re_first, re_later), if_else(active_first, im_later, im_first)
    )


REGCB1 = Kind(port_of_emf, BehindImpedance)
REGCC1 = Kind(port_of_emf, WithCurrentLoop)
