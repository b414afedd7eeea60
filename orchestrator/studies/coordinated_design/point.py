"""One operating point with its outage for a design: its whole spectrum, its modes, and its open POD loops."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from orchestrator.cases.case import Case
from orchestrator.core.arrays import Complex, Vector
from orchestrator.core.errors import AnalysisError
from orchestrator.core.options import Option, command
from orchestrator.linear.models.apart import standing_apart
from orchestrator.linear.models.component_linearization import ComponentLinearization
from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.linear.models.linearization import Blocks
from orchestrator.linear.models.slope_linearization import gives_slopes, linearize_slopes
from orchestrator.linear.models.steady_state import find_operating_point
from orchestrator.linear.spectra.modes import (
    ELECTROMECHANICAL_HZ,
    ZERO,
    Mode,
    find_spectrum,
    index_of_rightmost,
)
from orchestrator.studies.coordinated_design.open_loops import OpenLoops, PodPlace
from orchestrator.studies.modes.naming import named_modes
from orchestrator.studies.operating_points.bench import PointBench
from orchestrator.studies.operating_points.item import Item, Status
from orchestrator.studies.operating_points.preparation import ACCEPT, ItemPreparation, failure
from orchestrator.studies.operating_points.widening import started
from orchestrator.studies.points.codec import plain
from orchestrator.studies.points.failure import Failure
from orchestrator.studies.points.task import Kept, Task, computed
from orchestrator.systems.coupling.master import Master
from orchestrator.systems.coupling.step_awareness import other_step

UNIT_GAIN = 50.0  # gain with which a loop is measured [pu]; the signal stays far below its limit
# A loop has one signal: the second singular value of its effect is below this part of the first
_RANK = 1e-6


def measure(
    master: Master, model: LinearModel, blocks: Blocks, places: Sequence[PodPlace]
) -> OpenLoops:
    windows, known = blocks.state_windows(), blocks.components
    there = [place for place in places if place.component in known]
    p = len(blocks.output_names)
    newest, arriving = np.arange(p), p + np.arange(len(blocks.links))  # as `continuous` numbers w
    U, V = np.zeros((len(model.names), len(there))), np.zeros((len(there), len(model.names)))
    sent, seen = np.zeros((model.K.shape[0], len(there))), np.zeros((len(there), model.K.shape[0]))
    for k, place in enumerate(there):
        name, before = place.component, known[place.component]
        n = len(before.states)
        acts, sees = _loop(master, place, before)
        U[windows[name], k], sent[:p][blocks.window[name], k] = acts[:n], acts[n:]
        V[k, windows[name]], seen[k, blocks.entries(name, newest, arriving)] = sees[:n], sees[n:]
    D = None
    if sent.any() or seen.any():
        # What a loop gives to the outputs comes back by way of the network: ż = F·z + G·w + U·s, w = H·z + K·w +
        # sent·s.
        travelled = model.settle(sent)
        through = model.settle(model.H.toarray())
        U, V, D = U + model.G @ travelled, V + seen @ through, seen @ travelled

    def answer(s: complex) -> Vector:
        solve = model.shifted(s).solve_exactly
        return np.asarray(-V @ np.column_stack([solve(column) for column in U.T + 0j]))

    return OpenLoops.of(model.A, U, V, there, model.names, D=D, answer=answer)


def _loop(master: Master, place: PodPlace, before: ComponentLinearization) -> tuple[Vector, Vector]:
    """Where the signal with unit gain acts, on states and outputs, and what it is made of, states and inputs."""
    component, exchange = master.components[place.component], master.exchanges[place.component]
    saved = component.save_state()
    try:
        component.set({f"{place.controller}.enabled": True, f"{place.controller}.K": UNIT_GAIN})
        # as the whole system is: without a communication step
        with other_step(master, place.component, 0.0):
            with_it = linearize_slopes(exchange, master.time, master.clock.step_size)
    finally:
        component.restore_state(saved)
        component.free_state(saved)
        component.set({f"{place.controller}.enabled": False})
    if with_it.A_c is None or with_it.B_c is None or before.A_c is None or before.B_c is None:
        raise AnalysisError(
            f"component {place.component!r} does not give its derivatives, so no loop can be measured"
        )
    m = len(with_it.inputs)
    changes = [
        [with_it.A_c - before.A_c, with_it.B_c - before.B_c[:, :m]],
        [with_it.C - before.C, with_it.D - before.D[:, :m]],
    ]
    left, sizes, right = np.linalg.svd(np.block(changes) / UNIT_GAIN)
    if sizes[0] == 0:
        raise AnalysisError(
            f"{place.name} does not act on its converter at all; nothing can be designed there"
        )
    if sizes[1] > _RANK * sizes[0]:
        raise AnalysisError(f"{place.name} acts on its converter in more ways than by one signal")
    return left[:, 0] * sizes[0], right[0]


_MOST_STATES = 3500
"""All eigenvalues of larger systems take too long for a design."""


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
    # the place of each mode that the case names
    named: dict[str, int] = field(default_factory=dict)
    who: tuple[str, ...] = ()  # for each of ``swinging``: who takes part most
    rightmost: str = ""  # the same for the eigenvalue with the largest real part
    loops: OpenLoops | None = None  # the open loops; None where they were not asked for
    # number of states that nothing moves, each of which is a zero in ``values``
    clocks: int = 0
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
        preparation = ItemPreparation(
            case, task.study.scenario, task.study.layers, task.study.step_size
        )
        return PointsRecord(tuple(_points(task, case, preparation, bench)))


def _points(
    task: PointsTask, case: Case, preparation: ItemPreparation, bench: PointBench
) -> Iterator[PointModes]:
    for item in task.items:
        warnings: tuple[str, ...] = ()
        try:
            prepared = preparation.prepared(item)
            warnings = preparation.warnings(prepared.scenario)
            start = started(bench, preparation, item, prepared)
            warnings = (*warnings, *map(str, start.widenings))
            found = _at(case, bench, start.master, task.places, warnings)
        except (
            Exception
        ) as error:  # an error that nobody expected must neither end the other points nor be hidden
            status, kept = failure(error, item)
            found = PointModes(status, kept.text, warnings, lasting=kept.lasting)
        yield found


def _at(
    case: Case,
    bench: PointBench,
    master: Master,
    places: Sequence[PodPlace],
    warnings: tuple[str, ...],
) -> PointModes:
    point = find_operating_point(master, accept=ACCEPT)
    silent = [name for name, exchange in master.exchanges.items() if not gives_slopes(exchange)]
    if silent:
        raise AnalysisError(
            f"components {', '.join(silent[:3])} do not give their derivatives; a design over operating points needs "
            "them of all FMUs"
        )
    linear = bench.linear_model()
    model, blocks = linear.model, linear.blocks
    warnings = (*warnings, *(one.sentence for one in point.held), *linear.doubts)
    if len(model.names) > _MOST_STATES:
        raise AnalysisError(
            f"the system has {len(model.names)} states; a design over operating points computes all eigenvalues at "
            f"each, of at most {_MOST_STATES} states. Design a controller at one point, where its mode is followed: "
            + command(
                "design CASE", (Option.CONTROLLER, places[0].controller if places else "pod_p")
            )
        )
    loops = measure(master, model, blocks, places) if places else None
    found = _modes(case, model, loops, warnings, doubtful=bool(linear.doubts))
    return replace(found, warnings=(*warnings, *standing_apart(master, model, found.zeros)))


def _modes(
    case: Case,
    model: LinearModel,
    loops: OpenLoops | None,
    warnings: tuple[str, ...],
    *,
    doubtful: bool,
) -> PointModes:
    spectrum = find_spectrum(model, *ELECTROMECHANICAL_HZ)
    modes = [mode for mode in spectrum.modes if mode.is_oscillation]
    place = {complex(value): k for k, value in enumerate(spectrum.eigenvalues.tolist())}
    named = named_modes(case, model, modes).named
    exists = index_of_rightmost(spectrum.eigenvalues) is not None
    rightmost = _who(spectrum.rightmost) if exists else ""
    return PointModes(
        Status.COMPUTED,
        warnings=warnings,
        doubtful=doubtful,
        values=spectrum.eigenvalues,
        swinging=tuple(place[mode.eigenvalue] for mode in modes),
        named={name: place[mode.eigenvalue] for name, mode in named.items()},
        who=tuple(map(_who, modes)),
        rightmost=rightmost,
        loops=loops,
        clocks=len(model.unmoved),
    )


def _who(mode: Mode | None) -> str:
    shares: Mapping[str, float] = {} if mode is None else mode.by_component
    return ", ".join(name for name, _ in list(shares.items())[:2])
