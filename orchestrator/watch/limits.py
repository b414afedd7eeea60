"""Limits that stay active: which component's, from when, and for how long."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from orchestrator.arrays import Numbers
from orchestrator.coupling.system import ComponentPlan, System
from orchestrator.watch.finding import Finding
from orchestrator.watch.seen import Seen
from orchestrator.watch.settings import Settings

LEAST_DURATION = 0.1
"""A limit that acts for less than this in all [s], as in a short dip, does its work and is not told."""

AT_LIMIT = 0.999
"""A controlled current is at its reference's limit from this part of it on."""


@dataclass(frozen=True)
class Limit:
    """How a limit that acts can be seen in an FMU's variables; it is watched where the FMU has them all.

    Attributes
    ----------
    name
        In messages.
    signal
        What is limited, or follows what is limited.
    limit
        Parameter with the limit of its magnitude; None where the signal is in parts of the limit.
    lead
        Time constant T where the limited signal is signal + T·(d signal/dt): the output of a lead-lag block, of which
        the signal is the state.
    enabled
        Switch without which the limited signal goes nowhere.
    share
        The limit acts where the signal is at least this part of it.
    represented
        Whether the model has the limit; else it only tells when the limit would act.
    """

    name: str
    signal: str
    limit: str | None
    lead: str | None = None
    enabled: str | None = None
    share: float = 1.0
    represented: bool = True

    def variables(self) -> tuple[str, ...]:
        """Signals to be read."""
        return (self.signal,) if self.lead is None else (self.signal, f"der({self.signal})")

    def needed(self) -> tuple[str, ...]:
        """All variables that an FMU must have."""
        parameters = (self.limit, self.lead, self.enabled)
        return (*self.variables(), *(p for p in parameters if p is not None))


LIMITS = (
    Limit("limit of the active current reference (i_q)", "filter.i_s_q", "voltage_control.i_q_max", share=AT_LIMIT),
    Limit("limit of the reactive current reference (i_d)", "filter.i_s_d", "voltage_control.i_d_max", share=AT_LIMIT),
    Limit("current limit (which the phasor model lacks)", "current_limit", None, represented=False),
    Limit("output limit of POD-P", "delta_p_pod", "pod_p.limit", enabled="pod_p.enabled"),
    Limit("output limit of POD-Q", "delta_q_pod", "pod_q.limit", enabled="pod_q.enabled"),
    Limit("output limit of the stabiliser", "pss.lead_lag_2", "pss.limit", lead="pss.T_3", enabled="pss.enabled"),
)
"""Limits of the catalogue's models; an FMU of others with the same variables is watched as well."""


def limits_of(plan: ComponentPlan) -> Iterator[Limit]:
    """The limits that can be seen in a component."""
    for limit in LIMITS:
        if all(name in plan.description.variables for name in limit.needed()):
            yield limit


def limit_signals(system: System) -> list[str]:
    """Signals that have to be read for the limits of all components."""
    return [f"{name}.{variable}" for name, plan in system.components.items()
            for limit in limits_of(plan) for variable in limit.variables()]  # fmt: skip


def active_limits(seen: Seen, system: System, settings: Settings) -> Iterator[Finding]:
    """Limits that act for longer than `LEAST_DURATION` in all, or still act at the end."""
    for name, plan in system.components.items():
        for limit in limits_of(plan):
            acting = _acting(seen, name, limit, settings)
            duration = float(acting[1:].sum()) * seen.interval
            if duration > LEAST_DURATION or (len(acting) > 1 and acting[-1]):
                yield _finding(seen.times, name, limit, acting, duration)


def _acting(seen: Seen, name: str, limit: Limit, settings: Settings) -> NDArray[np.bool_]:
    signal = seen.values[f"{name}.{limit.signal}"]
    if limit.lead is not None:
        signal = signal + settings.values(name, limit.lead) * seen.values[f"{name}.der({limit.signal})"]
    bound = settings.values(name, limit.limit) if limit.limit is not None else np.ones(len(seen.times))
    acting: NDArray[np.bool_] = (np.abs(signal) >= limit.share * bound) & (bound > 0)
    return acting & (settings.values(name, limit.enabled) > 0) if limit.enabled is not None else acting


def _finding(times: Numbers, name: str, limit: Limit, acting: NDArray[np.bool_], duration: float) -> Finding:
    edges = np.flatnonzero(np.diff(np.concatenate([[False], acting, [False]]).astype(np.int8)))
    begin, stretches = float(times[edges[0]]), len(edges) // 2
    lasts = bool(acting[-1])
    end = None if lasts else float(times[edges[-1] - 1])
    acts = "acts" if limit.represented else "would act"
    times_over = f", in {stretches} stretches" if stretches > 1 else ""
    message = (
        f"the {limit.name} of {name} {acts} from t = {begin:.4g} s "
        f"{'to the end of the run' if end is None else f'to t = {end:.4g} s'}, for {duration:.3g} s in all{times_over}"
    )
    figures = {"duration_s": duration, "stretches": float(stretches)}
    return Finding("active_limit", begin, name, limit.signal, message, end, figures)
