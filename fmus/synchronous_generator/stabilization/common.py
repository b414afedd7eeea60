"""Parts that stabilisers share: parameters, lead/lag stages and the limits of the signal."""

from functools import partial

from fmus.synchronous_generator.declarations import time_constant
from fmus.toolchain.blocks import clamp, lead_lag
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, if_else, logic_and

SOURCE = "typical data, IEEE 421.5"


def gain(m: ModelBuilder, name: str, value: float, text: str, minimum: float | None = None) -> Expr:
    """Declare a gain or limit per unit."""
    return m.parameter(name, value, "pu", text, base="S_n", minimum=minimum, source=SOURCE)


time = partial(time_constant, source=SOURCE)


def stage(m: ModelBuilder, u: Expr, number: int, names: tuple[str, str], values: tuple[float, float]) -> Expr:
    """(1 + s·T_lead)/(1 + s·T_lag), passed through where T_lag = 0, which needs T_lead = 0.

    ``u``: what goes in; 0 in steady state; ``number``: of the stage; ``names``, ``values``: of lead and lag, and their
    defaults [s]."""
    T_lead, T_lag = (
        time(m, names[0], values[0], f"Lead of stage {number}"),
        time(m, names[1], values[1], f"Lag of stage {number}; 0 leaves the stage out"),
    )
    m.require(if_else(logic_and(T_lag <= 0, T_lead > 0), -1, 1), f"pss.{names[1]} = 0 needs pss.{names[0]} = 0 as well")
    return lead_lag(m, f"lead_lag_{number}", u, T_lead, T_lag)


def limited_output(m: ModelBuilder, signal: Expr) -> Expr:
    """The signal within V_STMIN and V_STMAX, switched by ``enabled``."""
    enabled = m.switch("enabled", True, "Adds the stabiliser's signal to the voltage reference", tunable=True)
    high = gain(m, "V_STMAX", 0.1, "Upper limit of the signal", 0)
    low = m.parameter("V_STMIN", -0.1, "pu", "Lower limit of the signal", base="S_n", maximum=0, source=SOURCE)
    return enabled * clamp(signal, low, high)
