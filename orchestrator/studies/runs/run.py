"""A run: the modes of a scenario, its response to the events, what links the two, and what went wrong in it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING

from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.core.errors import (
    AnalysisError,
    ComponentError,
    CosimError,
    InputError,
    NotTakenUpError,
    ResultsError,
    RunInterruptedError,
)
from orchestrator.core.interrupts import calls
from orchestrator.core.options import Option
from orchestrator.devices.fmi.component import Component
from orchestrator.devices.fmi.instance import is_isolated, protections_of
from orchestrator.devices.sandbox.protections_in_force import Protection, missing
from orchestrator.linear.doubts.coupling_growth import coupling_growth
from orchestrator.linear.doubts.excitation_limiters import warnings_at_end
from orchestrator.linear.doubts.starts import warnings_at_start
from orchestrator.linear.models.device_start import misfits_of, sentences
from orchestrator.linear.models.linearization import Blocks, compose
from orchestrator.linear.models.state_access import obstacle
from orchestrator.linear.signals.identification import IdentifiedMode
from orchestrator.linear.spectra.critical_modes import nearest_eigenvalue
from orchestrator.linear.spectra.modes import ELECTROMECHANICAL_HZ
from orchestrator.output.results.file_writers import trajectory_dataset
from orchestrator.output.results.recording_reader import open_whole
from orchestrator.output.results.recording_writer import ENDED_EARLY, TRAJECTORY, RecordingFolder
from orchestrator.simulation.engine import ENGINES, Engine
from orchestrator.simulation.federates import Federates
from orchestrator.simulation.watch.finding import NOT_JUDGED, UNSTABLE, Finding
from orchestrator.simulation.watch.relay_trips import relays_in
from orchestrator.simulation.watch.watch import Watch
from orchestrator.studies.modes.linear import NoLinearResponseError, linear_response
from orchestrator.studies.modes.modes import ModesResult, modes_of, running, unknown_modes
from orchestrator.studies.runs.after_events import modes_after
from orchestrator.studies.runs.checkpoint_mark import computed
from orchestrator.studies.runs.checkpoints import Checkpoints
from orchestrator.studies.runs.long_enough import with_one_stop
from orchestrator.studies.runs.ring_down import ring_down_of
from orchestrator.systems.coupling.bus_relays import Nearness, Trip
from orchestrator.systems.coupling.master import Master
from orchestrator.systems.coupling.observers import Observer
from orchestrator.systems.coupling.run_state import NOT_KEPT
from orchestrator.systems.coupling.schedule import jacobi
from orchestrator.systems.coupling.statistics import StepStatistics

if TYPE_CHECKING:
    import xarray as xr

STEPS = (0.5, 1.0, 2.0, 5.0)
"""Communication steps for which the shift of the electromechanical mode is reported, in parts of the case's own."""


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
    modes: ModesResult
    dataset: xr.Dataset
    statistics: StepStatistics | None = None
    ring_down: IdentifiedMode | None = None
    shifts: list[ModeShift] = field(default_factory=list)
    linear: xr.Dataset | None = None
    failure: CosimError | None = None  # the error that ended the run before its time
    # what the run did wrong, each said once, in the order of its beginning
    findings: list[Finding] = field(default_factory=list)
    trips: list[Trip] = field(default_factory=list)  # what relays did
    # the relay that came nearest to a trip; None where none was beyond its limits
    nearest: Nearness | None = None
    # what kept each foreign FMU from the rest of the machine, by component
    protections: dict[str, tuple[Protection, ...]] = field(default_factory=dict)
    after: ModesResult | str | None = None  # as `modes_after` has it

    @property
    def own_shift(self) -> float | None:
        """How far the run's own step and schedule move the electromechanical mode [rad/s]; None if not known."""
        prepared = self.modes.prepared
        own = (
            one.shift
            for one in self.shifts
            if one.schedule == prepared.schedule.name
            and math.isclose(one.step_size, prepared.step_size)
        )
        return next(own, None)

    @property
    def went_unstable(self) -> list[Finding]:
        """The findings that no stable system gives, whatever its linear model says."""
        return [finding for finding in self.findings if finding.kind in UNSTABLE]

    @property
    def missing_limits(self) -> list[Finding]:
        """Limits that would have acted, and that the models lack."""
        return [finding for finding in self.findings if not finding.represented]

    @property
    def ringing(self) -> ModesResult:
        """The modes of the system that rings after the events: of what they leave, where they leave a change."""
        return self.after if isinstance(self.after, ModesResult) else self.modes

    @property
    def before_its_events(self) -> bool:
        return bool(self.modes.prepared.not_reached) and not self.modes.prepared.events

    @property
    def stable_in_simulation(self) -> bool | None:
        """None where a part was not judged or not reached, or a limit would act that the model lacks, and nothing else
        was wrong."""
        if self.went_unstable:
            return False
        if self.before_its_events:
            return None
        return (
            None
            if any(
                finding.kind == NOT_JUDGED or not finding.represented for finding in self.findings
            )
            else True
        )


