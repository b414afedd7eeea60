"""PSS3B and PSS4B (IEEE 421.5): stabilisers of two signals, summed, and of three bands of frequencies.

PSS3B takes two signals (`signals`; 0: none):

    K_S1/(1+sT_1) → s·T_w1/(1+sT_w1) of the first, K_S2/(1+sT_2) → s·T_w2/(1+sT_w2) of the second signal
    sum → s·T_w3/(1+sT_w3) → (1 + A_1·s + A_2·s²)/(1 + A_3·s + A_4·s²) → the same of A_5 to A_8
    → within V_STMIN and V_STMAX

PSS4B takes the speed for its low and intermediate band, and a speed made of the electrical power for its high band:

    low, intermediate  w − 1 → (1 + a_LI1·s + a_LI2·s²)/(1 + b_LI1·s + b_LI2·s²) → two notches
    high               P_e → 1/(1+sT_H) → −s²/(1 + b_H1·s + b_H2·s²)/(M·s) → two notches
    notch              (s² + w²)/(s² + B·s + w²), left out with w = 0
    band               K·(K_1·(K_11 + sT_1)/(1+sT_2)·(1+sT_3)/(1+sT_4)·(1+sT_5)/(1+sT_6)
                          − K_2·(K_17 + sT_7)/(1+sT_8)·(1+sT_9)/(1+sT_10)·(1+sT_11)/(1+sT_12)), within V_MIN and V_MAX

and their sum within V_STMIN and V_STMAX; each name has the band's letter behind its own: K_L1, T_I3, V_HMAX.
Sources: IEEE 421.5; dynawo at 34416d4 (PSS3B), InterPSS at 2b791e9 (the order of PSS4B's figures)."""

from collections.abc import Sequence

from fmus.synchronous_generator.data_lines import Line, declared, number, power, seconds
from fmus.synchronous_generator.stabilization.signals import POWER, SPEED, two_changes
from fmus.synchronous_generator.stabilization.standard import SOURCE, limited_output
from fmus.synchronous_generator.variants import Shaft
from fmus.toolchain.blocks import (
    BYPASS_TIME,
    clamp,
    lead_lag,
    low_pass_or_nothing,
    second_order,
    washout,
    washout_or_nothing,
)
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, if_else, logic_and, logic_or, sqrt

PSS3B = (
    power("K_S1", 0.0, "Gain of the first signal"),
    seconds("T_1", 0.0, "Lag of the first signal; 0 leaves it out"),
    seconds("T_w1", 10.0, "Washout of the first signal; 0 leaves it out"),
    power("K_S2", 1.0, "Gain of the second signal"),
    seconds("T_2", 0.0, "Lag of the second signal; 0 leaves it out"),
    seconds("T_w2", 10.0, "Washout of the second signal; 0 leaves it out"),
    seconds("T_w3", 10.0, "Washout of the sum", 1e-3),
    *(
        number(f"A_{k}", 0.0, text, 0, unit)
        for k, text, unit in (
            (1, "First filter, first lead", "s"),
            (2, "First filter, second lead [s²]", "1"),
            (3, "First filter, first lag; 0 and A_4 = 0 leave it out", "s"),
            (4, "First filter, second lag [s²]", "1"),
            (5, "Second filter, first lead", "s"),
            (6, "Second filter, second lead [s²]", "1"),
            (7, "Second filter, first lag; 0 and A_8 = 0 leave it out", "s"),
            (8, "Second filter, second lag [s²]", "1"),
        )
    ),
)
TRANSDUCERS = (
    number("a_LI1", -1.759e-3, "Transducer of the speed, first lead", unit="s"),
    number("a_LI2", 0.0, "Transducer of the speed, second lead [s²]"),
    number("b_LI1", 1.7823e-2, "Transducer of the speed, first lag", 0, "s"),
    number("b_LI2", 1.2739e-4, "Transducer of the speed, second lag [s²]", 0),
    number("B_LI1", 0.0, "Width of the first notch of the speed", 0, "rad/s"),
    number("w_LI1", 0.0, "First notch of the speed; 0: none", 0, "rad/s"),
    number("B_LI2", 0.0, "Width of the second notch of the speed", 0, "rad/s"),
    number("w_LI2", 0.0, "Second notch of the speed; 0: none", 0, "rad/s"),
    seconds("T_H", 0.0125, "Lag of the power; 0 leaves it out"),
    number("b_H1", 2.0, "Transducer of the power, first lag", 1e-3, "s"),
    number("b_H2", 1.0, "Transducer of the power, second lag [s²]", 1e-6),
    seconds("M", 12.0, "Twice the inertia constant", 1e-3),
    number("B_H1", 0.0, "Width of the first notch of the power", 0, "rad/s"),
    number("w_H1", 0.0, "First notch of the power; 0: none", 0, "rad/s"),
    number("B_H2", 0.0, "Width of the second notch of the power", 0, "rad/s"),
    number("w_H2", 0.0, "Second notch of the power; 0: none", 0, "rad/s"),
)
_BANDS = {
    "L": ("low", 7.5, 1.73, 0.075),
    "I": ("intermediate", 30.0, 0.173, 0.15),
    "H": ("high", 120.0, 0.0173, 0.15),
}
"""Letter of a band: its name, gain, first lag [s] and limit [pu] in the standard's sample."""

