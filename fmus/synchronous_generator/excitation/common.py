"""Parts that excitation systems share: parameters, the measured voltage, a rate feedback, rectifier and saturation.

Signals of a regulator are per unit of the terminal voltage (base S_n) before the gain and of E_fd after it."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

from fmus.synchronous_generator import declarations, saturation
from fmus.synchronous_generator.data_lines import Given
from fmus.synchronous_generator.machine import Start
from fmus.toolchain.blocks import (
    BYPASS_TIME,
    clamp,
    lead_lag,
    limited_proportional_integral,
    proportional_integral,
    washout,
)
from fmus.toolchain.frames import ZERO, Phasor
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, Scalar, fmax, if_else, logic_and, sqrt

TerminalVoltage = Callable[[Expr], Phasor]
"""v_t [pu, S_n] in the rotor's frame for an E_fd [pu]; it depends, weakly, on E_fd because of the transformer in
series."""

SOURCE = "typical data, IEEE 421.5"

E_FD = "E_fd"


BEFORE = 1  # place of a gate: before an exciter's amplifier
BEHIND = 2  # place of a gate: behind it

_HEADROOM = 1e-3
"""By which a limiter's signal lies below the exciter's at a gate where the operating point is beyond it [pu]."""


@dataclass(frozen=True)
class Gate:
    """A limiter's signal that lifts an exciter's own at a gate of the higher value.

    ``signal``: the limiter's, ``at_start``: in the operating point; ``place``: `BEFORE`, `BEHIND`, or 0 for no gate;
    ``met``: the exciter's own signals, by the places that its diagram has; ``lowered``: by how much the limiter's is
    lowered there, so that it does not act in the operating point, where the exciter's is what the machine needs."""

    signal: Expr
    at_start: Scalar
    place: Expr
    met: dict[int, Expr] = field(default_factory=dict)
    lowered: dict[int, Expr] = field(default_factory=dict)

    def is_at(self, place: int) -> Expr:
        """Return whether the limiter acts at a place."""
        return logic_and(self.place > place - 0.5, self.place < place + 0.5)

    def lift(self, own: Expr, place: int, at_start: Scalar) -> Expr:
        """Return the higher one of both signals at a place of the exciter's diagram; ``at_start``: its own there."""
        above = Expr(self.at_start) - at_start
        self.met[place] = own
        self.lowered[place] = if_else(above > 0, above + _HEADROOM, 0)
        return if_else(self.is_at(place), fmax(own, self.signal_at(place)), own)

    def signal_at(self, place: int) -> Expr:
        """Return the limiter's signal as it arrives at a place of the exciter's diagram."""
        return self.signal - self.lowered[place]


@dataclass(frozen=True)
class Regulated:
    """Signals that an exciter sees: operating point, terminal and field current of its machine, and a stabiliser.

    ``i``: stator current in the rotor's frame [pu, S_n]; ``v_0``: terminal voltage of the operating point, same frame.
    """

    start: Start
    terminal: TerminalVoltage
    I_fd: Expr  # 1 pu gives 1 pu of voltage on open circuit
    v_s: Scalar = 0.0  # added to the voltage reference [pu, S_n]
    v_s_0: Scalar = 0.0  # the same in steady state
    i: Phasor = ZERO
    v_0: Phasor = ZERO
    gate: Gate | None = None  # of a limiter of underexcitation

    def lifted(self, own: Expr, place: int, at_start: Scalar) -> Expr:
        """An exciter's signal at a place of its diagram where a limiter may lift it; ``at_start``: in steady state."""
        return own if self.gate is None else self.gate.lift(own, place, at_start)

    def terminal_voltage(self, E_fd: Expr) -> Expr:
        """|v_t| [pu, S_n] for an E_fd [pu]."""
        return self.terminal(E_fd).magnitude()


# an excitation system; gives (E_fd, |v_t|) [pu]
Exciter = Callable[[ModelBuilder, Regulated], tuple[Expr, Expr]]


gain = partial(declarations.per_unit, base=E_FD, source=SOURCE)
time = partial(declarations.time_constant, source=SOURCE)


