"""Torque of what an induction motor drives, by its speed:

    T = T_0·(A·w² + B·w + C0 + D·w^E)

T_0 follows from the operating point. PSS/E's CIM5 has T_0·w^D, CIM6 all of it, and CIMW the C0 at which the sum is 1
at the operating point.

Source: PowerWorld's guide to PSS/E's load models CIM5, CIM6 and CIMW."""

from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, fmax, if_else

SOURCE = "torque that does not depend on the speed"

LEAST_SPEED = 1e-3
"""Speed [pu] below which a power of it is taken as there: at standstill 0 to a power below 0 is no number."""


def load_torque(m: ModelBuilder, speed: Expr, speed_0: Expr, torque_0: Expr) -> Expr:
    """Declare the law, and return the torque at a speed [pu, S_n]."""

    def number(name: str, start: float, text: str) -> Expr:
        return m.parameter(name, start, "1", text, source=SOURCE)

    A = number("A", 0.0, "Share of the load's torque with the speed's square")
    B = number("B", 0.0, "Share with the speed")
    C0 = number("C0", 0.0, "Share that is constant, unless C0_of_start")
    D = number("D", 1.0, "Share with a power of the speed")
    E = number("E", 0.0, "That power")
    follows = m.switch("C0_of_start", False, "C0 is what A, B and D leave to 1 at the start (CIMW)")

    def moving(w: Expr) -> Expr:
        return A * w**2 + B * w + D * fmax(w, LEAST_SPEED) ** E

    constant = if_else(follows, 1 - moving(speed_0), C0)
    at_start = moving(speed_0) + constant
    m.require(
        at_start,
        "A, B, C0 and D give no torque at the operating point: the load must brake there; give one of them",
    )
    return torque_0 * (moving(speed) + constant) / at_start
