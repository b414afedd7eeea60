"""Whether the PLL runs: it stands while the voltage is low, and runs again only once the voltage is clearly back."""

from fmus.gfl_l2ep.electrical import COLIB
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, if_else

MEMORY = 1e-3
"""Time constant [s] of the state that remembers; it passes the middle 0.7 ms after a threshold."""


def running(m: ModelBuilder, v: Expr) -> Expr:
    """1 while the PLL runs, 0 while it stands: below ``V_low``, and from there until ``V_high``.

    ``v``: magnitude of the bus voltage [pu]."""
    with m.scope("pll"), m.scope("freezing"):
        low = m.parameter(
            "V_low", 0.4, "pu", "Voltage below which the PLL stands; 0: never", base="bus", minimum=0.0, source=COLIB
        )
        high = m.parameter("V_high", 0.5, "pu", "Voltage above which it runs again", base="bus", source=COLIB)
        m.require(high - low, "pll.freezing.V_high must be above pll.freezing.V_low")
        awake = m.state("awake", 1.0, "1", "Memory of the thresholds: the PLL runs above 0.5")
        runs = if_else(awake > 0.5, 1.0, 0.0)
        m.derivative(awake, (if_else(v < low, 0.0, if_else(v > high, 1.0, runs)) - awake) / MEMORY)
    return runs
