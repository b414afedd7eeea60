"""Signals that stabilisers take, by the numbers of PSS/E's records, and the band of voltages that they act in.

    1  speed, w − 1                        4  accelerating power, P_m − P_e
    2  frequency of the bus, less 1        5  voltage
    3  electrical power                    6  rate of the voltage [pu/s]

all at the machine's terminal, on S_n. Frequency and rate are derivatives behind a filter, s/(1 + s·T_f), of the
voltage's angle over ω_b and of its magnitude. PSS/E filters the frequency of every bus with one time constant of the
whole run, 0.04 s in recorded scripts (`psspy.dynamics_solution_param_2`, its fourth real); T_f has it.

Sources of the numbers: ANDES 2.0.0 (IEEEST, ST2CUT), PowerSystems.jl (IEEEST)."""

from collections.abc import Mapping

from fmus.synchronous_generator.variants import Shaft
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, fabs, if_else, logic_and, logic_or

NO_SIGNAL, SPEED, FREQUENCY, POWER, ACCELERATING, VOLTAGE, RATE = range(7)
"""Numbers of the signals in PSS/E's records."""

_FILTER = 0.04  # of PSS/E's bus frequency [s]
_NEAR = 1e-6  # numbers of signals are whole

Signal = tuple[Expr, Expr]
"""A signal, and its value in steady state."""


def one_signal(m: ModelBuilder, shaft: Shaft, default: int) -> Expr:
    """Return what the stabiliser takes, as its parameter ``signal`` says; 0 in steady state."""
    ((now, steady),) = _signals(m, shaft, {"signal": default}, least=SPEED)
    return now - steady


def two_signals(m: ModelBuilder, shaft: Shaft, first: int, second: int) -> tuple[Signal, Signal]:
    """Return what the stabiliser takes, as its parameters ``signal_1`` and ``signal_2`` say; 0 is none."""
    one, other = _signals(m, shaft, {"signal_1": first, "signal_2": second}, least=NO_SIGNAL)
    return one, other


def two_changes(m: ModelBuilder, shaft: Shaft, first: int, second: int) -> tuple[Expr, Expr]:
    """Return `two_signals` less their steady values."""
    (one, one_0), (other, other_0) = two_signals(m, shaft, first, second)
    return one - one_0, other - other_0


def _signals(
    m: ModelBuilder, shaft: Shaft, defaults: Mapping[str, int], *, least: int
) -> list[Signal]:
    text = (
        "What it takes: 1 speed, 2 frequency of the bus, 3 electrical power, 4 accelerating power, 5 voltage, "
        "6 rate of the voltage" + ("; 0 none" if least == NO_SIGNAL else "")
    )
    numbers = {
        name: m.parameter(name, default, "1", text, minimum=least, maximum=RATE)
        for name, default in defaults.items()
    }
    T_f = m.parameter(
        "T_f", _FILTER, "s", "Filter of the bus frequency and of the voltage's rate", minimum=1e-3
    )
    return [_signal(m, shaft, name, number, T_f) for name, number in numbers.items()]


def _signal(m: ModelBuilder, shaft: Shaft, name: str, number: Expr, T_f: Expr) -> Signal:
    derivative = _derivative(m, shaft, name, number, T_f)
    values: dict[int, Signal] = {
        SPEED: (shaft.w - 1, Expr(0)),
        FREQUENCY: (derivative, Expr(0)),
        POWER: (shaft.P_e, shaft.P_e_0),
        ACCELERATING: (shaft.P_m - shaft.P_e, shaft.P_m_0 - shaft.P_e_0),
        VOLTAGE: (shaft.v_t, shaft.v_t_0),
        RATE: (derivative, Expr(0)),
    }
    now, steady, known = Expr(0), Expr(0), _equal(number, NO_SIGNAL)
    for signal, (value, start) in values.items():
        chosen = _equal(number, signal)
        now += if_else(chosen, value, 0)
        steady += if_else(chosen, start, 0)
        known = logic_or(known, chosen)
    m.require(if_else(known, 1, -1), f"{number.name()} must be a whole number")
    return now, steady


def _derivative(m: ModelBuilder, shaft: Shaft, name: str, number: Expr, T_f: Expr) -> Expr:
    """The derivative of what the signal is one of, behind a filter; 0 of the others."""
    u = if_else(_equal(number, FREQUENCY), shaft.phase, 0)
    u += if_else(_equal(number, RATE), shaft.v_t - shaft.v_t_0, 0)
    slow = m.state(f"{name}_slow", 0.0, "1", "slow part of what is derived")
    m.derivative(slow, (u - slow) / T_f)
    return (u - slow) / T_f


def _equal(value: Expr, number: int) -> Expr:
    return fabs(value - number) < _NEAR


def cut_off(m: ModelBuilder, signal: Expr, v_t: Expr, beside: Expr) -> Expr:
    """The signal while the voltage is between V_CL and V_CU, which are ``beside`` a voltage; else 0."""
    high = m.parameter(
        "V_CU", 0.0, "pu", "Voltage above which there is no signal; 0: none", base="S_n"
    )
    low = m.parameter(
        "V_CL", 0.0, "pu", "Voltage below which there is no signal; 0: none", base="S_n"
    )
    above = logic_and(fabs(high) > 0, v_t > high + beside)
    below = logic_and(fabs(low) > 0, v_t < low + beside)
    return if_else(logic_or(above, below), 0, signal)
