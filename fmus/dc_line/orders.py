"""The control of PSS/E's CDC4T: orders of current and voltage, and when the line blocks, bypasses and comes back.

    order       constant current, or P/V_m with V_m = V_im + R·I_m at the rectifier, V_im at the inverter
                → within C0 and the limit through (V1, C1), (V2, C2), (V3, C3) at V_im → below the ramp
    measured    V_im behind TVDC, I_m behind TIDC
    VCMOD       below it a held power is a current, P/VSCHD, for TCMODE at least
    blocked     at once where the rectifier's bus is below VBLOCK, for TBLOCK at least, until it is above VUNBL
    bypassed    at once where the inverter's voltage is below VBYPAS, for TBYPAS at least, until its bus is above VUNBY
    ramps       after blocking the current's order rises from RSCUR with CRAMP, and after both the voltage's from RSVOLT
                with VRAMP, per unit of the orders at the start; 0 or less: at once

In service no ramp acts, and no bypass is looked for while one does.

Sources: PowerWorld's help on CDC4T; the order of its fields and the control as STEPS has them
(Shandong University, `CDC4T`)."""

from dataclasses import dataclass
from itertools import pairwise

from fmus.dc_line.circuit import Circuit
from fmus.synchronous_generator.data_lines import Given, declared, number, pu, seconds
from fmus.toolchain.blocks import RETURN_TIME
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import (
    Expr,
    exp,
    fmax,
    fmin,
    if_else,
    logic_and,
    logic_or,
)
from fmus.wecc_renewable.signals import through_points

SOURCE = "PSS/E's CDC4T, with values for the benchmark line"

ACTING = 0.5
"""Value of a latch above which it acts; at rest it is 0."""

AT_REST = 0.1
"""Value of a latch below which its timer starts anew."""

KILO = 1000.0
"""Amperes in a kiloampere."""

LEAST_LAG = 1e-3
"""Least lag of a measurement [s], so that no order follows at once from what it sets."""

LEAST_SHARE = 0.01
"""Share of the voltage at the start below which no current is told from a power."""

NEARLY = 0.999
"""Share of an order from which on its ramp has ended."""

CURRENT = 0
POWER_AT_INVERTER = 2

LINES = (
    seconds("TVDC", 0.05, "Lag of the measured DC voltage of the inverter; 1 ms at least"),
    seconds("TIDC", 0.05, "Lag of the measured DC current; 1 ms at least"),
    pu("VBLOCK", 0.6, "Voltage of the rectifier's bus below which the line blocks", 0, "bus"),
    pu("VUNBL", 0.65, "Voltage of the rectifier's bus above which it comes back", 0, "bus"),
    seconds("TBLOCK", 0.1, "Least time for which the line is blocked"),
    number("VBYPAS", 150, "DC voltage below which the inverter is bypassed", None, "kV"),
    pu("VUNBY", 0.8, "Voltage of the inverter's bus above which its bypass ends", 0, "bus"),
    seconds("TBYPAS", 0.1, "Least time for which the inverter is bypassed"),
    number("RSVOLT", 100, "Voltage order with which the line comes back", 0, "kV"),
    number("RSCUR", 400, "Current order with which it comes back after blocking", 0, "A"),
    number("VRAMP", 5, "Rise of the voltage order, of that at the start; 0: at once", None, "1/s"),
    number("CRAMP", 5, "Rise of the current order, of that at the start; 0: at once", None, "1/s"),
    number("C0", 100, "Least current order", 0, "A"),
    number("V1", 200, "Measured voltage of the first point of the current's limit", None, "kV"),
    number("C1", 1100, "Limit of the current order there and below", 0, "A"),
    number("V2", 450, "Measured voltage of the second point", None, "kV"),
    number("C2", 2000, "Limit of the current order there", 0, "A"),
    number("V3", 490, "Measured voltage of the third point", None, "kV"),
    number("C3", 2200, "Limit of the current order there and above", 0, "A"),
    seconds("TCMODE", 0.1, "Least time for which a current is held in the place of a power"),
    number("VCMOD", 0, "DC voltage below which a held power is a current", None, "kV"),
    number("VSCHD", 490, "Scheduled DC voltage, by which a power is that current", 1e-3, "kV"),
)


@dataclass(frozen=True)
class Start:
    """Current [kA], voltages of inverter and rectifier [kV] at the operating point."""

    current: Expr
    inverter_kv: Expr
    rectifier_kv: Expr