def run_scenario(
    prepared: PreparedScenario,
    frequency_range: tuple[float, float] = ELECTROMECHANICAL_HZ,
    observers: Sequence[Observer] = (),
    *,
    linear: bool = False,
    recording: RecordingFolder | None = None,
    checkpoints: Checkpoints | None = None,
    federates: Federates | None = None,
    threads: int | None = 1,
    boxes: Callable[..., ModesResult] | None = None,
) -> RunResult:
    """Compute the modes of a scenario and its response to the case's events, the linear model's as well if wanted.

    A system that cannot be linearised is simulated from its initial state, with a warning instead of modes.
    A component that fails in the middle ends the run, and so do Ctrl-C and SIGTERM; what was recorded until then is in
    the result.

    ``recording``: where the rows go while the run goes on; at the end they are ``trajectory.nc`` beside it.
    ``checkpoints``: keep the run while it goes on, and go on from the newest where one was left; not with federates.
    ``boxes``: finds the modes where components hide their states."""
    made = partial(
        _run,
        frequency_range=frequency_range,
        linear=linear,
        recording=recording,
        threads=threads,
        boxes=boxes,
    )
    if federates is not None:
        with ENGINES[federates.engine](prepared, federates) as engine:
            watching = [*observers, *engine.observers()]
            return made(engine.prepared, observers=watching, checkpoints=None, engine=engine)
    try:
        return made(prepared, observers=observers, checkpoints=checkpoints)
    except NotTakenUpError as error:
        if checkpoints is None:
            raise
        checkpoints.forget(str(error))
        return made(prepared, observers=observers, checkpoints=checkpoints)


def _run(
    prepared: PreparedScenario,
    frequency_range: tuple[float, float],
    observers: Sequence[Observer],
    *,
    linear: bool,
    recording: RecordingFolder | None,
    checkpoints: Checkpoints | None,
    threads: int | None,
    boxes: Callable[..., ModesResult] | None,
    engine: Engine | None = None,
) -> RunResult:
    watch = Watch(prepared, recording)
    after = modes_after(prepared, frequency_range)
    relays = relays_in(prepared)
    guards = [relays] if prepared.relays else []
    with running(prepared, engine, threads) as master:
        protections = {
            name: found for name, c in master.components.items() if (found := protections_of(c))
        }
        modes = _modes_at_start(prepared, master, frequency_range, boxes, engine)
        shifts = _shifts(master, modes)
        follows = _response_of(master, prepared) if linear else None
        watching: list[Observer] = [*watch.observers, *guards, *observers]
        statistics, failure = _run_to_its_end(master, prepared, watching, checkpoints, engine)
        at_end = warnings_at_end(master) if failure is None and engine is None else ()
    trips = relays.trips
    if trips:
        prepared = with_trips(prepared, trips)
        modes, after = replace(modes, prepared=prepared), modes_after(prepared, frequency_range)
    dataset, failure = _recorded(watch, prepared, recording, failure)
    known, later = _exact_eigenvalues(modes), _exact_eigenvalues(after)
    findings = watch.findings(failure, master.late_starts, modes.misfits, known, later, trips=trips)
    if failure is None:
        findings = with_one_stop(modes, after, findings)
    ring_down, why_none = (None, "") if failure else ring_down_of(modes, dataset, findings, after)
    not_known = [after] if isinstance(after, str) else []
    about_run = (
        *map(str, prepared.about_rows),
        *filter(None, [why_none]),
        *not_known,
        *at_end,
        *_isolation_warnings(prepared, protections),
    )
    modes = replace(modes, warnings=(*modes.warnings, *about_run))
    return RunResult(
        modes,
        dataset,
        statistics=statistics,
        ring_down=ring_down,
        shifts=shifts,
        linear=follows,
        failure=failure,
        findings=findings,
        protections=protections,
        after=after,
        trips=trips,
        nearest=relays.nearest,
    )


def _modes_at_start(
    prepared: PreparedScenario,
    master: Master,
    frequency_range: tuple[float, float],
    boxes: Callable[..., ModesResult] | None,
    engine: Engine | None,
) -> ModesResult:
    """The modes, or why there are none: a component cannot be linearised, and nothing identifies it."""
    obstacle_of = obstacle if engine is None else _with_obstacles(engine)
    reasons = [text for c in master.components.values() if (text := obstacle_of(c))]
    if not reasons:
        return modes_of(prepared, master, frequency_range)
    if boxes is not None:
        return boxes(prepared, master, frequency_range)
    misfits, modes = misfits_of(master), unknown_modes(prepared, reasons)
    # a look is in steps, which a foreign federate cannot take back
    diverging = _diverging(master) if engine is None else []
    warnings = (
        *sentences(misfits),
        *warnings_at_start(master),
        *modes.warnings,
        *diverging,
    )
    return replace(modes, warnings=warnings, misfits=misfits)


