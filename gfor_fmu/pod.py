"""Power-oscillation-damping controllers POD-P and POD-Q (the paper's section on POD control in GFOR).

       ┌─────────┐   ┌───────┐   ┌──────────────┐      ┌───┐   ┌───────────┐
 Δω ──►│  s·T_W  │──►│   1   │──►│ (1 + s·T_S1) │N_S──►│ K │──►│ ± limit   │──► ΔP or ΔQ
       │─────────│   │───────│   │──────────────│      └───┘   └───────────┘
       │1 + s·T_W│   │1+s·T_f│   │ (1 + s·T_S2) │
       └─────────┘   └───────┘   └──────────────┘

The input is the deviation of the frequency that the converter itself imposes, so nothing needs to
be measured. Because of T_f the output never depends directly on the input: no algebraic loop."""

from fmus.toolchain.blocks import lead_lag, limit, low_pass, washout
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, if_else, logic_and

N_S_MAX = 3  # most lead/lag stages a controller can be given

SOURCE = "Mateu-Barriendos et al. 2024, table of POD parameters"


def pod(
    m: ModelBuilder, name: str, delta_omega: Expr, *, sign: int, T_S1: float, T_S2: float
) -> Expr:
    """Declare one controller and return its supplementary reference [pu, S_n].

    Parameters
    ----------
    m
        The model it belongs to.
    name
        Scope of its parameters and states: ``pod_p`` or ``pod_q``.
    delta_omega
        w − 1 [pu].
    sign
        −1 for POD-P: active power is withdrawn while the frequency is high; +1 for POD-Q.
    T_S1, T_S2
        Default lead and lag time constants [s].
    """
    with m.scope(name):
        enabled = m.switch(
            "enabled", False, "Adds the controller's output to the droop", tunable=True
        )
        T_W = m.parameter("T_W", 5.0, "s", "Washout", minimum=0.01, tunable=True, source=SOURCE)
        T_f = m.parameter(
            "T_f", 0.1, "s", "Low-pass filter", minimum=1e-3, tunable=True, source=SOURCE
        )
        T_1 = m.parameter(
            "T_S1",
            T_S1,
            "s",
            "Lead time constant of each stage",
            minimum=0,
            tunable=True,
            source=SOURCE,
        )
        T_2 = m.parameter(
            "T_S2",
            T_S2,
            "s",
            "Lag time constant of each stage",
            minimum=0,
            tunable=True,
            source=SOURCE,
        )
        N_S = m.parameter(
            "N_S",
            2,
            "1",
            "Number of lead/lag stages",
            minimum=0,
            maximum=N_S_MAX,
            type="Integer",
            source=SOURCE,
        )
        K = m.parameter(
            "K",
            200.0,
            "pu",
            "Gain",
            base="S_n",
            minimum=0,
            maximum=1e5,
            tunable=True,
            source=SOURCE,
        )
        bound = m.parameter(
            "limit", 0.2, "pu", "Output limit", base="S_n", minimum=0, tunable=True, source=SOURCE
        )
        m.require(
            if_else(logic_and(T_2 <= 0, T_1 > 0), -1, 1),
            f"{name}.T_S2 = 0 needs {name}.T_S1 = 0 as well",
        )
        m.require(
            if_else(T_2 <= 0, 1, T_2 - m.internal_step / 2),
            f"{name}.T_S2 must be 0 or longer than half of internal_step",
        )

        signal = washout(m, "washout", delta_omega, T_W)
        signal = low_pass(m, "low_pass", signal, T_f)
        for stage in range(1, N_S_MAX + 1):
            compensated = lead_lag(m, f"lead_lag_{stage}", signal, T_1, T_2)
            signal = if_else(stage <= N_S, compensated, signal)
        return enabled * limit(sign * K * signal, bound)
