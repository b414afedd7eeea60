"""What a screening could not judge, and whether that is where the stress is; and its outages, worst first."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from orchestrator.operating_points.columns import Elements
from orchestrator.operating_points.item import Status
from orchestrator.operating_points.points_file import OperatingCase
from orchestrator.screening.study import ScreenedItem, ScreeningPlan
from orchestrator.screening.summary import ModeAt, Summary


@dataclass(frozen=True)
class OutageRow:
    name: str
    worst: ScreenedItem | None  # the item with the least damping, or that grows; None where none has modes
    least: ModeAt | None  # its least damped mode; None where it has none in the range
    unjudged: tuple[ScreenedItem, ...]  # items without modes
    points: int

    @property
    def unstable(self) -> bool:
        return self.worst is not None and self.worst.record.stable is False


def by_outage(summary: Summary) -> list[OutageRow]:
    groups: dict[str, list[ScreenedItem]] = {}
    for item in summary.result.items:
        groups.setdefault(item.outage.name, []).append(item)
    rows = []
    for name, items in groups.items():
        known = [item for item in items if item.record.status is Status.COMPUTED]
        worst = min(known, key=lambda item: (item.record.stable is not False, _damping(item)), default=None)
        least = ModeAt(worst, worst.record.critical[0]) if worst is not None and worst.record.critical else None
        unjudged = tuple(item for item in items if item.record.status is not Status.COMPUTED)
        rows.append(OutageRow(name, worst, least, unjudged, len(items)))
    return sorted(rows, key=lambda row: (
        not row.unstable, not row.unjudged, row.least.damping if row.least else np.inf,
    ))  # fmt: skip


def _damping(item: ScreenedItem) -> float:
    return ModeAt(item, item.record.critical[0]).damping if item.record.critical else float("inf")


def load_of(plan: ScreeningPlan, point: OperatingCase) -> float:
    """Active power of all loads at a point [MW]."""
    elements = Elements.of(plan.prepared)
    grid = plan.prepared.system.components[elements.grid]

    def number(name: str) -> float:
        return float(point.values.get(f"{elements.grid}.{name}", grid.number(name)))

    return sum(number(f"{x}.scale") * number(f"{x}.P") for x in elements.loads if x not in point.out)


def not_judged(summary: Summary) -> str:
    """How many items have no modes, and what they have in common: what is out, and a high or a low load."""
    items = [item for item in summary.result.items if item.record.status is not Status.COMPUTED]
    if not items:
        return ""
    which = "all" if len(items) > 1 else "it is"
    common = [text for text in (_out(summary, items), _loading(summary, items)) if text]
    kinds = ", ".join(f"{number} {status}" for status, number in Counter(i.record.status for i in items).items())
    return f"{len(items)} not judged ({kinds})" + (f", {which} {' '.join(common)}" if common else "")


def _out(summary: Summary, items: Sequence[ScreenedItem]) -> str:
    elements = Elements.of(summary.result.plan.prepared)
    names = {item.outage.name for item in items}
    if len(names) == 1:
        (name,) = names
        return f"with {name} out" if items[0].outage.elements else "of the intact network"
    for kind, known in (("unit", set(elements.units)), ("line or transformer", set(elements.lines))):
        if all(known & set(item.outage.elements) for item in items):
            return f"with a {kind} out"
    return ""


def _loading(summary: Summary, items: Sequence[ScreenedItem]) -> str:
    plan = summary.result.plan
    loads = {point.name: load_of(plan, point) for point in plan.points}
    if len(loads) == 2 and len(at := {item.point.name for item in items}) == 1:
        return f"at {at.pop()}"
    middle, here = float(np.median(list(loads.values()))), [loads[item.point.name] for item in items]
    if min(here) > middle:
        return f"at high load (from {min(here):.4g} MW on; half of the points have at most {middle:.4g} MW)"
    if max(here) < middle:
        return f"at low load (up to {max(here):.4g} MW; half of the points have at least {middle:.4g} MW)"
    return ""