def _run_to_its_end(
    master: Master,
    prepared: PreparedScenario,
    observers: Sequence[Observer],
    checkpoints: Checkpoints | None,
    engine: Engine | None,
) -> tuple[StepStatistics | None, CosimError | None]:
    """Return the statistics of the steps, or what ended them before their time."""
    try:
        if engine is not None:
            engine.begin(master)
        statistics = master.run(
            prepared.stop_time, prepared.events, observers, checkpoints or NOT_KEPT
        )
    except NotTakenUpError:
        raise
    except CosimError as error:
        return None, error
    except KeyboardInterrupt:
        return None, RunInterruptedError(f"{calls.how} at t = {master.time:.6g} s")
    return statistics, None


def _exact_eigenvalues(modes: ModesResult | str | None) -> Sequence[complex]:
    """Eigenvalues [rad/s] of which none rests on a fit; none where there are no others."""
    return () if not isinstance(modes, ModesResult) or modes.fit_errors else modes.eigenvalues


def _isolation_warnings(
    prepared: PreparedScenario, protections: Mapping[str, tuple[Protection, ...]]
) -> list[str]:
    """Foreign FMUs that this system cannot keep from all of the machine, and those that run in gfor's own process."""
    unprotected = [
        f"{name} runs in a process of its own, and this system lacks: {'; '.join(lacking)}"
        for name, found in protections.items()
        if (lacking := missing(found))
    ]
    inside = [
        f"component {name!r} runs in gfor's own process, because the case and "
        + Option.TRUST_FMUS
        + " say so"
        for name, plan in prepared.system.components.items()
        if plan.isolated is False and is_isolated(plan.description, None)
    ]
    return unprotected + inside


def with_trips(prepared: PreparedScenario, trips: Sequence[Trip]) -> PreparedScenario:
    """Return a scenario with the events of relays among its own: all that happened in its run."""
    events = [*prepared.events, *(event for trip in trips for event in trip.events)]
    return replace(prepared, events=tuple(sorted(events, key=lambda event: event.time)))


def _with_obstacles(engine: Engine) -> Callable[[Component], str | None]:
    """Why a component keeps a system from being linearised: by its engine, or by itself."""
    return lambda component: engine.obstacle(component) or obstacle(component)


def _response_of(master: Master, prepared: PreparedScenario) -> xr.Dataset:
    """The linear model's response to the run's events."""
    try:
        return linear_response(master, prepared)
    except NoLinearResponseError as error:
        raise InputError(f"{error}; leave " + Option.LINEAR + " out") from error


def _diverging(master: Master) -> list[str]:
    """Return what is known before the run of black boxes that the coupling does not bear; a run shows the rest."""
    boxes = [name for name, component in master.components.items() if obstacle(component)]
    try:
        return coupling_growth(master, boxes)
    except (AnalysisError, ComponentError):
        return []  # they cannot be looked at so, which is no fault of theirs


def _recorded(
    watch: Watch,
    prepared: PreparedScenario,
    recording: RecordingFolder | None,
    failure: CosimError | None,
) -> tuple[xr.Dataset, CosimError | None]:
    """Return what was recorded, and the failure, which may be that it cannot be written."""
    further = computed(prepared) | ({} if failure is None else {ENDED_EARLY: str(failure)})
    if recording is None:
        return trajectory_dataset(watch.recorder, prepared).assign_attrs(further), failure
    try:
        recording.join(recording.folder.parent / TRAJECTORY, further)
        return open_whole(recording.folder.parent / TRAJECTORY), failure
    except ResultsError as error:
        kept = trajectory_dataset(watch.recorder, prepared)  # the looks, which are in memory
        if failure is None or isinstance(failure, ResultsError):
            return kept, failure or error
        return kept, ResultsError(f"{failure}; and what was recorded is not published: {error}")


def _shifts(master: Master, modes: ModesResult) -> list[ModeShift]:
    """The electromechanical mode at several steps and both schedules, beside the continuous system's."""
    if modes.electromechanical is None or modes.system is None:
        return []
    try:
        exact = nearest_eigenvalue(modes.system, modes.electromechanical.eigenvalue)
    except AnalysisError:
        return []
    schedules = {master.schedule.name: master.schedule}
    if (
        not master.schedule.is_second_order
    ):  # else components are not told the step, as they would be under jacobi
        schedules["jacobi"] = jacobi(tuple(master.components))
    shifts = []
    for part in STEPS:
        step_size = part * master.clock.step_size
        at_step = Blocks(master, step_size)
        for name, schedule in sorted(schedules.items()):
            value = nearest_eigenvalue(compose(at_step, schedule), exact)
            shifts.append(ModeShift(name, step_size, exact, value))
    return shifts
