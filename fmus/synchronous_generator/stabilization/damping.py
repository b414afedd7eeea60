"""PODs at a machine: a converter's damping controllers, at the voltage regulator and at the governor's reference.

    signal → s·T_W/(1+sT_W) → 1/(1+sT_f) → N_S times (1+sT_S1)/(1+sT_S2) → K → within ± limit → × ± sign

POD-Q (`pod`) goes to the voltage regulator as a stabiliser's signal does, POD-P (`with_pod`) where the governor's
``delta_P_ref`` goes, against the signal as a converter's: less power while the frequency is high. The signal is one of
its own machine (`signals`), or the deviation of a frequency at the input ``omega_pod`` (POD-Q) or ``omega_pod_p``
(POD-P): the speed or frequency of any component, that a connection of the case brings. Parameters have the names of a
grid-forming converter's PODs, so designs tune them alike. A far signal may swing against its own machine: ``sign`` = -1
turns the output around, which no gain does, as gains are not negative."""

from dataclasses import dataclass
from functools import partial

from fmus.synchronous_generator.data_lines import declared, power, seconds
from fmus.synchronous_generator.stabilization.signals import SPEED, one_signal
from fmus.synchronous_generator.turbines.governors import POWER_REFERENCE
from fmus.synchronous_generator.variants import Governor, Shaft
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


@dataclass(frozen=True)
class PodPlace:
    """A place that a POD acts on at a machine.

    ``scope``: of its parameters; ``input``: name of the input of a far signal; ``reference``: in words;
    ``direction``: 1 if the reference rises while the signal is high, else -1."""

    scope: str
    input: str
    reference: str
    direction: int


POD_Q = PodPlace("pod_q", "omega_pod", "voltage reference", 1)
POD_P = PodPlace("pod_p", "omega_pod_p", "governor's power reference", -1)


def pod(m: ModelBuilder, shaft: Shaft, *, far: bool = False) -> Expr:
    """Declare a POD-Q and return its signal to the voltage regulator [pu].

    ``far``: whether it acts on a frequency at an input."""
    return _controller(m, shaft, POD_Q, far=far)


pod_input = partial(pod, far=True)  # POD-Q of a frequency that comes from elsewhere


def with_pod(governor: Governor, *, far: bool = False) -> Governor:
    """The same governor with a POD-P at its power reference.

    ``far``: whether it acts on a frequency at an input."""

    def declare(m: ModelBuilder, shaft: Shaft) -> Expr:
        m.hand_over(POWER_REFERENCE, _controller(m, shaft, POD_P, far=far))
        return governor(m, shaft)

    return declare


def _controller(m: ModelBuilder, shaft: Shaft, at: PodPlace, *, far: bool) -> Expr:
    """Declare a controller and return what it adds to its reference [pu, S_n]."""
    text = f"Frequency that the POD at the {at.reference} acts on"
    omega = m.input(at.input, "pu", text, base="f_n", start=1.0) if far else Expr(1)
    with m.scope(at.scope):
        enabled = m.switch(
            "enabled", False, f"Adds the controller's output to the {at.reference}", tunable=True
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
        sign = _sign(m, at)
        m.require(
            if_else(logic_and(T_2 <= 0, T_1 > 0), -1, 1),
            f"{at.scope}.T_S2 = 0 needs {at.scope}.T_S1 = 0 as well",
        )
        m.require(
            if_else(T_2 <= 0, 1, T_2 - m.internal_step / 2),
            f"{at.scope}.T_S2 must be 0 or longer than half of internal_step",
        )
        signal = low_pass(m, "low_pass", washout(m, "washout", taken, p.T_W), p.T_f)
        for stage in range(1, MOST_STAGES + 1):
            compensated = lead_lag(m, f"lead_lag_{stage}", signal, T_1, T_2)
            signal = if_else(stage <= N_S, compensated, signal)
        return at.direction * sign * enabled * limit(K * signal, p.limit)


def _sign(m: ModelBuilder, at: PodPlace) -> Expr:
    usual, reversed_ = ("raises", "lowers") if at.direction > 0 else ("lowers", "raises")
    sign = m.parameter(
        *("sign", 1, "1"),
        f"1 {usual} the {at.reference} while the signal is high, -1 {reversed_} it",
        minimum=-1,
        maximum=1,
        type="Integer",
    )
    m.require(if_else(sign * sign > 0, 1, -1), f"{at.scope}.sign must be 1 or -1")
    return sign


def _own_signal(m: ModelBuilder, shaft: Shaft) -> Expr:
    with m.scope("input"):
        return one_signal(m, shaft, SPEED)