@dataclass(frozen=True)
class Condition:
    """1 or 0 each: blocked, bypassed, whether a current is held in the place of a power, and the ramps' states."""

    blocked: Expr
    bypassed: Expr
    holds_current: Expr
    of_current: Expr
    of_voltage: Expr

    @property
    def comes_back(self) -> Expr:
        """Return whether a ramp acts."""
        return logic_or(self.of_current < NEARLY, self.of_voltage < NEARLY)


@dataclass(frozen=True)
class Measured:
    """Inverter's voltage [kV] and current [kA] behind their lags, and what these follow."""

    kilovolts: Expr
    current: Expr
    lags: tuple[Expr, Expr]

    def after(self, time: Expr, kilovolts: Expr, current: Expr) -> tuple[Expr, Expr]:
        """Return both after a time [s], in which they go on to follow what they follow now."""
        still = [exp(-time / lag) for lag in self.lags]
        return (
            kilovolts + (self.kilovolts - kilovolts) * still[0],
            current + (self.current - current) * still[1],
        )

    def follow(self, m: ModelBuilder, kilovolts: Expr, current: Expr) -> None:
        """Give both what they follow."""
        m.derivative(self.kilovolts, (kilovolts - self.kilovolts) / self.lags[0])
        m.derivative(self.current, (current - self.current) / self.lags[1])


@dataclass(frozen=True)
class Control:
    """The control of a line: its parameters, the order that it holds, and the operating point.

    ``mode``: what is held; ``excess``: what the current at the start exceeds its limit by [kA]; ``least``: the least
    order [kA]."""

    p: Given
    mode: Expr
    circuit: Circuit
    start: Start
    excess: Expr
    least: Expr

    @property
    def voltage_order(self) -> Expr:
        """Order of the inverter's voltage at no current [kV]."""
        return self.start.inverter_kv + self.circuit.compounding * self.start.current

    def current(self, kilovolts: Expr, current: Expr, state: Condition) -> Expr:
        """Order of the current [kA], by what is measured."""
        at_inverter = self.mode >= POWER_AT_INVERTER
        seen = if_else(at_inverter, kilovolts, kilovolts + self.circuit.ohm * current)
        start_kv = if_else(at_inverter, self.start.inverter_kv, self.start.rectifier_kv)
        power = self.start.current * start_kv
        of_power = power / fmax(seen, LEAST_SHARE * start_kv)
        of_power = if_else(state.holds_current, power / self.p.VSCHD, of_power)
        asked = if_else(self.mode > CURRENT, of_power, self.start.current)
        most = limit_of_current(self.p, kilovolts) + self.excess
        ordered = fmax(fmin(asked, most), self.least)
        ramped = fmin(ordered, state.of_current * self.start.current)
        return if_else(state.blocked, 0, if_else(state.of_current < NEARLY, ramped, ordered))

    def kilovolts(self, state: Condition, beyond: Expr) -> Expr:
        """Order of the inverter's voltage at no current [kV]; ``beyond``: what it may exceed in service."""
        ramped = fmin(state.of_voltage, 1) * self.voltage_order
        return if_else(state.of_voltage < NEARLY, ramped, self.voltage_order + beyond)


def limit_of_current(p: Given, kilovolts: Expr) -> Expr:
    """Limit of the current order [kA] by the inverter's measured voltage [kV]."""
    points = [(p.V1, p.C1 / KILO), (p.V2, p.C2 / KILO), (p.V3, p.C3 / KILO)]
    return through_points(kilovolts, points)


def declare_control(m: ModelBuilder, mode: Expr, circuit: Circuit, start: Start) -> Control:
    """Declare the parameters of the control; its limits let the current of the operating point pass."""
    p = declared(m, LINES, SOURCE)
    for (low, high), text in zip(pairwise((p.V1, p.V2, p.V3)), ("V2", "V3"), strict=True):
        m.require(high - low, f"{text} must exceed the voltage of the point before it")
    excess = fmax(start.current - limit_of_current(p, start.inverter_kv), 0)
    return Control(p, mode, circuit, start, excess, fmin(p.C0 / KILO, start.current))


def declare_measured(m: ModelBuilder, p: Given, start: Start) -> Measured:
    """Declare what is measured."""
    kilovolts = m.state("V_measured", start.inverter_kv, "kV", "Inverter's DC voltage, measured")
    current = m.state("I_measured", start.current, "kA", "DC current, measured")
    return Measured(kilovolts, current, (fmax(p.TVDC, LEAST_LAG), fmax(p.TIDC, LEAST_LAG)))


