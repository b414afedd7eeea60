"""A screening: operating points times outages, in stretches that are computed, kept, and joined."""

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import cast

from orchestrator.cases.case import Case, with_protection
from orchestrator.cases.flow.sharing import SharingRule
from orchestrator.linear.spectra.mode_tracking import match
from orchestrator.studies.operating_points.item import Item
from orchestrator.studies.operating_points.outages import Outage
from orchestrator.studies.operating_points.plan import OperatingPoints, read_operating_points
from orchestrator.studies.operating_points.points_file import OperatingCase
from orchestrator.studies.operating_points.preparation import with_moving_controls
from orchestrator.studies.points.points import Work
from orchestrator.studies.points.task import StudyCase
from orchestrator.studies.screening.modes import MOST_COUNTED, CriticalRegion
from orchestrator.studies.screening.point import StretchTask, compute_stretch
from orchestrator.studies.screening.record import ItemRecord, StretchRecord
from orchestrator.studies.screening.request import ScreeningRequest
from orchestrator.systems.coupling.no_trip_regions import NoTripCode

# most operating points with outages that are computed one from the other before the next full search
STRETCH = 48

# from so many on they are two stretches at least, so that two cores have work
WORTH_TWO = 13

FEW = 500
"""Up to so many operating points with outages growth is counted at each, where that takes a part of what the point
itself takes: 8 s of processor time of 25 s with 3,000 states. Only then is it known whether all are stable."""

FEWEST = 24
"""Up to so many, growth is counted at each whatever its size: 48 s of processor time with 11,330 states, where a count
takes longer than the rest of the point."""


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
class ScreeningPlan(OperatingPoints):
    wanted: CriticalRegion
    tasks: tuple[StretchTask, ...]

    @property
    def number_of_items(self) -> int:
        return len(self.items)


def plan_screening(case: Case, request: ScreeningRequest) -> ScreeningPlan:
    region, sharing = request.region, cast("SharingRule | None", request.sharing)
    runs = request.wanted_runs
    case = with_moving_controls(case) if request.move_controls else case
    code = cast("NoTripCode | None", request.protection)
    case = with_protection(case, code)
    read = read_operating_points(case, request, request.points, request.outages, request.scenario)
    # relays change no FMU and no value, but what the runs show
    besides = {} if runs is None else {"relays": repr(read.prepared.relays)}
    study = StudyCase.of(read.prepared, read.layers, request.step_size, **besides)
    tasks = []
    for part in _stretches(read.items):
        point = read.points[part[0].point]
        anchor = Item(part[0].point, 0, point.values, point.out)
        tasks.append(
            StretchTask(
                study,
                region,
                anchor=anchor,
                items=part,
                whole=request.whole,
                counted_to=_counted_to(len(read.items)),
                sharing=sharing,
                move_controls=request.move_controls,
                runs=runs,
                protection=code,
            )
        )
    return ScreeningPlan(**vars(read), wanted=region, tasks=tuple(tasks))


def _counted_to(items: int) -> int | None:
    """Number of states up to which growth is counted at each of so many items; None if at any number of states."""
    if items > FEW:
        return 0
    return None if items <= FEWEST else MOST_COUNTED


def _stretches(items: Sequence[Item]) -> Iterator[tuple[Item, ...]]:
    """Stretches of about the same length: how many does not depend on who computes them."""
    count = len(items)
    parts = max(2 if count >= WORTH_TWO else 1, math.ceil(count / STRETCH))
    edges = [count * k // parts for k in range(parts + 1)]
    for first, last in pairwise(edges):
        yield tuple(items[first:last])


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


def run_screening(plan: ScreeningPlan, work: Work, shard: Shard | None = None) -> ScreeningResult:
    """Compute the stretches that are not stored yet, and follow the modes over all of them."""
    part = shard or Shard()
    tasks = {k: task for k, task in enumerate(plan.tasks) if part.has(k)}
    sizes = [len(task.items) for task in tasks.values()]
    found = dict(zip(tasks, work.all(compute_stretch, list(tasks.values()), sizes), strict=True))
    return ScreeningResult(
        plan,
        _joined(plan, found),
        work.computed,
        work.stored,
        sum(record.perturbed for record in found.values()),
        sum(record.reused for record in found.values()),
    )


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
            elif (
                place == 0
                and before is not None
                and before.last is not None
                and record.first is not None
            ):
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
            items.append(ScreenedItem(*plan.of(one), item, tuple(numbers[place])))
        if record.last is not None:
            before, before_numbers = record, numbers
    return items
