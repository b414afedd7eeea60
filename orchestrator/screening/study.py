"""A screening: operating points times outages, in stretches that are computed, kept, and joined."""

import hashlib
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from orchestrator.analysis.mode_tracking import match
from orchestrator.cases.case import Case
from orchestrator.cases.layers import OptionValues
from orchestrator.cases.parameter_files import ParameterFile
from orchestrator.cases.prepare import PreparedScenario
from orchestrator.cases.schema import Value
from orchestrator.cases.sharing import SharingRule
from orchestrator.errors import InputError
from orchestrator.points.executor import Executor
from orchestrator.points.key import fingerprint, key_of, reference_to, scenario_content
from orchestrator.points.points import CountReport, kept_or_computed
from orchestrator.points.store import PointStore
from orchestrator.screening.columns import Elements
from orchestrator.screening.modes import CriticalRegion
from orchestrator.screening.outages import Outage, read_outages
from orchestrator.screening.point import StretchTask, compute_stretch
from orchestrator.screening.points_file import OperatingCase, read_points
from orchestrator.screening.record import Item, ItemRecord, StretchRecord

STRETCH = 48  # operating points with outages that are computed one from the other before the next full search
_MOST = 1_000_000


@dataclass(frozen=True)
class Shard:
    """The part ``number`` of ``total``, from 1."""

    number: int = 1
    total: int = 1

    @classmethod
    def parse(cls, text: str) -> "Shard":
        """Read ``2/8``."""
        found = re.fullmatch(r"(\d+)/(\d+)", text.strip())
        number, total = (int(part) for part in found.groups()) if found else (0, 0)
        if not 1 <= number <= total:
            raise ValueError(f"{text!r} is no part of a whole; write such as 2/8, from 1/8 to 8/8")
        return cls(number, total)

    def has(self, place: int) -> bool:
        return place % self.total == self.number - 1


@dataclass(frozen=True)
class ScreeningPlan:
    # case, prepared: the case, and its scenario as it is without the values of any point
    case: Case
    prepared: PreparedScenario
    layers: tuple[ParameterFile, ...]  # as in `orchestrator.sweep.sweep.SweepPlan`
    # points, outages: operating points, and outages; the first outage is the intact network
    points: tuple[OperatingCase, ...]
    outages: tuple[Outage, ...]
    wanted: CriticalRegion
    tasks: tuple[StretchTask, ...]

    @property
    def number_of_items(self) -> int:
        """Operating points times outages."""
        return sum(len(task.items) for task in self.tasks)


def plan_screening(
    case: Case,
    points: Path | None,
    outages: str | None = None,
    scenario: str | None = None,
    overrides: Mapping[str, Value] | None = None,
    step_size: float | None = None,
    wanted: CriticalRegion | None = None,
    parameters: Sequence[ParameterFile] = (),
    *,
    whole: bool = False,
    sharing: SharingRule | None = None,
) -> ScreeningPlan:
    """Check a screening, and build the FMUs that it needs.

    ``points``: CSV file with the operating points; None for the case's own.
    ``outages``: as `read_outages` takes them.
    ``scenario``: its name; the first one where None.
    ``overrides``: values by ``component.variable`` that hold at every point.
    ``step_size``: communication step [s]; the case's where None.
    ``wanted``: which modes are critical; from 0.1 to 2 Hz with less than 20 % damping where None.
    ``whole``: whether growing eigenvalues are counted at all points, at all frequencies; otherwise at the ends of
    stretches.
    ``sharing``: how units share an outage; as the case says where None.
    """
    name = scenario or next(iter(case.scenarios))
    (prepared,) = case.prepare([name], overrides, step_size, None, parameters)
    layers = (*parameters, *([OptionValues.of(overrides)] if overrides else []))
    elements = Elements.of(prepared)
    own = OperatingCase("case", 1.0, {}, (), str(case.path))
    rows = [own] if points is None else read_points(points, prepared, elements)
    lost = read_outages(outages, elements)
    if len(rows) * len(lost) > _MOST:
        raise InputError(
            f"{points}: {len(rows)} operating points with {len(lost)} outages are {len(rows) * len(lost)}; at most "
            f"{_MOST} are computed: split the file"
        )
    asked = wanted or CriticalRegion(0.1, 2.0, 0.2)
    tasks = _tasks(case, prepared, layers, rows, lost, step_size, asked, whole=whole, sharing=sharing)
    return ScreeningPlan(case, prepared, layers, tuple(rows), tuple(lost), asked, tuple(tasks))


