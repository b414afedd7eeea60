"""One study: a case, what to compute of each scenario, and what comes out."""

import fnmatch
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import xarray as xr

from orchestrator.analysis.critical_modes import find_critical_modes, growth_rate, nearest_eigenvalue
from orchestrator.analysis.identification import IdentifiedMode, identify_modes, nearest
from orchestrator.analysis.linear_model import LinearModel
from orchestrator.analysis.linearization import Blocks, compose, continuous
from orchestrator.analysis.modes import Mode, eigenvalues, find_modes, most_associated, most_opposed
from orchestrator.analysis.steady_state import OperatingPoint, find_operating_point
from orchestrator.cases.case import Case
from orchestrator.cases.prepare import PreparedScenario
from orchestrator.cases.schema import ReferenceModeTable
from orchestrator.coupling.master import Master
from orchestrator.coupling.observers import Observer
from orchestrator.coupling.recorder import Recorder
from orchestrator.coupling.schedule import jacobi
from orchestrator.coupling.statistics import StepStatistics
from orchestrator.errors import AnalysisError, CosimError
from orchestrator.report.signals import signal
from orchestrator.report.storage import trajectory_dataset

STEP_SIZES = (50e-6, 100e-6, 200e-6, 500e-6)
"""Communication steps [s] for which the shift of the electromechanical mode is reported."""

_COUPLING_UNSTABLE = 1.0
"""A step map's growth rate above the continuous system's by more than this [1/s] is the coupling's doing."""


@dataclass(frozen=True)
class ModesResult:
    """Steady state and modes of one scenario.

    Attributes
    ----------
    named
        The modes that the case looks for by their shape, as far as they are in range.
    references
        Somebody else's figures for them, where their conditions hold.
    """

    prepared: PreparedScenario
    operating_point: OperatingPoint
    model: LinearModel
    modes: list[Mode]
    named: dict[str, Mode]
    references: dict[str, ReferenceModeTable]
    warnings: tuple[str, ...]

    @property
    def electromechanical(self) -> Mode | None:
        """The first of the named modes."""
        return next(iter(self.named.values()), None)

    def name_of(self, mode: Mode) -> str | None:
        """Name of a mode, if it has one."""
        return next((name for name, named in self.named.items() if named is mode), None)


@dataclass(frozen=True, slots=True)
class ModeShift:
    """How far a communication step moves the electromechanical mode from the continuous system's [rad/s]."""

    schedule: str
    step_size: float
    continuous: complex
    eigenvalue: complex

    @property
    def shift(self) -> float:
        return abs(self.eigenvalue - self.continuous)


@dataclass
class RunResult:
    """A scenario's modes and its simulated response.

    Attributes
    ----------
    dataset
        What was recorded, up to the failure if there was one.
    ring_down
        The electromechanical mode as identified from the response.
    failure
        The error that ended the run before its time.
    """

    modes: ModesResult
    dataset: xr.Dataset
    statistics: StepStatistics | None = None
    ring_down: IdentifiedMode | None = None
    shifts: list[ModeShift] = field(default_factory=list)
    failure: CosimError | None = None


def compute_modes(
    case: Case,
    prepared: PreparedScenario,
    frequency_range: tuple[float, float] = (0.1, 2.0),
    critical: float | None = None,
) -> ModesResult:
    """Initialise a scenario's FMUs, verify their steady state, and linearise around it.

    Parameters
    ----------
    frequency_range
        [Hz]
    critical
        Damping ratio below which modes are looked for, by sparse search; None for the full spectrum.
    """
    with _master(prepared) as master:
        return _modes(case, prepared, master, frequency_range, critical)


def run_scenario(
    case: Case,
    prepared: PreparedScenario,
    frequency_range: tuple[float, float] = (0.1, 2.0),
    observers: Sequence[Observer] = (),
) -> RunResult:
    """Compute the modes of a scenario and its response to the case's events.

    A component that fails in the middle ends the run; what was recorded until then is in the result.
    """
    recorder = Recorder(prepared.record, prepared.record_every)
    statistics, failure = None, None
    with _master(prepared) as master:
        modes = _modes(case, prepared, master, frequency_range)
        shifts = _shifts(master, modes.electromechanical)
        try:
            statistics = master.run(prepared.stop_time, prepared.events, [recorder, *observers])
        except CosimError as error:
            failure = error
    dataset = trajectory_dataset(recorder, case, prepared)
    ring_down = None if failure else _ring_down(case, modes, dataset)
    return RunResult(modes, dataset, statistics, ring_down, shifts, failure)


def run_study(
    case: Case,
    scenarios: Sequence[PreparedScenario],
    observe: Callable[[PreparedScenario], Sequence[Observer]] | None = None,
) -> Iterator[RunResult]:
    """Run scenarios one after another; each result is there as soon as it is computed."""
    for prepared in scenarios:
        yield run_scenario(case, prepared, observers=observe(prepared) if observe else ())


