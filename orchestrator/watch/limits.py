"""Limits that stay active: the component, the beginning and the duration."""

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
"""Shortest total time of a limit's action that is reported [s]. A limit that acts for less, as in a short dip, works as
intended."""

AT_LIMIT = 1 - 1e-9
"""A signal is at its limit from this part of the limit on: a saturated signal equals its limit except for the last
digits."""


@dataclass(frozen=True)
class Lead:
    """The limited quantity, reconstructed as signal + T/gain·(d state/dt) from the state of a block or of a control's
    integrator.

    Attributes
    ----------
    state
        The state whose derivative is read.
    time, gain
        Parameters with T [s] and the gain; None stands for 1.
    """

    state: str
    time: str
    gain: str | None = None


@dataclass(frozen=True)
class Limit:
    """The variables of an FMU that show an active limit. The limit is watched if the FMU has all of them.

    Attributes
    ----------
    name
        Name of the limit in messages.
    signal
        The limited signal, or a signal that follows it.
    limit
        Parameter with the limit of the magnitude; None if the signal is given as a part of the limit.
    lead
        Reconstruction of the limited quantity from a derivative, if the signal only follows this quantity.
    enabled
        Switch that must be on for the limited signal to have an effect.
    represented
        Whether the model has the limit. Otherwise the FMU only shows when the limit would act.
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
    Limit("limit of the current reference", "current_demand", None),
    Limit("fault current limit", "fault_current", None),
    Limit("output limit of POD-P", "delta_p_pod", "pod_p.limit", enabled="pod_p.enabled"),
    Limit("output limit of POD-Q", "delta_q_pod", "pod_q.limit", enabled="pod_q.enabled"),
    Limit("output limit of the stabiliser", "pss.lead_lag_2", "pss.limit", Lead("pss.lead_lag_2", "pss.T_3"),
          "pss.enabled"),
)  # fmt: skip
"""Limits of the catalogue's models. A foreign FMU with the same variables is watched as well."""


def limits_of(plan: ComponentPlan) -> Iterator[Limit]:
    """The limits that can be seen in a component."""
    for limit in LIMITS:
        if all(name in plan.description.variables for name in limit.needed()):
            yield limit


def limit_signals(system: System) -> list[str]:
    """Signals that the limits of all components need."""
    return [f"{name}.{variable}" for name, plan in system.components.items()
            for limit in limits_of(plan) for variable in limit.variables()]  # fmt: skip


def active_limits(seen: Seen, system: System, settings: Settings) -> Iterator[Finding]:
    """Limits that act for longer than `LEAST_DURATION` in all, or still act at the end, while their component is on the
    grid: what a tripped one limits concerns nobody.
    """
    for name, plan in system.components.items():
        limits = list(limits_of(plan))
        if not limits:
            continue
        on = settings.connected(name) > 0
        for limit in limits:
            acting = _acting(seen, name, limit, settings) & on
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