@dataclass(frozen=True)
class Latch:
    """A latch with a timer of how long it has acted [s]."""

    name: str
    value: Expr
    timer: Expr

    @property
    def acts(self) -> Expr:
        """Return whether it is set."""
        return self.value > ACTING

    def close(self, m: ModelBuilder, sets: Expr, least_time: Expr | float, released: Expr) -> None:
        """Give what sets it, and what releases it after a least time [s]."""
        over = logic_and(self.timer >= least_time, released)
        holds = logic_or(sets, logic_and(self.acts, 1 - over))
        m.derivative(self.value, (if_else(holds, 1, 0) - self.value) / RETURN_TIME)
        # it starts anew when the latch is nearly down, so that no release is taken back while it falls
        reset = if_else(self.value < AT_REST, -self.timer / RETURN_TIME, 0)
        m.derivative(self.timer, if_else(self.acts, 1, reset))


def declare_latch(m: ModelBuilder, name: str, text: str) -> Latch:
    """Declare the states of a latch."""
    value = m.state(name, 0.0, "1", f"{text}; it acts above {ACTING:g}")
    return Latch(name, value, m.state(f"{name}_for", 0.0, "s", f"{text}: time"))


@dataclass(frozen=True)
class Interruptions:
    """States of what blocks, bypasses and comes back."""

    blocking: Latch
    bypassing: Latch
    switching: Latch
    condition: Condition


@dataclass(frozen=True)
class Triggers:
    """Voltages of the rectifier's and the inverter's bus [pu], and what blocks, bypasses and ends both."""

    v: Expr
    far_v: Expr
    blocks: Expr
    unblocks: Expr
    bypasses: Expr
    unbypasses: Expr


def triggers_at_once(p: Given, v: Expr, far_v: Expr, inverter_kv: Expr) -> Triggers:
    """Return what acts at once, as all does in CDC4T.

    ``v``, ``far_v``: through one lag alone, as an extrapolation goes 13.5 % beyond a step of the voltage;
    ``inverter_kv``: the inverter's voltage, as if it were not bypassed [kV]."""
    return Triggers(v, far_v, v < p.VBLOCK, v > p.VUNBL, inverter_kv < p.VBYPAS, far_v > p.VUNBY)


def declare_interruptions(m: ModelBuilder, connected: Expr) -> Interruptions:
    """Declare latches and ramps; a line that its breaker parts from its bus is blocked."""
    with m.scope("interruption"):
        latches = [
            declare_latch(m, name, text)
            for name, text in (
                ("blocking", "The line is blocked"),
                ("bypassing", "The inverter is bypassed"),
                ("switching", "A current is held in the place of a power"),
            )
        ]
        ramps = [
            m.state(f"of_{name}", 1.0, "1", f"Ramp of the {name} order, of that at the start")
            for name in ("current", "voltage")
        ]
    blocked = logic_or(latches[0].acts, connected <= 0)
    bypassed = logic_and(latches[1].acts, 1 - blocked)
    condition = Condition(
        blocked, bypassed, latches[2].acts, of_current=ramps[0], of_voltage=ramps[1]
    )
    blocking, bypassing, switching = latches
    return Interruptions(blocking, bypassing, switching, condition)


def close_interruptions(
    m: ModelBuilder, control: Control, s: Interruptions, triggers: Triggers, inverter_kv: Expr
) -> None:
    """Give what sets and releases the latches, and the ramps' rates.

    ``inverter_kv``: the inverter's voltage, as if it were not bypassed [kV]."""
    p, state = control.p, s.condition
    s.blocking.close(m, triggers.blocks, p.TBLOCK, triggers.unblocks)
    in_service = logic_and(1 - state.blocked, 1 - state.comes_back)
    low = logic_and(in_service, triggers.bypasses)
    s.bypassing.close(m, low, p.TBYPAS, logic_or(triggers.unbypasses, state.blocked))
    below = logic_and(logic_and(in_service, control.mode > CURRENT), inverter_kv < p.VCMOD)
    s.switching.close(m, logic_and(below, 1 - state.bypassed), p.TCMODE, inverter_kv > p.VCMOD)
    out = logic_or(state.blocked, state.bypassed)
    order = fmax(control.start.current, LEAST_LAG)
    for ramp, waits, low_share, rate in (
        (state.of_current, state.blocked, p.RSCUR / KILO / order, p.CRAMP),
        (state.of_voltage, out, p.RSVOLT / control.voltage_order, p.VRAMP),
    ):
        rest = (1 - ramp) / RETURN_TIME
        rising = if_else(rate > 0, fmin(rate, rest), rest)
        m.derivative(ramp, if_else(waits, (fmin(low_share, 1) - ramp) / RETURN_TIME, rising))
