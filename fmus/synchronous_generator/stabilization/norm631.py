"""Power system stabiliser PSS2A (IEEE 421.5): the integral of accelerating power, from speed and electrical power.

                                                          ramp-tracking filter
         ┌───────┐  ┌───────┐  ┌──────┐ speed      ┌────────────────┐       ┌──────┐  ┌────────┐  ┌────────┐
  Δω ───►│ s·T_w1│─►│ s·T_w2│─►│  1   │───►(+)────►│  (1 + s·T_8)   │N─►(+)►│ K_s1 │─►│1 + s·T1│─►│1 + s·T3│─► ± limit
         │1+s·T_w1│ │1+s·T_w2│ │1+s·T6│     ▲K_s3  │ (1 + s·T_9)^M  │    ▲− └──────┘  │1 + s·T2│  │1 + s·T4│
         └───────┘  └───────┘  └──────┘     │      └────────────────┘    │            └────────┘  └────────┘
  P_e ─► s·T_w3/(1 + s·T_w3) ─► s·T_w4/(1 + s·T_w4) ─► K_s2/(1 + s·T_7) ─┴─┘

A washout or lag whose time constant is 0 is left out."""

from fmus.synchronous_generator.data import NTS631
from fmus.toolchain.blocks import lead_lag, limit, low_pass, low_pass_or_nothing, washout
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, if_else

RAMP_LAGS = 5  # M of the ramp-tracking filter; N is 1


def pss2a(m: ModelBuilder, delta_omega: Expr, P_e: Expr, P_e_0: Expr) -> Expr:
    """Declare the stabiliser and return its signal to the voltage regulator [pu].

    ``delta_omega``: w − 1 [pu]; ``P_e``, ``P_e_0``: electrical power at the terminal [pu, S_n], and at the operating
    point."""
    with m.scope("pss"):
        enabled = m.switch(
            "enabled", True, "Adds the stabiliser's signal to the voltage reference", tunable=True
        )

        def time(name: str, value: float, text: str, minimum: float = 1e-3) -> Expr:
            return m.parameter(name, value, "s", text, minimum=minimum, source=NTS631)

        def gain(name: str, value: float, text: str) -> Expr:
            return m.parameter(name, value, "pu", text, base="S_n", minimum=0, source=NTS631)

        speed = washout(
            m, "washout_1", delta_omega, time("T_w1", 2.0, "First washout of the speed")
        )
        speed = washout(m, "washout_2", speed, time("T_w2", 2.0, "Second washout of the speed"))
        speed = low_pass_or_nothing(
            m, "speed", speed, time("T_6", 0.0, "Lag of the speed; 0 leaves it out", 0)
        )
        K_s2, K_s3 = (
            gain("K_s2", 0.158, "Gain of the power, T_7/2H"),
            gain("K_s3", 1.0, "Power in the ramp filter"),
        )
        power = washout(m, "washout_3", P_e, time("T_w3", 2.0, "First washout of the power"), P_e_0)
        power = _second_washout(
            m, power, time("T_w4", 0.0, "Second washout of the power; 0 leaves it out", 0)
        )
        power = K_s2 * low_pass(
            m, "integrator", power, time("T_7", 2.0, "Lag of the power, which integrates it")
        )
        T_8 = time("T_8", 0.0, "Ramp-tracking filter, lead", 0)
        T_9 = time("T_9", 0.1, "Ramp-tracking filter, each of its five lags")
        signal = lead_lag(m, "ramp_1", speed + K_s3 * power, T_8, T_9)
        for stage in range(2, RAMP_LAGS + 1):
            signal = low_pass(m, f"ramp_{stage}", signal, T_9)
        signal = gain("K_s1", 17.069, "Gain of the stabiliser") * (signal - power)
        for stage, lead, lag, values in ((1, 1, 2, (0.28, 0.04)), (2, 3, 4, (0.28, 0.12))):
            T_lead = time(f"T_{lead}", values[0], f"Lead of stage {stage}", 0)
            signal = lead_lag(
                m,
                f"lead_lag_{stage}",
                signal,
                T_lead,
                time(f"T_{lag}", values[1], f"Lag of stage {stage}"),
            )
        return enabled * limit(signal, gain("limit", 0.1, "Limit of the signal"))


def _second_washout(m: ModelBuilder, u: Expr, T: Expr) -> Expr:
    """s·T/(1 + s·T); passed through where T = 0."""
    used = if_else(T <= 0, 1.0, T)
    return if_else(T <= 0, u, washout(m, "washout_4", u, used))
