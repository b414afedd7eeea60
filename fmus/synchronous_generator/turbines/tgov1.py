"""TGOV1: a governor and a steam turbine with a reheater.

                     ┌─────────┐ V_MAX ┌─────────┐
P_ref − (w − 1)/R ──►│    1    │──────►│ 1 + s·T_2 │──►(+)──► P_m
                     │ 1 + s·T_1 │      │ 1 + s·T_3 │   −▲
                     └─────────┘ V_MIN └─────────┘    D_t·(w − 1)
"""

from fmus.synchronous_generator.turbines.common import power, power_reference, require_within, time
from fmus.toolchain.blocks import lead_lag, limited_low_pass
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, if_else, logic_and


def tgov1(m: ModelBuilder, w: Expr, P_m_0: Expr) -> Expr:
    """Declare governor and turbine and return the mechanical power [pu, S_n].

    ``w``: rotor speed [pu, f_n]; ``P_m_0``: mechanical power at the operating point [pu, S_n]."""
    with m.scope("governor"):
        R = power(m, "R", 0.05, "Droop", 1e-4)
        T_1 = time(m, "T_1", 0.5, "Valve; 0 leaves the lag out")
        high, low = power(m, "V_MAX", 1.0, "Valve, fully open"), power(m, "V_MIN", 0.0, "Valve, closed")
        T_2 = time(m, "T_2", 3.0, "Reheater, lead: T_3 times the high-pressure part")
        T_3 = time(m, "T_3", 10.0, "Reheater; 0 leaves the stage out")
        D_t = power(m, "D_t", 0.0, "Damping of the turbine", 0)
        m.require(if_else(logic_and(T_3 <= 0, T_2 > 0), -1, 1), "governor.T_3 = 0 needs governor.T_2 = 0 as well")
        require_within(m, P_m_0, low, high, ("governor.V_MIN", "governor.V_MAX"))
        valve = limited_low_pass(m, "valve", power_reference(m, P_m_0) - (w - 1) / R, T_1, low, high, P_m_0)
        return lead_lag(m, "reheater", valve, T_2, T_3, P_m_0) - D_t * (w - 1)
