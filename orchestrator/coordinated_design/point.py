"""One operating point with its outage for a design: its whole spectrum, its modes, and its open POD loops."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from orchestrator.analysis.apart import standing_apart
from orchestrator.analysis.linear_model import LinearModel
from orchestrator.analysis.modes import ELECTROMECHANICAL_HZ, ZERO, Mode, find_spectrum, index_of_rightmost
from orchestrator.analysis.slope_linearization import gives_slopes
from orchestrator.analysis.steady_state import find_operating_point
from orchestrator.arrays import Complex
from orchestrator.cases.case import Case
from orchestrator.coordinated_design.measured_loops import measure
from orchestrator.coordinated_design.open_loops import OpenLoops, PodPlace
from orchestrator.coupling.master import Master
from orchestrator.errors import AnalysisError
from orchestrator.operating_points.bench import PointBench
from orchestrator.operating_points.item import Item, Status
from orchestrator.operating_points.preparation import ACCEPT, ItemPreparation, failure
from orchestrator.points.codec import plain
from orchestrator.points.failure import Failure
from orchestrator.points.task import Kept, Task, computed
from orchestrator.study.naming import named_modes

_MOST_STATES = 2500  # all eigenvalues of larger systems take too long for a design


@dataclass(frozen=True)
class PointModes:
    # status, text: what became of it, and why
    status: Status
    text: str = ""
    warnings: tuple[str, ...] = ()
    doubtful: bool = False  # whether a limit is so close that the linear model is doubtful
    # all eigenvalues [rad/s]; empty where nothing was computed
    values: Complex = field(default_factory=lambda: np.zeros(0, dtype=complex))
    swinging: tuple[int, ...] = ()  # places of the electromechanical modes, least damped first
    named: dict[str, int] = field(default_factory=dict)  # the place of each mode that the case names
    who: tuple[str, ...] = ()  # for each of ``swinging``: who takes part most
    rightmost: str = ""  # the same for the eigenvalue with the largest real part
    loops: OpenLoops | None = None  # the open loops; None where they were not asked for
    clocks: int = 0  # number of states that are coupled with no other, each of which is a zero in ``values``
    lasting: bool = True  # whether computing it again would give the same

    @property
    def computed(self) -> bool:
        return self.status is Status.COMPUTED

    @property
    def zeros(self) -> int:
        """Number of eigenvalues that are zero, clocks left out: one is the free angle, two are a frequency that
        nothing holds."""
        return int((np.abs(self.values) <= ZERO).sum()) - self.clocks


@dataclass(frozen=True)
class PointsRecord(Kept):
    points: tuple[PointModes, ...]

    @property
    def lasting(self) -> bool:
        return all(point.lasting for point in self.points)


@dataclass(frozen=True)
class PointsTask(Task):
    record = PointsRecord
    items: tuple[Item, ...]
    places: tuple[PodPlace, ...]  # loops that are measured; none where only the modes are asked for

    def content(self) -> Any:
        """Where the points stand in their file does not count."""
        said = [[item.values, item.out, item.lost] for item in self.items]
        return plain([said, self.places])

    def failed(self, failure: Failure) -> PointsRecord:
        one = PointModes(Status.of(failure), failure.text, lasting=failure.lasting)
        return PointsRecord((one,) * len(self.items))


def compute_points(task: PointsTask) -> PointsRecord:
    return computed(task, _of_task)


def _of_task(task: PointsTask, case: Case) -> PointsRecord:
    with PointBench() as bench:
        preparation = ItemPreparation(case, task.study.scenario, task.study.layers, task.study.step_size)
        return PointsRecord(tuple(_points(task, case, preparation, bench)))


def _points(task: PointsTask, case: Case, preparation: ItemPreparation, bench: PointBench) -> Iterator[PointModes]:
    for item in task.items:
        warnings: tuple[str, ...] = ()
        try:
            prepared = preparation.prepared(item).scenario
            warnings = preparation.warnings(prepared)
            found = _at(case, bench, bench.master(prepared), task.places, warnings)
        except Exception as error:  # an error that nobody expected must neither end the other points nor be hidden
            kind, text, lasting = failure(error, item)
            found = PointModes(kind, text, warnings, lasting=lasting)
        yield found


def _at(
    case: Case, bench: PointBench, master: Master, places: Sequence[PodPlace], warnings: tuple[str, ...]
) -> PointModes:
    find_operating_point(master, accept=ACCEPT)
    silent = [name for name, exchange in master.exchanges.items() if not gives_slopes(exchange)]
    if silent:
        raise AnalysisError(
            f"components {', '.join(silent[:3])} do not give their derivatives; a design over operating points needs "
            "them of all FMUs"
        )
    linear = bench.linear_model()
    model, blocks, warnings = linear.model, linear.blocks, (*warnings, *linear.doubts)
    if len(model.names) > _MOST_STATES:
        raise AnalysisError(f"the system has {len(model.names)} states; a design needs all eigenvalues, of at most "
                            f"{_MOST_STATES}")  # fmt: skip
    loops = measure(master, model, blocks, places) if places else None
    found = _modes(case, model, loops, warnings, doubtful=bool(linear.doubts))
    return replace(found, warnings=(*warnings, *standing_apart(master, model, found.zeros)))


def _modes(
    case: Case, model: LinearModel, loops: OpenLoops | None, warnings: tuple[str, ...], *, doubtful: bool
) -> PointModes:
    spectrum = find_spectrum(model, *ELECTROMECHANICAL_HZ)
    modes = [mode for mode in spectrum.modes if mode.is_oscillation]
    place = {complex(value): k for k, value in enumerate(spectrum.eigenvalues.tolist())}
    named = named_modes(case, model, modes).named
    return PointModes(
        Status.COMPUTED, warnings=warnings, doubtful=doubtful, values=spectrum.eigenvalues,
        swinging=tuple(place[mode.eigenvalue] for mode in modes),
        named={name: place[mode.eigenvalue] for name, mode in named.items()}, who=tuple(_who(mode) for mode in modes),
        rightmost="" if index_of_rightmost(spectrum.eigenvalues) is None else _who(spectrum.rightmost), loops=loops,
        clocks=model.clocks,
    )  # fmt: skip


def _who(mode: Mode | None) -> str:
    shares: Mapping[str, float] = {} if mode is None else mode.by_component
    return ", ".join(name for name, _ in list(shares.items())[:2])