class Measurement:
    """The measured terminal voltage, 1/(1 + s·T_R), and the reference that it is compared with.

    What is measured is |v_t + (R_C + j·X_C)·i|, which regulates a point behind (positive) or before (negative) the
    terminal. The field current is the first guess of E_fd where T_R = 0 lets the voltage pass directly."""

    def __init__(self, m: ModelBuilder, seen: Regulated) -> None:
        self._m, self._seen = m, seen
        T_R = time(m, "T_R", 0.01, "Voltage measurement; 0 leaves it out")
        self._impedance = Phasor(
            *(
                m.parameter(name, 0.0, "pu", f"{text} of the compensation of load", base="S_n")
                for name, text in (("R_C", "Resistance"), ("X_C", "Reactance"))
            )
        )
        self._left_out = T_R <= 0
        self._T_R = if_else(self._left_out, BYPASS_TIME, T_R)
        self.at_start = self._measure(seen.v_0, seen.start.i)
        self._state = m.state("v_m", self.at_start, "pu", "Measured terminal voltage", base="S_n")
        nearly = seen.terminal(seen.I_fd)
        self.nearly = nearly.magnitude()
        """|v_t| [pu] for an E_fd that equals the field current, as it does in steady state."""
        self.value = if_else(self._left_out, self._measure(nearly, seen.i), self._state)
        """The measured voltage [pu, S_n]."""

    def _measure(self, v_t: Phasor, i: Phasor) -> Expr:
        return (v_t + self._impedance * i).magnitude()

    def reference(self, at_start: Scalar) -> Expr:
        """The reference, above the measured voltage by ``at_start`` in steady state [pu, S_n]."""
        m = self._m
        V_ref = m.calculated(
            "V_ref",
            self.at_start + at_start - self._seen.v_s_0,
            "pu",
            "Voltage reference of the operating point",
            base="S_n",
        )
        return V_ref + m.parameter(
            "delta_V_ref", 0.0, "pu", "Change of the voltage reference", base="S_n", tunable=True
        )

    def error(self, at_start: Scalar) -> Expr:
        """Reference and stabiliser's signal less the measured voltage [pu, S_n]; ``at_start`` in steady state."""
        return self.reference(at_start) + self._seen.v_s - self.value

    def close(self, E_fd: Expr) -> tuple[Expr, Expr]:
        """(E_fd, |v_t|) of the exciter."""
        v_t = self._seen.terminal(E_fd)
        measured = self._measure(v_t, self._seen.i)
        self._m.derivative(self._state, (measured - self._state) / self._T_R)
        return E_fd, v_t.magnitude()


def lead_lag_stage(
    m: ModelBuilder, u: Expr, initial: Scalar, mark: str = "", lead: float = 0.0
) -> Expr:
    """(1 + s·T_C)/(1 + s·T_B), passed through where T_B = 0, which needs T_C = 0.

    ``u``, ``initial``: what goes in, and its value in steady state; ``mark``: follows C and B in the parameters' names;
    ``lead``: default of T_C [s]; T_B is ten seconds then, otherwise 0."""
    T_C = time(m, f"T_C{mark}", lead, f"Lead T_C{mark}")
    T_B = time(m, f"T_B{mark}", 10.0 if lead else 0.0, f"Lag T_B{mark}; 0 leaves the stage out")
    m.require(
        if_else(logic_and(T_B <= 0, T_C > 0), -1, 1),
        f"exciter.T_B{mark} = 0 needs exciter.T_C{mark} = 0 as well",
    )
    return lead_lag(m, f"lead_lag{mark}", u, T_C, T_B, initial)


def rate_feedback(
    m: ModelBuilder,
    u: Expr,
    initial: Scalar,
    K_F: float = 0.0,
    T_F: float = 1.0,
    name: str = "feedback",
) -> tuple[Expr, Expr]:
    """s·K_F/(1 + s·T_F) of a signal, and K_F."""
    gain_F = gain(m, "K_F", K_F, "Rate feedback; 0 leaves it out", 0)
    lag = lag_of_feedback(m, time(m, "T_F", T_F, "Lag of the rate feedback"), gain_F)
    x = m.state(name, initial, "pu", "rate feedback, slow part of the signal", base=E_FD)
    m.derivative(x, (u - x) / lag)
    return gain_F / lag * (u - x), gain_F


def lag_of_feedback(m: ModelBuilder, T: Expr, acts: Expr) -> Expr:
    """Return the lag [s] of a rate feedback, which is 0 in data without one; ``acts``: its gain [pu]."""
    rule = f"{T.name()} must be above 0 where the rate feedback has a gain: raise it, or take 0 as the gain"
    m.require(if_else(logic_and(T <= 0, acts > 0), -1, 1), rule)
    return if_else(T <= 0, BYPASS_TIME, T)


