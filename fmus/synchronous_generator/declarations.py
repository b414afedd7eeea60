"""Declarations that exciters, governors and stabilisers share."""

from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, Scalar, if_else


def time_constant(m: ModelBuilder, name: str, value: float, text: str, minimum: float = 0.0, *, source: str) -> Expr:
    """Declare a time constant [s]; where it may be 0, 0 leaves its block out."""
    T = m.parameter(name, value, "s", text, minimum=minimum, source=source)
    if minimum == 0:
        rule = f"{T.name()} must be 0 or longer than half of internal_step"
        m.require(if_else(T <= 0, 1, T - m.internal_step / 2), rule)
    return T


def require_between(
    m: ModelBuilder, value: Scalar, low: Scalar, high: Scalar, names: tuple[str, str], rule: str
) -> None:
    """Refuse an operating point at or beyond a limit of a signal, whose steady state is ``value``."""
    for margin, name, side in ((value - low, names[0], "below"), (high - value, names[1], "above")):
        m.require(margin, f"{name}: the operating point of the power flow lies at or {side} this limit, {rule}")
