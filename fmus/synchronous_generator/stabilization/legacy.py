"""IEEEST, ST2CUT, IEE2ST and STAB2A: stabilisers of stability programs that are older than IEEE 421.5.

IEEEST takes one signal, ST2CUT two (`signals`; 0: none), as changes from the operating point, which the washout removes
anyway:

    IEEEST  signal → (1 + A_5·s + A_6·s²)/((1 + A_1·s + A_2·s²)·(1 + A_3·s + A_4·s²))
            → (1+sT_1)/(1+sT_2) → (1+sT_3)/(1+sT_4) → K_S·s·T_5/(1+sT_6) → within limits
    ST2CUT  K_1/(1+sT_1) of the first and K_2/(1+sT_2) of the second signal → s·T_3/(1+sT_4)
            → three times (1+sT_lead)/(1+sT_lag) → within limits

    V_S = 0 while the voltage is above V_CU or below V_CL; 0 leaves either out. ST2CUT's are changes from the start;
    IEE2ST is ST2CUT with voltages themselves.

STAB2A takes the electrical power, less at more power:

    −P_e → (K_2·s·T_2/(1+sT_2))³ → K_4 + K_3/(1+sT_3) → (K_5/(1+sT_5))² → within ± H_LIM

Sources: PowerSimulationsDynamics.jl at d94d74e (IEEEST), ANDES 2.0.0 (IEEEST, ST2CUT), OpenIPSL at 2be0558a (STAB2A,
IEE2ST)."""

from functools import partial

from fmus.synchronous_generator.data_lines import Given, declared, number, power, seconds
from fmus.synchronous_generator.stabilization.signals import (
    NO_SIGNAL,
    SPEED,
    cut_off,
    one_signal,
    two_changes,
)
from fmus.synchronous_generator.stabilization.standard import SOURCE, limited_output, stage
from fmus.synchronous_generator.variants import Shaft
from fmus.toolchain.blocks import clamp, low_pass_or_nothing, second_order, washout
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, if_else, logic_and

IEEEST = (
    number("A_1", 0.0, "Filter, first lag of the first pair", 0, "s"),
    number("A_2", 0.0, "Filter, second lag of the first pair [s²]", 0),
    number("A_3", 0.0, "Filter, first lag of the second pair", 0, "s"),
    number("A_4", 0.0, "Filter, second lag of the second pair [s²]", 0),
    number("A_5", 0.0, "Filter, first lead", 0, "s"),
    number("A_6", 0.0, "Filter, second lead [s²]", 0),
    seconds("T_5", 10.0, "Washout, lead"),
    seconds("T_6", 10.0, "Washout, lag", 1e-3),
    power("K_S", 20.0, "Gain"),
)
ST2CUT = (
    power("K_1", 10.0, "Gain of the first signal"),
    power("K_2", 0.0, "Gain of the second signal"),
    seconds("T_1", 0.0, "Lag of the first signal; 0 leaves it out"),
    seconds("T_2", 0.0, "Lag of the second signal; 0 leaves it out"),
    seconds("T_3", 10.0, "Washout, lead"),
    seconds("T_4", 10.0, "Washout, lag", 1e-3),
)
STAB2A = (
    number("K_2", 1.0, "Gain of each washout"),
    seconds("T_2", 2.0, "Each of the three washouts", 1e-3),
    number("K_3", 0.5, "Gain beside K_4, behind a lag"),
    seconds("T_3", 2.0, "Lag of K_3; 0 leaves it out"),
    number("K_4", 0.5, "Gain without a lag"),
    number("K_5", 1.0, "Gain of each output lag"),
    seconds("T_5", 0.05, "Each of the two output lags; 0 leaves them out"),
    power("H_LIM", 0.1, "Limit of the signal", 0),
)


def ieeest(m: ModelBuilder, shaft: Shaft) -> Expr:
    """Declare the stabiliser and return its signal to the voltage regulator [pu]."""
    with m.scope("pss"):
        signal = one_signal(m, shaft, SPEED)
        p = declared(m, IEEEST, SOURCE)
        signal = _filter(m, p, signal)
        signal = stage(m, signal, 1, ("T_1", "T_2"), (0.1, 0.02))
        signal = stage(m, signal, 2, ("T_3", "T_4"), (0.1, 0.02))
        signal = p.K_S * p.T_5 / p.T_6 * washout(m, "washout", signal, p.T_6)
        return cut_off(m, limited_output(m, signal), shaft.v_t, Expr(0))


