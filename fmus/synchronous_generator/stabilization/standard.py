"""PSS1A, PSS2A, PSS2B and PSS2C.

PSS1A takes one signal (`signals`), and is cut off as IEEEST is; of the speed it is STAB1 too:

    signal → 1/(1+sT_6) → K_S·s·T_5/(1+sT_5) → 1/(1 + A_1·s + A_2·s²)
    → (1+sT_1)/(1+sT_2) → (1+sT_3)/(1+sT_4) → V_STMIN ≤ V_S ≤ V_STMAX

PSS2A and PSS2B take the integral of accelerating power, from speed and electrical power, or from two other signals of
PSS/E's (`signals`) in their place:

    speed  w − 1 → limits → s·T_w1/(1+sT_w1) → s·T_w2/(1+sT_w2) → 1/(1+sT_6)
    power  P_e → limits → s·T_w3/(1+sT_w3) → s·T_w4/(1+sT_w4) → K_s2/(1+sT_7)
    (speed + K_s3·power) → (1+sT_8)/(1+sT_9)^5 → − power → K_s1
    → (1+sT_1)/(1+sT_2) → (1+sT_3)/(1+sT_4) → (1+sT_10)/(1+sT_11) → V_STMIN ≤ V_S ≤ V_STMAX

The limits of the inputs, V_SI1MIN … V_SI2MAX, of the speed's deviation and of the power itself, and the third stage are
PSS2B's; PSS2C has a fourth, (1+sT_12)/(1+sT_13), and acts from P_e = P_on on until P_e falls below P_off. A block whose
time constant is 0 is left out. M = 5 and N = 1 of the ramp-tracking filter."""

from functools import partial

from fmus.synchronous_generator.declarations import per_unit, time_constant
from fmus.synchronous_generator.stabilization.norm631 import RAMP_LAGS
from fmus.synchronous_generator.stabilization.signals import (
    POWER,
    SPEED,
    Signal,
    cut_off,
    one_signal,
    two_signals,
)
from fmus.synchronous_generator.variants import Shaft
from fmus.toolchain.blocks import (
    RETURN_TIME,
    clamp,
    lead_lag,
    low_pass_or_nothing,
    second_order,
    washout,
    washout_or_nothing,
)
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, fmax, if_else, logic_and, logic_or

SOURCE = "typical data, IEEE 421.5"

_MIDDLE = 0.5  # between the two values of a memory


gain = partial(per_unit, base="S_n", source=SOURCE)
time = partial(time_constant, source=SOURCE)


def stage(
    m: ModelBuilder, u: Expr, number: int, names: tuple[str, str], values: tuple[float, float]
) -> Expr:
    """(1 + s·T_lead)/(1 + s·T_lag), passed through where T_lag = 0, which needs T_lead = 0.

    ``u``: what goes in; 0 in steady state; ``number``: of the stage; ``names``, ``values``: of lead and lag, and their
    defaults [s]."""
    T_lead, T_lag = (
        time(m, names[0], values[0], f"Lead of stage {number}"),
        time(m, names[1], values[1], f"Lag of stage {number}; 0 leaves the stage out"),
    )
    m.require(
        if_else(logic_and(T_lag <= 0, T_lead > 0), -1, 1),
        f"pss.{names[1]} = 0 needs pss.{names[0]} = 0 as well",
    )
    return lead_lag(m, f"lead_lag_{number}", u, T_lead, T_lag)


def limited_output(m: ModelBuilder, signal: Expr) -> Expr:
    """The signal within V_STMIN and V_STMAX, switched by ``enabled``."""
    enabled = m.switch(
        "enabled", True, "Adds the stabiliser's signal to the voltage reference", tunable=True
    )
    high = gain(m, "V_STMAX", 0.1, "Upper limit of the signal", 0)
    low = m.parameter(
        "V_STMIN", -0.1, "pu", "Lower limit of the signal", base="S_n", maximum=0, source=SOURCE
    )
    return enabled * clamp(signal, low, high)


def pss1a(m: ModelBuilder, shaft: Shaft) -> Expr:
    """Declare the stabiliser and return its signal to the voltage regulator [pu]."""
    with m.scope("pss"):
        taken = one_signal(m, shaft, SPEED)
        K_S = gain(m, "K_S", 20.0, "Gain")
        signal = low_pass_or_nothing(
            m, "transducer", taken, time(m, "T_6", 0.0, "Transducer; 0 leaves it out")
        )
        T_5 = m.parameter("T_5", 10.0, "s", "Washout", minimum=1e-3, source=SOURCE)
        signal = K_S * washout(m, "washout", signal, T_5)
        signal = _filter(m, signal)
        signal = stage(m, signal, 1, ("T_1", "T_2"), (0.05, 0.02))
        signal = stage(m, signal, 2, ("T_3", "T_4"), (3.0, 5.4))
        return cut_off(m, limited_output(m, signal), shaft.v_t, Expr(0))


