"""GAST: a gas turbine with a limit of its exhaust's temperature.

low value of P_ref − (w − 1)/R and A_T + K_T·(A_T − T_exh)
→ 1/(1+sT_1), held within V_MIN and V_MAX → 1/(1+sT_2) → fuel
P_m = fuel − D_turb·(w − 1),   T_exh = fuel/(1+sT_3)"""

from fmus.synchronous_generator.turbines.common import SOURCE, power, power_reference, require_within, time
from fmus.toolchain.blocks import limited_low_pass, low_pass
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, fmin


def gast(m: ModelBuilder, w: Expr, P_m_0: Expr) -> Expr:
    """Declare governor and turbine and return the mechanical power [pu, S_n]."""
    with m.scope("governor"):
        R = power(m, "R", 0.05, "Droop", 1e-4)
        T_1 = time(m, "T_1", 0.4, "Governor; 0 leaves the lag out")
        T_2 = time(m, "T_2", 0.1, "Combustion", 1e-3)
        T_3 = time(m, "T_3", 3.0, "Measurement of the exhaust's temperature", 1e-3)
        A_T = power(m, "A_T", 1.0, "Load limit at the ambient temperature")
        K_T = m.parameter("K_T", 2.0, "1", "Gain of the temperature's limiter", minimum=0, source=SOURCE)
        high, low = power(m, "V_MAX", 1.0, "Valve, fully open"), power(m, "V_MIN", -0.05, "Valve, closed")
        D_turb = power(m, "D_turb", 0.0, "Damping of the turbine", 0)
        require_within(m, P_m_0, low, high, ("governor.V_MIN", "governor.V_MAX"))
        m.require(
            A_T - P_m_0,
            "governor.A_T: the operating point of the power flow lies at or above the turbine's load limit; raise A_T "
            "or the rating S_n, or lower the generator's active power",
        )
        exhaust = m.state("exhaust", P_m_0, "pu", "Measured temperature of the exhaust", base="S_n")
        wanted = fmin(power_reference(m, P_m_0) - (w - 1) / R, A_T + K_T * (A_T - exhaust))
        valve = limited_low_pass(m, "valve", wanted, T_1, low, high, P_m_0)
        fuel = low_pass(m, "combustion", valve, T_2, P_m_0)
        m.derivative(exhaust, (fuel - exhaust) / T_3)
        return fuel - D_turb * (w - 1)
