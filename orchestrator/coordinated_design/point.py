"""One operating point with its outage for a design: its whole spectrum, its modes, and its open POD loops.

Everything here can be sent to another process or another machine.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any, Self

import numpy as np

from orchestrator.analysis.apart import standing_apart
from orchestrator.analysis.linear_model import LinearModel
from orchestrator.analysis.linearization import Blocks, continuous
from orchestrator.analysis.modes import ELECTROMECHANICAL_HZ, ZERO, Mode, find_spectrum, index_of_rightmost
from orchestrator.analysis.slope_linearization import gives_slopes
from orchestrator.analysis.steady_state import find_operating_point
from orchestrator.analysis.threads import alone as on_one_thread
from orchestrator.arrays import Complex
from orchestrator.cases.case import Case
from orchestrator.cases.parameter_files import ParameterFile
from orchestrator.coordinated_design.measured_loops import measure
from orchestrator.coordinated_design.open_loops import OpenLoops, PodPlace
from orchestrator.coupling.master import Master
from orchestrator.errors import AnalysisError
from orchestrator.points.executor import WorkerLostError
from orchestrator.points.key import same_case
from orchestrator.points.store import Arrays
from orchestrator.screening.bench import ScreeningBench
from orchestrator.screening.point import without_references
from orchestrator.screening.preparation import ACCEPT, ItemPreparation, failure
from orchestrator.screening.record import Item, Status
from orchestrator.study.naming import named_modes

_MOST_STATES = 2500  # all eigenvalues of larger systems take too long for a design
_SHOWN = 3


@dataclass(frozen=True)
class PointsTask:
    """Operating points with outages that are computed together.

    ``case``, ``fingerprint``, ``scenario``, ``layers``, ``step_size``, ``trust_fmus``: As in
    `orchestrator.screening.point.StretchTask`.
    """

    case: str
    fingerprint: str
    scenario: str
    layers: tuple[ParameterFile, ...]
    step_size: float | None
    items: tuple[Item, ...]
    places: tuple[PodPlace, ...]  # loops that are measured; none where only the modes are asked for
    key: str
    trust_fmus: bool = False


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
        nothing holds.
        """
        return int((np.abs(self.values) <= ZERO).sum()) - self.clocks


_LOOP_ARRAYS = ("A", "U", "V", "D", "right", "left", "rest")


@dataclass(frozen=True)
class PointsRecord:
    """The points of a task, in its order."""

    points: tuple[PointModes, ...]

    @property
    def lasting(self) -> bool:
        return all(point.lasting for point in self.points)

    @classmethod
    def lost(cls, task: Any, error: WorkerLostError) -> Self:
        return cls(tuple(PointModes(Status.LOST, str(error), lasting=False) for _ in task.items))

    def stored(self) -> tuple[dict[str, Any], Arrays]:
        """Header and arrays for a `PointStore`."""
        plain = [f.name for f in fields(PointModes) if f.name not in ("values", "loops")]
        entries, arrays = [], Arrays()
        for k, point in enumerate(self.points):
            entry = {name: getattr(point, name) for name in plain}
            arrays[f"values{k}"] = point.values
            if point.loops is not None:
                loops = point.loops
                entry["loops"] = {"places": [place.name for place in loops.places], "names": list(loops.names)}
                known = {name: getattr(loops, name) for name in _LOOP_ARRAYS}
                arrays |= {f"{name}{k}": array for name, array in known.items() if array is not None}
            entries.append(entry)
        return {"points": entries}, arrays

    @classmethod
    def restored(cls, header: dict[str, Any], arrays: Arrays) -> Self | None:
        """The record that was stored in this form; None if the file has another form."""
        try:
            return cls(tuple(_restored(entry, arrays, k) for k, entry in enumerate(header["points"])))
        except (KeyError, TypeError, ValueError):
            return None


def _restored(entry: dict[str, Any], arrays: Arrays, k: int) -> PointModes:
    tuples = {name: tuple(entry[name]) for name in ("warnings", "swinging", "who")}
    said, loops = entry.pop("loops", None), None
    if said is not None:
        own = {name: arrays.get(f"{name}{k}") for name in _LOOP_ARRAYS}
        places = tuple(PodPlace.of(name) for name in said["places"])
        loops = OpenLoops(**own, places=places, names=tuple(said["names"]))  # type: ignore[arg-type]
    rest = entry | tuples | {"status": Status(entry["status"])}
    return PointModes(**rest, values=arrays[f"values{k}"], loops=loops)


def compute_points(task: PointsTask) -> PointsRecord:
    """Compute all points of a task; failures become records as well."""
    case = same_case(task.case, task.fingerprint, task.trust_fmus)
    with on_one_thread(), ScreeningBench() as bench:
        preparation = ItemPreparation(case, task.scenario, task.layers, task.step_size)
        return PointsRecord(tuple(_points(task, case, preparation, bench)))


def _points(task: PointsTask, case: Case, preparation: ItemPreparation, bench: ScreeningBench) -> Iterator[PointModes]:
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
    case: Case, bench: ScreeningBench, master: Master, places: Sequence[PodPlace], warnings: tuple[str, ...]
) -> PointModes:
    """The modes of a running system, and its loops."""
    find_operating_point(master, accept=ACCEPT)
    silent = [name for name, exchange in master.exchanges.items() if not gives_slopes(exchange)]
    if silent:
        raise AnalysisError(
            f"components {', '.join(silent[:3])} do not give their derivatives; a design over operating points needs "
            "them of all FMUs"
        )
    known = {name: without_references(bench.linearized(name)) for name in master.components}
    blocks = Blocks(master, known=known, without_step=True)
    model = continuous(blocks)
    if len(model.names) > _MOST_STATES:
        raise AnalysisError(f"the system has {len(model.names)} states; a design needs all eigenvalues, of at most "
                            f"{_MOST_STATES}")  # fmt: skip
    doubtful = [f"{n}: {', '.join(c.doubtful[:_SHOWN])}" for n, c in known.items() if c.doubtful]
    if doubtful:
        text = f"a limit is so close that the linear model is doubtful: {'; '.join(doubtful[:_SHOWN])}"
        warnings = (*warnings, text)
    loops = measure(master, model, blocks, places) if places else None
    found = _modes(case, model, loops, warnings, doubtful=bool(doubtful))
    return replace(found, warnings=(*warnings, *standing_apart(master, model, found.zeros)))


def _modes(
    case: Case, model: LinearModel, loops: OpenLoops | None, warnings: tuple[str, ...], *, doubtful: bool
) -> PointModes:
    spectrum = find_spectrum(model, *ELECTROMECHANICAL_HZ)
    modes = [mode for mode in spectrum.modes if mode.is_oscillation]
    place = {complex(value): k for k, value in enumerate(spectrum.eigenvalues.tolist())}
    named = named_modes(case, model, modes).named
    return PointModes(
        Status.COMPUTED,
        warnings=warnings,
        doubtful=doubtful,
        values=spectrum.eigenvalues,
        swinging=tuple(place[mode.eigenvalue] for mode in modes),
        named={name: place[mode.eigenvalue] for name, mode in named.items()},
        who=tuple(_who(mode) for mode in modes),
        rightmost="" if index_of_rightmost(spectrum.eigenvalues) is None else _who(spectrum.rightmost),
        loops=loops,
        clocks=model.clocks,
    )


def _who(mode: Mode | None) -> str:
    shares: Mapping[str, float] = {} if mode is None else mode.by_component
    return ", ".join(name for name, _ in list(shares.items())[:2])
