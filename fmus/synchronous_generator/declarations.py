"""Declarations that exciters, governors and stabilisers share."""

from fmus.toolchain.blocks import ROUNDING
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.port_variables import TRANSFORMER
from fmus.toolchain.symbols import Expr, Scalar, if_else
from fmus.toolchain.variables import usual_beside

MACHINE = TRANSFORMER | usual_beside(__file__)
"""Usual ranges of machines, exciters, stabilisers, governors and turbines, by the parameter's full name."""


def per_unit(
    m: ModelBuilder,
    name: str,
    value: float,
    text: str,
    minimum: float | None = None,
    *,
    base: str,
    source: str,
) -> Expr:
    """Declare a gain or limit per unit of a base."""
    return m.parameter(name, value, "pu", text, base=base, minimum=minimum, source=source)


def time_constant(
    m: ModelBuilder, name: str, value: float, text: str, minimum: float = 0.0, *, source: str
) -> Expr:
    """Declare a time constant [s]; where it may be 0, 0 leaves its block out."""
    T = m.parameter(name, value, "s", text, minimum=minimum, source=source)
    if minimum == 0:
        rule = f"{T.name()} must be 0 or longer than half of internal_step"
        m.require(if_else(T <= 0, 1, T - m.internal_step / 2), rule)
    return T


def require_between(
    m: ModelBuilder, value: Scalar, low: Scalar, high: Scalar, names: tuple[str, str], rule: str
) -> None:
    """Refuse an operating point beyond a limit of a signal, whose steady state is ``value``.

    At the limit itself it starts, as in PSS/E."""
    for margin, name, side in ((value - low, names[0], "below"), (high - value, names[1], "above")):
        m.require(
            margin + ROUNDING,
            f"{name}: the operating point of the power flow lies at or {side} this limit, {rule}",
        )