def _master(prepared: PreparedScenario) -> Master:
    return Master(prepared.system, prepared.schedule, prepared.step_size, prepared.stop_time)


def _modes(
    case: Case,
    prepared: PreparedScenario,
    master: Master,
    frequency_range: tuple[float, float],
    critical: float | None = None,
) -> ModesResult:
    point = find_operating_point(master)
    model = compose(Blocks(master), master.schedule)
    modes = (
        find_modes(model, *frequency_range)
        if critical is None
        else find_critical_modes(model, *frequency_range, critical)
    )
    named = _named_modes(case, model, modes)
    return ModesResult(prepared, point, model, modes, named, _references(case, prepared), _warnings(master, model))


def _named_modes(case: Case, model: LinearModel, modes: list[Mode]) -> dict[str, Mode]:
    """The modes whose shape the case describes."""

    def states(patterns: Sequence[str]) -> list[str]:
        return [name for name in model.names if any(fnmatch.fnmatch(name, p) for p in patterns)]

    found = {}
    for table in case.table.analysis.modes:
        if table.against is not None:
            mode = most_opposed(modes, *(states(side) for side in table.against))
        else:
            mode = most_associated(modes, states(table.states)) if states(table.states) else None
        if mode is not None:
            found[table.name] = mode
    return found


def _warnings(master: Master, model: LinearModel) -> tuple[str, ...]:
    """Say before a run that the coupling itself is unstable."""
    coupled = growth_rate(model)
    if coupled is None or coupled <= _COUPLING_UNSTABLE:
        return ()
    try:
        growth = eigenvalues(continuous(Blocks(master, derivatives=True))).real.max()
    except AnalysisError:
        return ()
    if coupled - growth <= _COUPLING_UNSTABLE:
        return ()
    return (
        f"the coupling is numerically unstable: with a communication step of {model.step_size:g} s the step map grows "
        f"at {coupled:.3g} 1/s where the continuous system has at most {growth:.3g} 1/s; take a shorter step or the "
        "Gauss-Seidel schedule, devices before the grid",
    )


def _references(case: Case, prepared: PreparedScenario) -> dict[str, ReferenceModeTable]:
    table = case.table.reference
    if table is None or not all(_same(prepared.values.get(name), value) for name, value in table.when.items()):
        return {}
    return table.modes.get(prepared.name, {})


def _same(value: Any, wanted: Any) -> bool:
    return value is not None and bool(np.isclose(float(value), float(wanted)))


def _shifts(master: Master, mode: Mode | None) -> list[ModeShift]:
    """The electromechanical mode at several steps and both schedules, beside the continuous system's."""
    if mode is None:
        return []
    try:
        exact = nearest_eigenvalue(continuous(Blocks(master, derivatives=True)), mode.eigenvalue)
    except AnalysisError:
        return []
    schedules = {"jacobi": jacobi(tuple(master.components)), master.schedule.name: master.schedule}
    shifts = []
    for step_size in STEP_SIZES:
        at_step = Blocks(master, step_size)
        for name, schedule in sorted(schedules.items()):
            value = nearest_eigenvalue(compose(at_step, schedule), exact)
            shifts.append(ModeShift(name, step_size, exact, value))
    return shifts


def _ring_down(case: Case, modes: ModesResult, dataset: xr.Dataset) -> IdentifiedMode | None:
    table, mode = case.table.analysis.ring_down, modes.electromechanical
    if table is None or mode is None:
        return None
    recorded = signal(dataset, table.signal)
    if recorded is None:
        return None
    window = recorded.sel(time=slice(table.start, None))
    try:
        found = identify_modes(window["time"].values, window.values)
    except AnalysisError:
        return None
    return nearest(found, mode.eigenvalue)


def modes_json(case: Case, step_size: float, results: Sequence[ModesResult]) -> Mapping[str, Any]:
    """The machine-readable form of `gfor modes`."""
    return {
        "case": case.name,
        "step_size_s": step_size,
        "scenarios": [
            {
                "name": r.prepared.name,
                "residual": r.operating_point.residual,
                "states": r.model.number_of_states,
                "warnings": list(r.warnings),
                "modes": [
                    {
                        "real": m.eigenvalue.real,
                        "imag": m.eigenvalue.imag,
                        "frequency_hz": m.frequency_hz,
                        "damping_percent": m.damping_percent,
                        "name": r.name_of(m),
                        "participation": [{"state": s, "factor": f} for s, f in m.participation if f >= 1e-4],
                    }
                    for m in r.modes
                ],
            }
            for r in results
        ],
    }