def _filter(m: ModelBuilder, u: Expr) -> Expr:
    """1/(1 + A_1·s + A_2·s²); A_2 = 0 leaves one lag, A_1 = 0 as well none."""
    A_1 = m.parameter("A_1", 0.0, "s", "Filter, first order", minimum=0, source=SOURCE)
    A_2 = m.parameter(
        "A_2", 0.0, "1", "Filter, second order [s²]; 0: first order alone", minimum=0, source=SOURCE
    )
    m.require(if_else(logic_and(A_2 > 0, A_1 <= 0), -1, 1), "pss.A_2 > 0 needs pss.A_1 > 0")
    shortest = m.internal_step / 2
    m.require(
        if_else(logic_or(A_2 > 0, A_1 <= 0), 1, A_1 - shortest),
        "pss.A_1 must be 0 or exceed half of internal_step",
    )
    m.require(
        if_else(A_2 <= 0, 1, A_2 / fmax(A_1, 1e-9) - shortest),
        "pss.A_2/A_1 must exceed half of internal_step",
    )
    return second_order(m, "filter", u, (A_1, A_2), (Expr(0), Expr(0)))


def pss2a(m: ModelBuilder, shaft: Shaft, *, newer: bool = False, newest: bool = False) -> Expr:
    """Declare the stabiliser and return its signal to the voltage regulator [pu].

    ``newer``: whether it has what PSS2B has beyond PSS2A; ``newest``: what PSS2C has beyond PSS2B."""
    with m.scope("pss"):
        one, other = two_signals(m, shaft, SPEED, POWER)
        if newer:
            one, other = _within_limits(m, one, "1"), _within_limits(m, other, "2")
        speed, power = one[0] - one[1], other[0] - other[1]
        speed = washout_or_nothing(
            m, "washout_1", speed, time(m, "T_w1", 2.0, "First washout of the speed")
        )
        speed = washout_or_nothing(
            m, "washout_2", speed, time(m, "T_w2", 2.0, "Second washout of the speed")
        )
        speed = low_pass_or_nothing(m, "speed", speed, time(m, "T_6", 0.0, "Lag of the speed"))
        power = washout_or_nothing(
            m, "washout_3", power, time(m, "T_w3", 2.0, "First washout of the power")
        )
        power = washout_or_nothing(
            m, "washout_4", power, time(m, "T_w4", 0.0, "Second washout of the power")
        )
        power = gain(m, "K_s2", 0.2, "Gain of the power, T_7/2H") * low_pass_or_nothing(
            m, "integrator", power, time(m, "T_7", 2.0, "Lag of the power, which integrates it")
        )
        K_s3 = gain(m, "K_s3", 1.0, "Power in the ramp filter")
        signal = _ramp_filter(m, speed + K_s3 * power)
        signal = gain(m, "K_s1", 10.0, "Gain of the stabiliser") * (signal - power)
        signal = stage(m, signal, 1, ("T_1", "T_2"), (0.25, 0.03))
        signal = stage(m, signal, 2, ("T_3", "T_4"), (0.15, 0.015))
        if newer:
            signal = stage(m, signal, 3, ("T_10", "T_11"), (0.0, 0.0))
        if not newest:
            return limited_output(m, signal)
        signal = limited_output(m, stage(m, signal, 4, ("T_12", "T_13"), (0.0, 0.0)))
        return if_else(_is_active(m, shaft.P_e, shaft.P_e_0), signal, 0)


pss2b = partial(pss2a, newer=True)  # PSS2A with limited inputs and a third stage
pss2c = partial(pss2a, newer=True, newest=True)  # PSS2B with a fourth, and off at little power


def _within_limits(m: ModelBuilder, signal: Signal, number: str) -> Signal:
    """The signal itself within its limits, and so its steady value."""
    text = f"limit of signal {number} itself, not of its change"
    low = m.parameter(f"V_SI{number}MIN", -2.0, "pu", f"Lower {text}", base="S_n")
    high = m.parameter(f"V_SI{number}MAX", 2.0, "pu", f"Upper {text}", base="S_n")
    m.require(high - low, f"pss.V_SI{number}MAX must exceed pss.V_SI{number}MIN")
    return clamp(signal[0], low, high), clamp(signal[1], low, high)


def _is_active(m: ModelBuilder, P_e: Expr, P_e_0: Expr) -> Expr:
    """Tell if the stabiliser acts: from P_on on, until the power falls below P_off.

    The state is a memory: it goes to 1 or 0, whichever the power asks for or it is nearer to."""
    on = gain(m, "P_on", 0.0, "Electrical power from which on there is a signal; 0: always", 0)
    off = gain(m, "P_off", 0.0, "Electrical power below which there is none any more", 0)
    starts = if_else(logic_or(on <= 0, P_e_0 >= off), 1, 0)
    memory = m.state("is_active", starts, "1", "Whether the stabiliser acts, 1 or 0")
    kept = if_else(memory > _MIDDLE, 1, 0)
    wanted = if_else(P_e < off, 0, kept)
    wanted = if_else(logic_or(on <= 0, P_e >= on), 1, wanted)
    m.derivative(memory, (wanted - memory) / RETURN_TIME)
    return memory > _MIDDLE


def _ramp_filter(m: ModelBuilder, u: Expr) -> Expr:
    T_8 = time(m, "T_8", 0.5, "Ramp-tracking filter, lead")
    T_9 = time(m, "T_9", 0.1, "Ramp-tracking filter, each of its five lags; 0 leaves it out")
    m.require(if_else(logic_and(T_9 <= 0, T_8 > 0), -1, 1), "pss.T_9 = 0 needs pss.T_8 = 0 as well")
    u = lead_lag(m, "ramp_1", u, T_8, T_9)
    for number in range(2, RAMP_LAGS + 1):
        u = low_pass_or_nothing(m, f"ramp_{number}", u, T_9)
    return u
