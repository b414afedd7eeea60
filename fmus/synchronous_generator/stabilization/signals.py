"""Signals that stabilisers take, by the numbers of PSS/E's records, and the band of voltages that they act in."""

from fmus.synchronous_generator.variants import Shaft
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, fabs, if_else, logic_and, logic_or

SPEED, POWER, VOLTAGE = 1, 3, 5  # numbers of the signals in PSS/E's records


def input_signal(
    m: ModelBuilder, name: str, default: int, shaft: Shaft, *, optional: bool = False
) -> Expr:
    """Return what the stabiliser takes, as its parameter says; 0 in steady state."""
    optional = optional or default == 0
    text = "What it takes: 1 speed, 3 electrical power, 5 voltage" + (
        "; 0 none" if optional else ""
    )
    chosen = m.parameter(
        name, default, "1", text, minimum=0 if optional else SPEED, maximum=VOLTAGE
    )
    known = logic_or(
        _equal(chosen, SPEED), logic_or(_equal(chosen, POWER), _equal(chosen, VOLTAGE))
    )
    known = logic_or(known, _equal(chosen, 0))
    m.require(if_else(known, 1, -1), f"pss.{name} must be 1, 3 or 5")
    return (
        if_else(_equal(chosen, SPEED), shaft.w - 1, 0)
        + if_else(_equal(chosen, POWER), shaft.P_e - shaft.P_e_0, 0)
        + if_else(_equal(chosen, VOLTAGE), shaft.v_t - shaft.v_t_0, 0)
    )


def _equal(value: Expr, number_: int) -> Expr:
    return fabs(value - number_) < 0.5  # numbers of signals are whole


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
