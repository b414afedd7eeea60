"""Limits that stay active (component, beginning, duration), those that act at a point, and a declared current."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fmus.toolchain.port_variables import SYSTEM_BASE_MVA
from orchestrator.core.arrays import Numbers
from orchestrator.devices.binding.misfits import of_dip
from orchestrator.devices.fmi.component import Component, RealBatch
from orchestrator.devices.fmi.port_mapping import BoundDescription
from orchestrator.simulation.watch.finding import MISFIT, Finding
from orchestrator.simulation.watch.limit import BYPASS_TIME, MACHINE_LIMITS, Lead, Limit
from orchestrator.simulation.watch.seen import Seen
from orchestrator.simulation.watch.settings import Settings
from orchestrator.systems.coupling.master import Master
from orchestrator.systems.coupling.system import ComponentPlan, System

LEAST_DURATION = 0.1
"""Shortest total time of a limit's action that is reported [s]. A limit that acts for less, as in a short dip, works as
intended."""

# the same for a limit that the model lacks [s]: from one cycle on, the course after it is another
LEAST_MISSING = 0.02

AT_LIMIT = 1 - 1e-9
"""A signal is at its limit from this part of the limit on: a saturated signal equals its limit except for the last
digits."""


# of the grid-forming converter: 0 for its box in q and d, above for its other limits
KIND = "current_limit.kind"


def _current_limit(what: str, axis: str) -> Limit:
    """The reference is the current and what the integrator of the current control, R/τ·(reference - current), adds."""
    lead = Lead(f"current_control.x_{axis}", "current_control.tau", "filter.R_c")
    return Limit(
        f"limit of the {what} current reference (i_{axis})",
        f"filter.i_s_{axis}",
        f"voltage_control.i_{axis}_max",
        lead,
        unless=KIND,
    )


LIMITS = (
    _current_limit("active", "q"),
    _current_limit("reactive", "d"),
    Limit("current limit (which the phasor model lacks)", "current_limit", None, represented=False),
    Limit("limit of the current reference", "current_demand", None, lacks=(KIND,)),
    Limit("limit of the current reference", "current_demand", None, enabled=KIND),
    Limit("fault current limit", "fault_current", None),
    Limit("output limit of POD-P", "delta_p_pod", "pod_p.limit", enabled="pod_p.enabled"),
    Limit("output limit of POD-Q", "delta_q_pod", "pod_q.limit", enabled="pod_q.enabled"),
    Limit(
        "output limit of the stabiliser",
        "pss.lead_lag_2",
        "pss.limit",
        Lead("pss.lead_lag_2", "pss.T_3"),
        "pss.enabled",
    ),
    *MACHINE_LIMITS,
)
"""Limits of the catalogue's models. A foreign FMU with the same variables is watched as well."""


# the same for a limit in proportion to a signal, which may be of an earlier pass of its iteration
SCALED = 1e-3


def limits_of(plan: ComponentPlan) -> list[Limit]:
    return [limit for limit in LIMITS if limit.fits(plan.description.variables)]


def limit_signals(system: System) -> list[str]:
    return [
        f"{name}.{variable}"
        for name, plan in system.components.items()
        for limit in limits_of(plan)
        for variable in limit.variables()
    ]


def active_limits(seen: Seen, system: System, settings: Settings) -> Iterator[Finding]:
    """Limits that act for longer than `LEAST_DURATION` in all, or still act at the end, while their component is on the
    grid: what a tripped one limits concerns nobody. An upper and a lower limit of one signal are one finding."""
    for name, plan in system.components.items():
        limits = limits_of(plan)
        if not limits:
            continue
        on = settings.connected(name) > 0
        for limit in limits:
            present = on
            if limit.unless is not None and limit.unless in plan.description.variables:
                present = on & (settings.values(name, limit.unless) <= 0)
            acting = {
                parameter: acts & present
                for parameter, acts in _acting(seen, name, limit, settings).items()
            }
            either = np.logical_or.reduce([*acting.values()])
            duration = _duration(seen, either)
            least = LEAST_DURATION if limit.represented else LEAST_MISSING
            if duration > least or (len(either) > 1 and either[-1]):
                of_each = {
                    parameter: _duration(seen, acts)
                    for parameter, acts in acting.items()
                    if parameter
                }
                yield _finding(seen.times, name, limit, either, duration, of_each)


def _duration(seen: Seen, acting: NDArray[np.bool_]) -> float:
    return float(acting[1:].sum()) * seen.interval


def _acting(
    seen: Seen, name: str, limit: Limit, settings: Settings
) -> dict[str, NDArray[np.bool_]]:
    """When each limit of a signal acts, by the limit's parameter; empty for one of the magnitude."""
    signal = seen.values[f"{name}.{limit.signal}"]
    if limit.lead is not None:
        signal = (
            signal
            + _lead_time(name, limit.lead, settings)
            * seen.values[f"{name}.der({limit.lead.state})"]
        )
    bound = (
        settings.values(name, limit.limit) if limit.limit is not None else np.ones(len(seen.times))
    )
    enabled = (
        settings.values(name, limit.enabled) > 0
        if limit.enabled is not None
        else np.ones(len(bound), dtype=bool)
    )
    if limit.low is None or limit.limit is None:
        return {"": (np.abs(signal) >= AT_LIMIT * bound) & (bound > 0) & enabled}
    low, scale = (
        settings.values(name, limit.low),
        1.0 if limit.scale is None else seen.values[f"{name}.{limit.scale}"],
    )
    # Of a signal that rests at 0 by a limit of 0, such as a closed valve, the last digits are those of 1.
    part = 1 - AT_LIMIT if limit.scale is None else SCALED
    slack = part * np.maximum(1.0, np.abs(signal))
    high_acts, low_acts = signal >= bound * scale - slack, signal <= low * scale + slack
    return {limit.limit: high_acts & enabled, limit.low: low_acts & enabled}


