"""A stretch of a screening: some operating points with their outages, computed one after the other.

A stretch starts from scratch, so its result does not
depend on where and when it is computed."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from orchestrator.cases.case import Case, with_protection
from orchestrator.cases.flow.sharing import SharingRule
from orchestrator.cases.networks.branch_limits import Loading, Outlier, loadings, outliers
from orchestrator.linear.doubts.starts import warnings_at_start
from orchestrator.linear.models.apart import standing_apart
from orchestrator.linear.models.linearization import Blocks
from orchestrator.linear.models.slope_linearization import gives_slopes
from orchestrator.linear.models.steady_state import find_operating_point
from orchestrator.linear.spectra.mode_tracking import ModeSet, match
from orchestrator.linear.spectra.modes import shares_in_words
from orchestrator.studies.modes.modes import modes_from
from orchestrator.studies.operating_points.bench import DRIVEN, OBSERVED, PointBench
from orchestrator.studies.operating_points.item import Item, Status
from orchestrator.studies.operating_points.preparation import (
    ACCEPT,
    ItemPreparation,
    failure,
    with_moving_controls,
)
from orchestrator.studies.operating_points.widening import StartedItem, started
from orchestrator.studies.points.codec import plain
from orchestrator.studies.points.failure import Failure
from orchestrator.studies.points.task import Task, computed
from orchestrator.studies.points.under_way import tell_part
from orchestrator.studies.screening.modes import (
    CriticalRegion,
    FoundModes,
    find_modes_here,
    residue,
)
from orchestrator.studies.screening.outage_runs import OutageRuns, first_bus
from orchestrator.studies.screening.record import ItemRecord, StretchRecord, WantedRuns
from orchestrator.systems.coupling.no_trip_regions import NoTripCode


@dataclass(frozen=True)
class StretchTask(Task):
    record = StretchRecord
    wanted: CriticalRegion
    anchor: Item  # the intact network at the first point, from which the rest is reached
    items: tuple[Item, ...]  # what is computed, in this order
    # whether growing eigenvalues are counted at all items, rather than at the ends
    whole: bool = False
    # number of states up to which the same is done, None if at any number
    counted_to: int | None = 0
    sharing: SharingRule | None = None  # how units share an outage; as the case says where None
    # whether taps and switched shunts move after an outage, whatever the case says
    move_controls: bool = False
    runs: WantedRuns | None = None  # of the outages as they happen
    protection: NoTripCode | None = None  # by which converters trip in them

    def content(self) -> Any:
        """Where the points stand in their file does not count."""
        chain = (self.anchor, *self.items)
        said = [
            [item.point - self.anchor.point, item.intact, item.values, item.out, item.lost]
            for item in chain
        ]
        return plain(
            [
                said,
                self.wanted,
                self.whole,
                self.counted_to,
                self.sharing,
                self.move_controls,
                self.runs,
                self.protection,
            ]
        )

    def failed(self, failure: Failure) -> StretchRecord:
        one = ItemRecord(Status.of(failure), failure.text, failure.cause, lasting=failure.lasting)
        return StretchRecord((one,) * (1 + len(self.items)))


def _runs(task: StretchTask, wanted: WantedRuns, case: Case) -> OutageRuns:
    study = task.study
    case = with_moving_controls(case) if task.move_controls else case
    case = with_protection(case, task.protection)
    return OutageRuns(
        case,
        study.scenario,
        study.layers,
        study.step_size,
        task.sharing,
        seconds=wanted.seconds,
        cleared_after=wanted.cleared_after,
    )


@dataclass
class _Result:
    record: ItemRecord
    found: FoundModes | None = None


def compute_stretch(task: StretchTask) -> StretchRecord:
    return computed(task, _stretch)


def _stretch(task: StretchTask, case: Case) -> StretchRecord:
    with PointBench() as bench:
        return _Worker(task, case, bench).stretch()


class _Worker:
    def __init__(self, task: StretchTask, case: Case, bench: PointBench) -> None:
        self._task, self._bench = task, bench
        study = task.study
        self._preparation = ItemPreparation(
            case,
            study.scenario,
            study.layers,
            study.step_size,
            task.sharing,
            move_controls=task.move_controls,
        )
        self._alone: dict[Any, Any] = {}
        self._runs = None if task.runs is None else _runs(task, task.runs, case)

    def stretch(self) -> StretchRecord:
        """The stretch; where an end of it has growth that its items do not show, all of them are counted."""
        found = self._pass(everywhere=self._task.whole, told=True)
        ends = [
            r.found for r in found if r.found is not None and r.found.growing_elsewhere is not None
        ]
        if any(end.growing_elsewhere for end in ends) and not all(
            r.found is None or r.found.growing_elsewhere is not None for r in found
        ):
            found = self._pass(everywhere=True)
        return self._record(found)

    def _pass(self, *, everywhere: bool, told: bool = False) -> list[_Result]:
        """The anchor and then all items, each from what is most alike of those before it.

        ``told``: whether each item is told as a part that is done."""
        items = [self._task.anchor, *self._task.items]
        results: list[_Result] = []
        for k, item in enumerate(items):
            if k > 1 and told:
                tell_part()
            if k == 1 and item == items[0]:
                record, found = results[0].record, results[0].found
                itself = tuple(range(len(record.eigenvalues)))
                results.append(_Result(replace(record, reference=0, links=itself), found))
                continue
            reference = _reference(items, results, k)
            neighbour = None if reference is None else results[reference].found
            first = not any(other.found is not None for other in results)
            result = self._item(item, neighbour, count=everywhere or first or k == len(items) - 1)
            if reference is not None and neighbour is not None and result.found is not None:
                links = dict.fromkeys(range(len(result.found.modes.eigenvalues)), -1)
                links |= {
                    link.target: link.source for link in match(neighbour.modes, result.found.modes)
                }
                result.record = replace(
                    result.record, reference=reference, links=tuple(links.values())
                )
            results.append(result)
        self._count_the_last(items, results)
        return results

    def _count_the_last(self, items: list[Item], results: list[_Result]) -> None:
        """Count growth at the last item that has modes, where those behind it have none."""
        last = max(
            (k for k, result in enumerate(results) if result.found is not None), default=None
        )
        if last is None:
            return
        found = results[last].found
        if found is not None and found.growing_elsewhere is None:
            counted = self._item(items[last], found, count=True)
            before = results[last].record
            if len(counted.record.eigenvalues) == len(before.eigenvalues):
                counted.record = replace(
                    counted.record, reference=before.reference, links=before.links
                )
                results[last] = counted

    def _record(self, results: list[_Result]) -> StretchRecord:
        items = [self._task.anchor, *self._task.items]
        for item, result in zip(items, results, strict=True):
            if self._runs is not None and item.lost and result.record.status is Status.COMPUTED:
                result.record = self._with_run(item, result.record, self._runs)
        intact = [k for k, item in enumerate(items) if item.intact and results[k].found is not None]
        last = results[intact[-1]].found if intact else None
        return StretchRecord(
            tuple(result.record for result in results),
            _as_kept(results[0].found),
            _as_kept(last),
            intact[-1] if intact else 0,
            self._bench.perturbed,
            self._bench.reused,
        )

    def _with_run(self, item: Item, record: ItemRecord, runs: OutageRuns) -> ItemRecord:
        """The record with what the outage's run shows, or that of its failure."""
        prepared = self._preparation.base
        losing = (one for one in self._task.items if one.lost)
        try:
            run = runs.run(item, {first_bus(one, prepared) for one in losing})
            return replace(record, run=run)
        except Exception as error:  # as that of an item: it must neither end others nor be hidden
            status, kept = failure(error, item)
            told, cause = (
                f"the run of the outage: {text}" for text in (kept.text, kept.cause or kept.text)
            )
            return replace(
                record,
                status=status,
                text=told,
                cause=cause,
                stable=None,
                lasting=kept.lasting,
            )

    def _item(self, item: Item, neighbour: FoundModes | None, *, count: bool) -> _Result:
        warnings: tuple[str, ...] = ()
        loaded: tuple[Loading, ...] = ()
        outside: tuple[Outlier, ...] = ()
        flow = None
        try:
            prepared = self._preparation.prepared(item)
            flow = prepared.scenario.power_flow
            if flow is not None:
                limits = prepared.scenario.file_limits
                loaded = loadings(flow, limits, prepared.dead)
                outside = outliers(flow, limits, prepared.dead)
            warnings = self._preparation.warnings(prepared.scenario)
            if item.out:
                warnings = (*warnings, *self._preparation.held_fields(prepared.scenario))
            start = started(self._bench, self._preparation, item, prepared)
            prepared = start.prepared
            warnings = (*warnings, *warnings_at_start(start.master))
            found = self._modes(start, neighbour, warnings, count=count)
            beyond, fed = (
                self._preparation.overloads(prepared.scenario),
                self._preparation.reactive(prepared.scenario),
            )
            found.record = replace(
                found.record,
                text="; ".join(filter(None, (prepared.text, *map(str, start.widenings)))),
                beyond=beyond,
                of_rating=self._preparation.warnings_of_rating(prepared.scenario, beyond),
                reactive=fed,
                loadings=loaded,
                outliers=outside,
                has_flow=flow is not None,
                widenings=start.widenings,
            )
            return found
        except (
            Exception
        ) as error:  # an error that nobody expected must neither end the other points nor be hidden
            status, kept = failure(error, item)
            record = ItemRecord(
                status,
                kept.text,
                kept.cause,
                warnings,
                loadings=loaded,
                outliers=outside,
                has_flow=flow is not None,
                lasting=kept.lasting,
            )
            return _Result(record)

    def _modes(
        self,
        start: StartedItem,
        neighbour: FoundModes | None,
        warnings: tuple[str, ...],
        *,
        count: bool,
    ) -> _Result:
        prepared, master = start.prepared.scenario, start.master
        point = find_operating_point(master, accept=ACCEPT)
        wanted = self._task.wanted
        if not all(gives_slopes(exchange) for exchange in master.exchanges.values()):
            blocks = Blocks(master, derivatives=True)
            region = (wanted.wider.lowest_hz, wanted.wider.highest_hz)
            result = modes_from(prepared, master, point, blocks, region, wanted.wider.damping)
            modes = ModeSet.of(result.modes, result.model.names)
            elsewhere = int(
                result.stability.stable is False and not (modes.eigenvalues.real > 0).any()
            )
            fastest = result.stability.mode if elsewhere else None
            found = FoundModes(
                modes,
                True,
                None if result.stability.stable is None else elsewhere,
                None if fastest is None else fastest.eigenvalue,
                result.stability.zeros,
                drifts=bool(elsewhere and result.stability.common_speed),
            )
            warnings = (*warnings, *result.warnings)
            record = self._item_record(found, {}, point.residual, warnings, certain=True)
            return _Result(replace(record, map_steps=result.model.period), found)
        linear = self._bench.linear_model()
        model, whole = linear.model, linear.components
        warnings = (*warnings, *linear.doubts)
        most = self._task.counted_to
        count = count or most is None or len(model.names) <= most
        own = self._own_eigenvalues(whole) if count else np.zeros(0, dtype=complex)
        found = find_modes_here(
            model,
            own,
            wanted,
            None if neighbour is None else neighbour.modes,
            count=count,
            speeds=prepared.case.table.analysis.swing,
        )
        warnings = (*warnings, *standing_apart(master, model, found.zeros))
        residues = _residues(found.modes, whole)
        record = self._item_record(
            found, residues, point.residual, warnings, certain=not linear.doubts
        )
        return _Result(record, found)

    def _item_record(
        self,
        found: FoundModes,
        residues: Mapping[str, Any],
        residual: float,
        warnings: tuple[str, ...],
        *,
        certain: bool,
    ) -> ItemRecord:
        critical, counted = found.critical(self._task.wanted), found.growing_elsewhere is not None
        stable = True if counted and certain else None  # where none grows of those that were found
        record = ItemRecord(
            Status.COMPUTED,
            warnings=warnings,
            residual=residual,
            stable=False if found.grows else stable,
            counted=counted,
            growing_elsewhere=found.growing_elsewhere or 0,
            fastest=None if found.fastest is None else (found.fastest.real, found.fastest.imag),
            drifts=found.drifts,
            searched=found.searched,
            zeros=found.zeros,
            slowest=found.slowest,
            eigenvalues=found.modes.eigenvalues,
            critical=tuple(critical),
            shares=_shares(found.modes),
            residues=dict(residues),
            links=(-1,) * len(found.modes.eigenvalues),
        )
        above = found.above
        if above is None:
            return replace(record, looked_above=found.looked_above)
        value = (above.eigenvalue.real, above.eigenvalue.imag)
        who = shares_in_words(above.by_component.items())
        return replace(record, looked_above=found.looked_above, above=value, who_above=who)

    def _own_eigenvalues(self, whole: Mapping[str, Any]) -> Any:
        parts = []
        for c in whole.values():
            if id(c) not in self._alone:
                self._alone[id(c)] = c, np.linalg.eigvals(c.A_c).astype(complex)
            parts.append(self._alone[id(c)][1])
        return np.concatenate(parts)