def st2cut(m: ModelBuilder, shaft: Shaft, *, of_changes: bool = True) -> Expr:
    """Declare the stabiliser and return its signal to the voltage regulator [pu].

    ``of_changes``: whether V_CU and V_CL are changes from the voltage at the start."""
    with m.scope("pss"):
        one, other = two_changes(m, shaft, SPEED, NO_SIGNAL)
        p = declared(m, ST2CUT, SOURCE)
        signal = p.K_1 * low_pass_or_nothing(m, "transducer_1", one, p.T_1)
        signal += p.K_2 * low_pass_or_nothing(m, "transducer_2", other, p.T_2)
        signal = p.T_3 / p.T_4 * washout(m, "washout", signal, p.T_4)
        signal = stage(m, signal, 1, ("T_lead_1", "T_lag_1"), (0.1, 0.02))
        signal = stage(m, signal, 2, ("T_lead_2", "T_lag_2"), (0.1, 0.02))
        signal = stage(m, signal, 3, ("T_lead_3", "T_lag_3"), (0.0, 0.0))
        beside = shaft.v_t_0 if of_changes else Expr(0)
        return cut_off(m, limited_output(m, signal), shaft.v_t, beside)


iee2st = partial(st2cut, of_changes=False)  # ST2CUT with a band of voltages themselves


def stab2a(m: ModelBuilder, shaft: Shaft) -> Expr:
    """Declare the stabiliser and return its signal to the voltage regulator [pu]."""
    with m.scope("pss"):
        enabled = m.switch(
            "enabled", True, "Adds the stabiliser's signal to the voltage reference", tunable=True
        )
        p = declared(m, STAB2A, SOURCE)
        signal = shaft.P_e_0 - shaft.P_e
        for number_ in (1, 2, 3):
            signal = p.K_2 * washout(m, f"washout_{number_}", signal, p.T_2)
        signal = p.K_4 * signal + p.K_3 * low_pass_or_nothing(m, "slow", signal, p.T_3)
        for number_ in (1, 2):
            signal = p.K_5 * low_pass_or_nothing(m, f"output_{number_}", signal, p.T_5)
        return enabled * clamp(signal, -p.H_LIM, p.H_LIM)


def _filter(m: ModelBuilder, p: Given, u: Expr) -> Expr:
    """The filter as a pair of second order with all leads, and another without.

    Two lags of different pairs are one pair together, so that it can have both leads."""
    of_first, of_second = p.A_2 > 0, p.A_4 > 0
    merged = (p.A_1 + p.A_3, p.A_1 * p.A_3)
    one = [
        if_else(of_first, a, if_else(of_second, b, both))
        for a, b, both in zip((p.A_1, p.A_2), (p.A_3, p.A_4), merged, strict=True)
    ]
    other = [
        if_else(of_first, b, if_else(of_second, a, 0))
        for a, b in zip((p.A_1, p.A_2), (p.A_3, p.A_4), strict=True)
    ]
    shortest = m.internal_step / 2
    for first, second in (one, other):
        fine = if_else(
            second > 0, second / if_else(first > 0, first, 1) - shortest, first - shortest
        )
        m.require(
            if_else(logic_and(first <= 0, second <= 0), 1, fine),
            "pss: each pair of A_1 and A_2, A_3 and A_4 must be 0 or slower than half of internal_step",
        )
    m.require(
        if_else(logic_and(p.A_6 > 0, one[1] <= 0), -1, 1),
        "pss.A_6 > 0 needs two lags of A_1 to A_4",
    )
    m.require(if_else(logic_and(p.A_5 > 0, one[0] + one[1] <= 0), -1, 1), "pss.A_5 > 0 needs a lag")
    led = second_order(m, "filter", u, (one[0], one[1]), (p.A_5, p.A_6))
    return second_order(m, "filter_2", led, (other[0], other[1]), (Expr(0), Expr(0)))