def _lead_time(name: str, lead: Lead, settings: Settings) -> Numbers:
    """T/gain of a lead [s] at every look."""
    factor = settings.values(name, lead.time)
    if lead.lag is not None:
        factor = np.where(settings.values(name, lead.lag) > 0, factor, BYPASS_TIME)
    if lead.gain is None:
        return factor
    gain = settings.values(name, lead.gain)
    return np.divide(factor, gain, out=np.zeros_like(factor), where=gain != 0)


def _finding(
    times: Numbers,
    name: str,
    limit: Limit,
    acting: NDArray[np.bool_],
    duration: float,
    of_each: Mapping[str, float],
) -> Finding:
    edges = np.flatnonzero(np.diff(np.concatenate([[False], acting, [False]]).astype(np.int8)))
    # A look shows what acted since the one before, which is how the duration counts.
    begin, stretches = float(times[max(edges[0] - 1, 0)]), len(edges) // 2
    lasts = bool(acting[-1])
    end = None if lasts else float(times[edges[-1] - 1])
    acts = "acts" if limit.represented else "would act"
    times_over = f", in {stretches} stretches" if stretches > 1 else ""
    which = [parameter for parameter, seconds in of_each.items() if seconds > 0]
    shares = [f"{parameter} for {of_each[parameter]:.3g} s" for parameter in which]
    listed = ", ".join(shares if len(which) > 1 else which)
    named = f" ({listed})" if which else ""
    message = (
        f"the {limit.name} of {name}{named} {acts} from t = {begin:.4g} s "
        f"{'to the end of the run' if end is None else f'to t = {end:.4g} s'}, for {duration:.3g} s in all{times_over}"
    )
    if not limit.represented:
        message += "; what follows is not known: repeat with EMT models"
    figures = {"duration_s": duration, "stretches": float(stretches)}
    return Finding(
        "active_limit",
        begin,
        component=name,
        variable=limit.signal,
        message=message,
        until=end,
        figures=figures,
        represented=limit.represented,
        what=limit.name,
    )


_CYCLE = 0.02  # time over which a current is averaged [s]: a period of 50 Hz
LASTS = 0.08  # time for which a current is above its limit [s]; a limit may need what is shorter

ABOVE = 1.05  # part of the declared current from which one is above it, as in `gfor fmu check`


def above_declared(seen: Seen, system: System) -> Iterator[Finding]:
    cycle = round(_CYCLE / seen.interval) if seen.interval else 0
    for name, plan in system.components.items():
        described = plan.description
        if (
            not cycle
            or not isinstance(described, BoundDescription)
            or described.port.current_limit is None
        ):
            continue
        size = (
            np.hypot(seen.last[f"{name}.i_re"], seen.last[f"{name}.i_im"])
            * SYSTEM_BASE_MVA
            / plan.number("S_n")
        )
        limit, means = (
            described.port.current_limit,
            np.convolve(size, np.full(cycle, 1 / cycle), "valid"),
        )
        edges = np.flatnonzero(
            np.diff(np.concatenate([[False], means > ABOVE * limit, [False]]).astype(np.int8))
        )
        long = [
            (a, b) for a, b in edges.reshape(-1, 2) if (b - a + cycle - 1) * seen.interval > LASTS
        ]
        if long and long[0][0]:  # at rest it is told by itself
            begin = float(seen.times[long[0][0] + cycle - 1])
            misfit = of_dip(float(max(means[a:b].max() for a, b in long)), limit, begin)
            yield Finding(
                MISFIT,
                begin,
                component=name,
                variable="i_re",
                message=misfit.sentence(name),
                until=None,
                figures=misfit.figures,
            )


def told_of(findings: Sequence[Mapping[str, Any]], component: str) -> Mapping[str, Any] | None:
    """Which of the findings, as JSON, tells that of a component; None where none does."""
    return next(
        (
            f
            for f in findings
            if f["kind"] == MISFIT and f.get("component") == component and "declared" in f
        ),
        None,
    )


def limits_that_act(master: Master) -> dict[str, tuple[str, ...]]:
    found = {
        name: tuple(
            limit.name for limit in limits_of(plan) if _acts(limit, plan, master.components[name])
        )
        for name, plan in master.system.components.items()
    }
    return {name: limits for name, limits in found.items() if limits}


def _acts(limit: Limit, plan: ComponentPlan, component: Component) -> bool:
    if not limit.represented or (limit.enabled is not None and not plan.value(limit.enabled)):
        return False
    names = [limit.signal, *([] if limit.scale is None else [limit.scale])]
    signal, *scales = RealBatch(component, names).read().tolist()
    scale = scales[0] if scales else 1.0
    high = 1.0 if limit.limit is None else plan.number(limit.limit) * scale
    if limit.low is None:
        return bool(abs(signal) >= AT_LIMIT * high)
    low, room = plan.number(limit.low) * scale, (1 - AT_LIMIT) * max(abs(high), 1.0)
    return bool(signal >= high - room or signal <= low + room)