_SPREAD = 1.2  # of the sample's time constants, so that the two branches of a band lie side by side
_BRANCH_GAIN = 66.0  # K_1 and K_2 of the sample


def _band_lines(letter: str) -> Sequence[Line]:
    """Parameters of one band."""
    name, gain, lag, limit = _BANDS[letter]
    lags = {1: lag, 2: lag * _SPREAD, 7: lag * _SPREAD, 8: lag * _SPREAD**2}
    times = [
        seconds(f"T_{letter}{k}", lags.get(k, 0.0), f"Time constant {k} of the {name} band")
        for k in range(1, 13)
    ]
    return (
        power(f"K_{letter}1", _BRANCH_GAIN, f"Gain of branch 1 of the {name} band"),
        power(f"K_{letter}2", _BRANCH_GAIN, f"Gain of branch 2 of the {name} band"),
        number(f"K_{letter}11", 1.0, f"Constant of branch 1 of the {name} band"),
        number(f"K_{letter}17", 1.0, f"Constant of branch 2 of the {name} band"),
        *times,
        power(f"K_{letter}", gain, f"Gain of the {name} band"),
        power(f"V_{letter}MAX", limit, f"Upper limit of the {name} band"),
        power(f"V_{letter}MIN", -limit, f"Lower limit of the {name} band"),
    )


def pss3b(m: ModelBuilder, shaft: Shaft) -> Expr:
    """Declare the stabiliser and return its signal to the voltage regulator [pu]."""
    with m.scope("pss"):
        one, other = two_changes(m, shaft, POWER, SPEED)
        p = declared(m, PSS3B, SOURCE)
        one = low_pass_or_nothing(m, "transducer_1", p.K_S1 * one, p.T_1)
        other = low_pass_or_nothing(m, "transducer_2", p.K_S2 * other, p.T_2)
        signal = washout_or_nothing(m, "washout_1", one, p.T_w1)
        signal += washout_or_nothing(m, "washout_2", other, p.T_w2)
        signal = washout(m, "washout_3", signal, p.T_w3)
        for k, lags, leads in (
            (1, (p.A_3, p.A_4), (p.A_1, p.A_2)),
            (2, (p.A_7, p.A_8), (p.A_5, p.A_6)),
        ):
            _require_lags(m, lags, leads, k)
            signal = second_order(m, f"filter_{k}", signal, lags, leads)
        return limited_output(m, signal)


def _require_lags(
    m: ModelBuilder, lags: tuple[Expr, Expr], leads: tuple[Expr, Expr], number_: int
) -> None:
    """Refuse a filter that has leads without as many lags, or lags too fast for the internal step."""
    shortest = m.internal_step / 2
    fine = if_else(
        lags[1] > 0, lags[1] / if_else(lags[0] > 0, lags[0], 1) - shortest, lags[0] - shortest
    )
    m.require(
        if_else(logic_and(lags[0] <= 0, lags[1] <= 0), 1, fine),
        f"pss: the lags of filter {number_} must be 0 or slower than half of internal_step",
    )
    short = logic_or(
        logic_and(leads[1] > 0, lags[1] <= 0), logic_and(leads[0] > 0, lags[0] + lags[1] <= 0)
    )
    m.require(if_else(short, -1, 1), f"pss: filter {number_} needs a lag for each of its leads")


