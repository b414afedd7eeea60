"""The undervoltage relay of PSS/E's motors: below VI for TI cycles, the breaker opens TB cycles later, for good.

Source: PowerWorld's guide to PSS/E's load models CIM5, CIM6 and CIMW."""

from math import pi

from fmus.toolchain.blocks import BYPASS_TIME, RETURN_TIME
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, if_else, logic_and, logic_or

SOURCE = "no relay"
DECIDED = 0.5  # value of the latch above which it has decided to trip; in rest it is 0
CLOSED = 1.0  # the breaker, as a factor of the current
OPEN = 0.0


def undervoltage_relay(m: ModelBuilder, voltage: Expr, omega_b: Expr) -> Expr:
    """Declare the relay; return 1 while the breaker is closed, else 0."""
    V_I = m.parameter(
        "VI",
        0.0,
        "pu",
        "Voltage below which the undervoltage relay counts; 0: never",
        base="bus",
        minimum=0.0,
        source=SOURCE,
    )
    waits, opens = (
        m.parameter(name, 0.0, "1", f"{text} [cycles of f_n]", minimum=0.0, source=SOURCE)
        for name, text in (
            ("TI", "Time below VI after which the relay trips"),
            ("TB", "Time of the breaker after that"),
        )
    )
    cycle = 2 * pi / omega_b
    low = voltage < V_I
    with m.scope("relay"):
        counted = m.state("counted", 0.0, "s", "Time below VI")
        m.derivative(counted, if_else(low, 1, -counted / BYPASS_TIME))
        latch = m.state("latch", 0.0, "1", "Decision to trip; it holds above 0.5")
        trips = logic_or(logic_and(low, counted >= waits * cycle), latch > DECIDED)
        m.derivative(latch, if_else(trips, (1 - latch) / RETURN_TIME, -latch / BYPASS_TIME))
        opening = m.state("opening", 0.0, "s", "Time since the decision to trip")
        m.derivative(opening, if_else(latch > DECIDED, 1, -opening / BYPASS_TIME))
    return if_else(logic_and(latch > DECIDED, opening >= opens * cycle), OPEN, CLOSED)