def _reference(items: list[Item], results: list[_Result], k: int) -> int | None:
    """The item before it that is most alike: the intact network at the same point, the last intact one, or the last."""
    done = [i for i in range(k) if results[i].found is not None]
    same = [i for i in done if items[i].intact and items[i].point == items[k].point]
    intact = [i for i in done if items[i].intact]
    choice = same or intact or done
    return choice[-1] if choice else None


def _as_kept(found: FoundModes | None) -> ModeSet | None:
    """Modes with vectors of half the size, by which stretches are joined."""
    if found is None:
        return None
    modes = found.modes
    return replace(
        modes, left=modes.left.astype(np.complex64), right=modes.right.astype(np.complex64)
    )


def _shares(modes: ModeSet) -> dict[str, Any]:
    if not len(modes.eigenvalues):
        return {}
    factors = modes.participation()
    owners = [name.partition(".")[0] for name in modes.names]
    order = {owner: k for k, owner in enumerate(dict.fromkeys(owners))}
    sums = np.zeros((len(factors), len(order)))
    for k, owner in enumerate(owners):
        sums[:, order[owner]] += factors[:, k]
    return {owner: sums[:, k].astype(np.float32) for owner, k in order.items()}


def _residues(modes: ModeSet, whole: Mapping[str, Any]) -> dict[str, Any]:
    """Residues of every converter, from power references to frequency, shape (2, m) [rad/s per pu and pu]."""
    found, first, n = {}, 0, len(modes.names)
    for name, c in whole.items():
        last = first + len(c.states)
        if c.observed == OBSERVED and len(modes.eigenvalues):
            row = np.zeros(n, dtype=complex)
            row[first:last] = c.C_o[0]
            pair = []
            for k in range(len(DRIVEN)):
                column = np.zeros(n, dtype=complex)
                column[first:last] = c.B_c[:, len(c.inputs) - len(DRIVEN) + k]
                pair.append(residue(modes, column, row))
            found[name] = np.array(pair).astype(np.complex64)
        first = last
    return found
