"""Limits that act at an operating point."""

from orchestrator.coupling.master import Master
from orchestrator.coupling.system import ComponentPlan
from orchestrator.fmi.component import Component, RealBatch
from orchestrator.watch.limit import Limit
from orchestrator.watch.limits import AT_LIMIT, limits_of


def limits_that_act(master: Master) -> dict[str, tuple[str, ...]]:
    found = {
        name: tuple(limit.name for limit in limits_of(plan) if _acts(limit, plan, master.components[name]))
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