class Controller:
    """K_PR + K_IR/s + s·K_DR/(1+sT_DR) of an error, the sum within limits; the integral stops at them.

    T_DR = 0 leaves the derivative out; without limits it is K_PR + K_IR/s alone. ``error_at_start``: 0, or what
    it takes without an integral."""

    def __init__(
        self,
        m: ModelBuilder,
        gains: Given,
        at_start: Expr,
        limits: tuple[Expr, Expr] | None = None,
    ) -> None:
        m.require(gains.K_PR + gains.K_IR - 1e-9, "exciter: one of K_PR and K_IR must exceed 0")
        self._m, self._gains, self._limits = m, gains, limits
        self._integrates = gains.K_IR > 0
        self._at_start = at_start
        proportional = at_start / fmax(gains.K_PR, 1e-9)
        self.error_at_start = if_else(self._integrates, 0, proportional)

    def __call__(self, error: Expr) -> Expr:
        """The controller's output."""
        m, gains = self._m, self._gains
        initial = if_else(self._integrates, self._at_start, 0)
        if self._limits is None:
            return proportional_integral(m, "regulator", error, gains.K_PR, gains.K_IR, initial)
        low, high = self._limits
        kept = limited_proportional_integral(
            m, "regulator", error, gains.K_PR, gains.K_IR, low=low, high=high, initial=initial
        )
        has_derivative = gains.T_DR > 0
        lag = if_else(has_derivative, gains.T_DR, BYPASS_TIME)
        change = washout(m, "derivative", error, lag, self.error_at_start)
        return clamp(kept + if_else(has_derivative, gains.K_DR / lag, 0) * change, low, high)


require_within = partial(
    declarations.require_between,
    rule="so the generator cannot hold its voltage; change the limit, the gain, or the generator's voltage and "
    "reactive power",
)


def exciter_saturation(
    m: ModelBuilder, E_1: float, S_E1: float, E_2: float, S_E2: float
) -> "ExciterSaturation":
    """Declare two points (E, S_E(E)) of the exciter's saturation curve."""
    E = [
        m.parameter(
            f"E_{k}",
            value,
            "pu",
            f"Point {k} of the saturation curve",
            base=E_FD,
            minimum=0,
            source=SOURCE,
        )
        for k, value in ((1, E_1), (2, E_2))
    ]
    S = [
        m.parameter(
            f"S_E{k}", value, "1", f"Saturation S_E(E_{k}); both 0: none", minimum=0, source=SOURCE
        )
        for k, value in ((1, S_E1), (2, S_E2))
    ]
    points = ((E[0], S[0]), (E[1], S[1]))
    saturation.require_rising(m, *points, "exciter.E_1, S_E1, E_2, S_E2")
    return ExciterSaturation(points)


class ExciterSaturation:
    """S_E(E)·E through two points."""

    def __init__(self, points: tuple[tuple[Expr, Expr], tuple[Expr, Expr]]) -> None:
        self._points = points

    def part(self, E: Expr) -> Expr:
        """S_E(E)·E [pu]; 0 for a negative voltage."""
        return saturation.saturated_part(E, *self._points)


_SHARE_AT_START = 0.1
"""V_R of the start over V_RMAX, for which a program chooses K_E where the data have none."""


def constant_of_field(
    m: ModelBuilder, K_E: Expr, high: Expr, curve: "ExciterSaturation", E_0: Expr
) -> Expr:
    """K_E as it is given, or so that V_R of the operating point is a tenth of its upper limit.

    ``K_E``: as it is given [pu]; ``high``: upper limit of V_R; ``E_0``: field voltage of the operating point."""
    chosen = m.switch(
        "K_E_of_start",
        False,
        "K_E is such that V_R starts at a tenth of V_RMAX, as PSS/E has it for K_E = 0",
    )
    of_start = (_SHARE_AT_START * high - curve.part(E_0)) / E_0
    return if_else(chosen, of_start, K_E)


def rectifier(I_N: Expr) -> Expr:
    """F_EX(I_N) of a rectifier bridge (IEEE 421.5, annex D), I_N = K_C·I_FD/V_E."""
    middle = sqrt(fmax(0.75 - I_N**2, 0))
    upper = if_else(I_N < 0.75, middle, fmax(1.732 * (1 - I_N), 0))
    return if_else(I_N <= 0, 1, if_else(I_N <= 0.433, 1 - 0.577 * I_N, upper))


def voltage_before_rectifier(E: Expr, loading: Expr) -> Expr:
    """V_E [pu] for which V_E·F_EX(loading/V_E) = E, loading = K_C·I_FD."""
    first = E + 0.577 * loading
    second = sqrt((E**2 + loading**2) / 0.75)
    third = E / 1.732 + loading
    later = if_else(loading < 0.75 * second, second, third)
    return if_else(loading <= 0.433 * first, first, later)