def _tasks(
    case: Case,
    prepared: PreparedScenario,
    layers: tuple[ParameterFile, ...],
    points: Sequence[OperatingCase],
    outages: Sequence[Outage],
    step_size: float | None,
    wanted: CriticalRegion,
    *,
    whole: bool,
    sharing: SharingRule | None,
) -> list[StretchTask]:
    items = [
        Item(p, o, point.values, tuple(dict.fromkeys((*point.out, *outage.elements))),
             tuple(name for name in outage.elements if name not in point.out))
        for p, point in enumerate(points)
        for o, outage in enumerate(outages)
        if o == 0 or set(outage.elements) - set(point.out)
    ]  # fmt: skip
    content = {
        "case": case.text,
        **scenario_content(prepared),
        "layers": [list(layer.values.items()) for layer in layers],
        "step": step_size,
        "wanted": [wanted.lowest_hz, wanted.highest_hz, wanted.damping],
        "whole": whole,
        "sharing": sharing,
    }
    common = hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
    reference, mark = reference_to(case), fingerprint(case)
    tasks = []
    for first in range(0, len(items), STRETCH):
        part = tuple(items[first : first + STRETCH])
        point = points[part[0].point]
        anchor = Item(part[0].point, 0, point.values, point.out)
        said = [[sorted(item.values.items()), list(item.out), list(item.lost), item.intact] for item in (anchor, *part)]
        points_of = [item.point - part[0].point for item in part]
        key = key_of({"screening": common, "items": said, "points": points_of})
        tasks.append(StretchTask(reference, mark, prepared.name, layers, step_size, wanted, anchor, part, key,
                                 case.trust_fmus, whole, sharing))  # fmt: skip
    return tasks


@dataclass(frozen=True)
class ScreenedItem:
    point: OperatingCase
    outage: Outage
    record: ItemRecord
    trajectories: tuple[int, ...]


@dataclass
class ScreeningResult:
    plan: ScreeningPlan
    # in the order of points and outages; of a part, only the part's
    items: list[ScreenedItem] = field(default_factory=list)
    # computed, stored: numbers of items computed now, and read from an earlier start
    computed: int = 0
    stored: int = 0
    # perturbed, reused: numbers of components perturbed, and taken from where they were alike
    perturbed: int = 0
    reused: int = 0

    @property
    def complete(self) -> bool:
        return len(self.items) == self.plan.number_of_items


def run_screening(
    plan: ScreeningPlan,
    executor: Executor,
    store: PointStore,
    report: CountReport = lambda done, total: None,
    shard: Shard | None = None,
) -> ScreeningResult:
    """Compute the stretches that are not stored yet, and follow the modes over all of them.

    ``plan``: as `plan_screening` gives it.
    ``shard``: the part to compute; all where None.
    """
    part = shard or Shard()
    places = [k for k in range(len(plan.tasks)) if part.has(k)]
    tasks = [plan.tasks[k] for k in places]
    sizes = [len(task.items) for task in tasks]
    found: dict[int, StretchRecord] = {}
    result = ScreeningResult(plan)

    def report_items(done: int, total: int) -> None:
        report(round(sum(sizes) * done / max(1, total)), sum(sizes))

    for index, record, stored in kept_or_computed(StretchRecord, compute_stretch, tasks, executor, store, report_items):
        found[places[index]] = record.as_kept
        result.stored += sizes[index] * stored
        result.computed += sizes[index] * (not stored)
        result.perturbed += record.perturbed
        result.reused += record.reused
    result.items = _joined(plan, found)
    return result


def _joined(plan: ScreeningPlan, found: Mapping[int, StretchRecord]) -> list[ScreenedItem]:
    count = 0
    before: StretchRecord | None = None
    before_numbers: dict[int, list[int]] = {}
    items = []
    for k, record in sorted(found.items()):
        numbers: dict[int, list[int]] = {}
        for place, item in enumerate(record.items):
            own = [-1] * len(item.eigenvalues)
            if place and item.reference >= 0:
                own = [numbers[item.reference][link] if link >= 0 else -1 for link in item.links]
            elif place == 0 and before is not None and before.last is not None and record.first is not None:
                earlier = before_numbers[before.last_place]
                for link in match(before.last, record.first):
                    own[link.target] = earlier[link.source]
            for mode, number in enumerate(own):
                if number < 0:
                    own[mode], count = count, count + 1
            numbers[place] = own
        task = plan.tasks[k]
        for place, one in enumerate(task.items, start=1):
            item = record.items[place]
            chosen = plan.points[one.point], plan.outages[one.outage]
            items.append(ScreenedItem(*chosen, item, tuple(numbers[place])))
        if record.last is not None:
            before, before_numbers = record, numbers
    return items
