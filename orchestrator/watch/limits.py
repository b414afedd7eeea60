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
"""A limit that acts for less than this in all [s], as in a short dip, works as intended and is not reported."""

AT_LIMIT = 1 - 1e-9
"""From this part of its limit on a signal is at it: what is saturated equals its limit but for the last digits."""


@dataclass(frozen=True)
class Lead:
    """What is limited is the signal + T/gain·(d state/dt), where a block's state or a control's integrator shows it.

    Attributes
    ----------
    state
        Whose derivative is read.
    time, gain
        Parameters with T [s] and the gain; 1 where there is none.
    """

    state: str
    time: str
    gain: str | None = None


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
        How a derivative shows what is limited, where the signal only follows it.
    enabled
        Switch without which the limited signal goes nowhere.
    represented
        Whether the model has the limit; else it only tells when the limit would act.
    """

    name: str
    signal: str
    limit: str | None
    lead: Lead | None = None
    enabled: str | None = None
    represented: bool = True

    def variables(self) -> tuple[str, ...]:
        """Signals to be read."""
        return (self.signal,) if self.lead is None else (self.signal, f"der({self.lead.state})")

    def needed(self) -> tuple[str, ...]:
        """All variables that an FMU must have."""
        lead = (self.lead.time, self.lead.gain) if self.lead is not None else ()
        parameters = (self.limit, self.enabled, *lead)
        return (*self.variables(), *(p for p in parameters if p is not None))


def _current_limit(what: str, axis: str) -> Limit:
    """The reference is the current and what the integrator of the current control, R/τ·(reference - current), adds."""
    lead = Lead(f"current_control.x_{axis}", "current_control.tau", "filter.R_c")
    return Limit(f"limit of the {what} current reference (i_{axis})", f"filter.i_s_{axis}",
                 f"voltage_control.i_{axis}_max", lead)  # fmt: skip


LIMITS = (
    _current_limit("active", "q"),
    _current_limit("reactive", "d"),
    Limit("current limit (which the phasor model lacks)", "current_limit", None, represented=False),
    Limit("output limit of POD-P", "delta_p_pod", "pod_p.limit", enabled="pod_p.enabled"),
    Limit("output limit of POD-Q", "delta_q_pod", "pod_q.limit", enabled="pod_q.enabled"),
    Limit("output limit of the stabiliser", "pss.lead_lag_2", "pss.limit", Lead("pss.lead_lag_2", "pss.T_3"),
          "pss.enabled"),
)  # fmt: skip
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
        factor = settings.values(name, limit.lead.time)
        if limit.lead.gain is not None:
            gain = settings.values(name, limit.lead.gain)
            factor = np.divide(factor, gain, out=np.zeros_like(factor), where=gain != 0)
        signal = signal + factor * seen.values[f"{name}.der({limit.lead.state})"]
    bound = settings.values(name, limit.limit) if limit.limit is not None else np.ones(len(seen.times))
    acting: NDArray[np.bool_] = (np.abs(signal) >= AT_LIMIT * bound) & (bound > 0)
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
