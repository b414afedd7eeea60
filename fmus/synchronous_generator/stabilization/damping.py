"""POD-Q at a machine: a converter's damping controller, whose output goes to the voltage regulator as a stabiliser's.

    signal → s·T_W/(1+sT_W) → 1/(1+sT_f) → N_S times (1+sT_S1)/(1+sT_S2) → K → within ± limit

The signal is one of its own machine (`signals`), or, as `pod_input`, the deviation of a frequency at the input
``omega_pod``: the speed or frequency of any component, that a connection of the case brings. Parameters have the names
of a grid-forming converter's POD-Q, so designs tune them alike."""

from functools import partial

from fmus.synchronous_generator.data_lines import declared, power, seconds
from fmus.synchronous_generator.stabilization.signals import SPEED, one_signal
from fmus.synchronous_generator.variants import Shaft
from fmus.toolchain.blocks import lead_lag, limit, low_pass, washout
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, if_else, logic_and

MOST_STAGES = 3  # lead/lag stages that the controller can be given

_SOURCE = "Mateu-Barriendos et al. 2024, table of POD parameters; gain and limit of a stabiliser"
_LARGEST_GAIN = 1e5
POD = (
    seconds("T_W", 5.0, "Washout", 0.01),
    seconds("T_f", 0.02, "Low-pass filter", 1e-3),
    power("limit", 0.1, "Output limit", 0),
)


def pod(m: ModelBuilder, shaft: Shaft, *, far: bool = False) -> Expr:
    """Declare the controller and return its signal to the voltage regulator [pu].

    ``far``: whether it acts on a frequency at an input."""
    text = "Frequency that the POD acts on"
    omega = m.input("omega_pod", "pu", text, base="f_n", start=1.0) if far else Expr(1)
    with m.scope("pod_q"):
        enabled = m.switch(
            "enabled", False, "Adds the controller's output to the voltage reference", tunable=True
        )
        taken = omega - 1 if far else _own_signal(m, shaft)
        p = declared(m, POD, _SOURCE)
        T_1, T_2 = (
            m.parameter(name, value, "s", text, minimum=0, tunable=True, source=_SOURCE)
            for name, value, text in (
                ("T_S1", 0.2, "Lead time constant of each stage"),
                ("T_S2", 0.05, "Lag time constant of each stage; 0 leaves the stages out"),
            )
        )
        N_S = m.parameter(
            "N_S",
            2,
            "1",
            "Number of lead/lag stages",
            minimum=0,
            maximum=MOST_STAGES,
            type="Integer",
        )
        K = m.parameter(
            *("K", 10.0, "pu", "Gain"),
            base="S_n",
            minimum=0,
            maximum=_LARGEST_GAIN,
            tunable=True,
            source=_SOURCE,
        )
        m.require(
            if_else(logic_and(T_2 <= 0, T_1 > 0), -1, 1),
            "pod_q.T_S2 = 0 needs pod_q.T_S1 = 0 as well",
        )
        m.require(
            if_else(T_2 <= 0, 1, T_2 - m.internal_step / 2),
            "pod_q.T_S2 must be 0 or longer than half of internal_step",
        )
        signal = low_pass(m, "low_pass", washout(m, "washout", taken, p.T_W), p.T_f)
        for stage in range(1, MOST_STAGES + 1):
            compensated = lead_lag(m, f"lead_lag_{stage}", signal, T_1, T_2)
            signal = if_else(stage <= N_S, compensated, signal)
        return enabled * limit(K * signal, p.limit)


pod_input = partial(pod, far=True)  # POD-Q of a frequency that comes from elsewhere


def _own_signal(m: ModelBuilder, shaft: Shaft) -> Expr:
    with m.scope("input"):
        return one_signal(m, shaft, SPEED)