def pss4b(m: ModelBuilder, shaft: Shaft) -> Expr:
    """Declare the stabiliser and return its signal to the voltage regulator [pu]."""
    with m.scope("pss"):
        p = declared(m, TRANSDUCERS, SOURCE)
        speed = second_order(m, "speed", shaft.w - 1, (p.b_LI1, p.b_LI2), (p.a_LI1, p.a_LI2))
        lagged = low_pass_or_nothing(m, "power", shaft.P_e - shaft.P_e_0, p.T_H)
        made = -_band_pass(m, "made_speed", lagged, p.b_H1, p.b_H2) / p.M
        for k, (B_LI, w_LI, B_H, w_H) in enumerate(
            ((p.B_LI1, p.w_LI1, p.B_H1, p.w_H1), (p.B_LI2, p.w_LI2, p.B_H2, p.w_H2)), start=1
        ):
            speed = _notch(m, f"notch_LI{k}", speed, B_LI, w_LI)
            made = _notch(m, f"notch_H{k}", made, B_H, w_H)
        signal = sum(
            (_band(m, letter, made if letter == "H" else speed) for letter in _BANDS), Expr(0)
        )
        return limited_output(m, signal)


def _band_pass(m: ModelBuilder, name: str, u: Expr, a_1: Expr, a_2: Expr) -> Expr:
    """s/(1 + a_1·s + a_2·s²)."""
    root = sqrt(a_2)
    x = m.state(name, 0.0, "pu", "filter", base="S_n")
    y = m.state(f"{name}_rate", 0.0, "pu", "filter, its rate times the root of a_2", base="S_n")
    m.derivative(x, y / root)
    m.derivative(y, (u - x - a_1 * y / root) / root)
    return y / root


def _notch(m: ModelBuilder, name: str, u: Expr, B: Expr, w: Expr) -> Expr:
    """(s² + w²)/(s² + B·s + w²), passed through where w = 0."""
    left_out = w <= 0
    square = if_else(left_out, 1 / BYPASS_TIME**2, w**2)
    width = if_else(left_out, 2 / BYPASS_TIME, B)
    y = second_order(m, name, u, (width / square, 1 / square), (Expr(0), 1 / square))
    return if_else(left_out, u, y)


def _band(m: ModelBuilder, letter: str, u: Expr) -> Expr:
    """Return the signal of one band, within its limits."""
    p = declared(m, _band_lines(letter), SOURCE)
    value = {line.name: getattr(p, line.name) for line in _band_lines(letter)}
    branches = [
        _branch(m, f"{letter}{first}", value[f"K_{letter}{gain}"] * u, value, constant, first)
        for gain, constant, first in ((1, f"K_{letter}11", 1), (2, f"K_{letter}17", 7))
    ]
    signal = value[f"K_{letter}"] * (branches[0] - branches[1])
    return clamp(signal, value[f"V_{letter}MIN"], value[f"V_{letter}MAX"])


def _branch(
    m: ModelBuilder, name: str, u: Expr, value: dict[str, Expr], constant: str, first: int
) -> Expr:
    """(K + sT)/(1+sT) and two leads and lags, from the time constant with this number on."""
    letter = name[0]
    T = [value[f"T_{letter}{k}"] for k in range(first, first + 6)]
    K = value[constant]
    lag = if_else(T[1] > 0, T[1], BYPASS_TIME)
    x = m.state(f"{name}_1", 0.0, "pu", "lead/lag", base="S_n")
    m.derivative(x, (u - x) / lag)
    signal = if_else(T[1] > 0, K * x + T[0] / lag * (u - x), K * u)
    signal = lead_lag(m, f"{name}_2", signal, T[2], T[3])
    return lead_lag(m, f"{name}_3", signal, T[4], T[5])
