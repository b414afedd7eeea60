"""Which communication step is short enough: what each schedule does to the modes at each step, from its step map."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.core.errors import AnalysisError, CosimError, InputError
from orchestrator.core.late import pd
from orchestrator.core.options import Option, command
from orchestrator.linear.doubts.linearity import doubts, tell
from orchestrator.linear.models.blocks import Blocks
from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.linear.models.linearization import compose, continuous_model
from orchestrator.linear.models.steady_state import find_operating_point
from orchestrator.linear.spectra.modes import (
    damping_percent,
    damping_ratio,
    eigenvalues,
    find_spectrum,
    oscillations,
)
from orchestrator.linear.spectra.stability import WHOLE, fastest_growth
from orchestrator.output.report.notebook import page
from orchestrator.studies.modes.modes import running
from orchestrator.systems.coupling.clock import Clock
from orchestrator.systems.coupling.master import Master
from orchestrator.systems.coupling.schedule import SECOND_ORDER, Schedule, ScheduleName

# steps that are tried, in parts of the case's own
MULTIPLES = (0.5, 1.0, 2.0, 3.0, 4.0, 5.0, 10.0, 20.0, 50.0)
# schedules that are tried where none is named
TRIED: tuple[ScheduleName, ...] = ("gauss-seidel", "midpoint", "newton")
LEAST_DAMPED = 6  # so many modes are compared, least damped first
SWINGING = 0.5  # largest damping ratio of a compared mode
# growth beyond the factor times the continuous system's plus the rate is the coupling's, as in
# `orchestrator.linear.spectra.stability`
_COUPLING_FACTOR = 2.0
_COUPLING_RATE = 1.0  # [1/s]

# so many steps in turn that are not within the error end the search with a schedule
_AFTER_THE_FIRST = 2


@dataclass(frozen=True)
class Allowed:
    """Largest accepted error of a critical mode: of its frequency [Hz] and of its damping ratio [points, %]."""

    hertz: float = 1e-3
    points: float = 0.1


@dataclass(frozen=True)
class TriedStep:
    # schedule, step_size: name, and communication step [s]
    schedule: ScheduleName
    step_size: float
    # hertz, points: errors of the critical modes' frequencies [Hz] and damping ratios [points], shape (modes,), in
    # their order
    hertz: NDArray[np.float64]
    points: NDArray[np.float64]
    eigenvalues: NDArray[np.complex128]  # the critical modes in the step map [rad/s]
    growth: float = 0.0  # largest growth rate of the step map [1/s]; 0 where nothing grows
    # whether the step makes nothing grow that does not grow in the continuous system, and hides no growth
    stable: bool = False
    refused: str = ""  # why nothing could be computed; else empty
    # why the figures may be none of the run's, such as a limit at the operating point
    doubts: tuple[str, ...] = ()

    def is_within(self, allowed: Allowed) -> bool:
        """Return whether the step is stable, beyond doubt, and moves no critical mode by more than is allowed."""
        if self.refused or self.doubts or not self.stable:
            return False
        return bool(
            np.abs(self.hertz).max() <= allowed.hertz
            and np.abs(self.points).max() <= allowed.points
        )


@dataclass(frozen=True, repr=False)
class StepChoice:
    """Effect of communication steps on a scenario's critical modes."""

    prepared: PreparedScenario
    allowed: Allowed
    # the continuous system's critical modes [rad/s], least damped first
    critical: NDArray[np.complex128]
    growth: float  # largest growth rate of the continuous system [1/s]; 0 where nothing grows
    trials: tuple[TriedStep, ...]
    # steps [s] that were not tried, as an event of the case or its end does not fall on them
    left_out: tuple[float, ...] = ()

    @property
    def schedules(self) -> tuple[ScheduleName, ...]:
        return tuple(dict.fromkeys(trial.schedule for trial in self.trials))

    def of(self, schedule: ScheduleName) -> list[TriedStep]:
        """The trials of one schedule, the shortest step first."""
        return [trial for trial in self.trials if trial.schedule == schedule]

    def largest(self, schedule: ScheduleName) -> TriedStep | None:
        """The largest step up to which all are within the error; None where the shortest is not."""
        found = None
        for trial in self.of(schedule):
            if not trial.is_within(self.allowed):
                break
            found = trial
        return found

    def _repr_html_(self) -> str:
        rows = [
            {
                "schedule": trial.schedule,
                "step [s]": trial.step_size,
                "within the error": trial.is_within(self.allowed),
            }
            for trial in self.trials
        ]
        left = [f"not tried: {step:g} s, as an event does not fall on it" for step in self.left_out]
        return page(repr(self)[1:-1], left, pd.DataFrame(rows))

    def __repr__(self) -> str:
        found = []
        for name in self.schedules:
            best = self.largest(name)
            found.append(f"{name} {f'up to {best.step_size:g} s' if best else 'none'}")
        of = f"{self.prepared.name} of {self.prepared.case.name}"
        return f"<StepChoice of scenario {of}: steps within the error: {', '.join(found)}>"

    def islands(self, schedule: ScheduleName) -> list[TriedStep]:
        """Steps within the error that do not count, because a shorter one is not."""
        best = self.largest(schedule)
        shortest = 0.0 if best is None else best.step_size
        return [
            t for t in self.of(schedule) if t.step_size > shortest and t.is_within(self.allowed)
        ]


def choose_step(
    prepared: PreparedScenario,
    allowed: Allowed,
    steps: Sequence[float] = (),
    schedules: Sequence[ScheduleName] = (),
    frequency_range: tuple[float, float] = (0.1, 2.0),
) -> StepChoice:
    """Return what schedules do to a scenario's critical modes at several steps, against the continuous system."""
    lengths, left_out = _fitting(prepared, steps)
    with running(prepared.rescheduled("gauss-seidel")) as master:
        find_operating_point(master)
        system = continuous_model(master)
        if system is None:
            raise AnalysisError(
                "there is no continuous system to compare with, because a component gives no derivatives of its "
                "states: find the step by simulation, as half a step must give the same ring-down"
            )
        if len(system.names) > WHOLE:
            raise AnalysisError(
                f"{len(system.names)} states are too many for all eigenvalues (at most {WHOLE}"
                "); " + command("modes", Option.CRITICAL) + " compares a few modes"
            )
        exact = eigenvalues(system)
        critical, growth = _critical(exact, frequency_range), _growth(exact, step_map=False)
        trials: list[TriedStep] = []
        for name in dict.fromkeys(schedules or TRIED):
            trials += _tried(
                prepared,
                master,
                name=name,
                steps=lengths,
                critical=critical,
                growth=growth,
                allowed=None if steps else allowed,
            )
    return StepChoice(
        prepared, allowed, critical, growth, tuple(trials), tuple(left_out) if steps else ()
    )


def _fitting(prepared: PreparedScenario, steps: Sequence[float]) -> tuple[list[float], list[float]]:
    """Steps at whose communication points the run's events and its end can be, and the others."""
    found: list[float] = []
    left_out: list[float] = []
    why = ""
    for step in sorted(set(steps or [part * prepared.step_size for part in MULTIPLES])):
        try:
            clock = Clock(step)
            for event in prepared.events:
                clock.index(event.time, str(event))
            clock.index(prepared.stop_time, "the stop")
        except InputError as error:
            why = str(error)
            left_out.append(step)
        else:
            found.append(step)
    if not found:
        raise InputError(Option.TRY + f": none fits the case: {why}")
    return found, left_out


def _critical(
    exact: NDArray[np.complex128], frequency_range: tuple[float, float]
) -> NDArray[np.complex128]:
    low, high = (2 * np.pi * hertz for hertz in frequency_range)
    swings = exact[oscillations(exact)]
    ratio = np.array([damping_ratio(value) for value in swings.tolist()])
    kept = (swings.imag >= low) & (swings.imag <= high) & (ratio <= SWINGING)
    if not kept.any():
        raise AnalysisError(
            f"no mode from {frequency_range[0]:g} to {frequency_range[1]:g} Hz has less "
            f"than {100 * SWINGING:g} % damping; give another " + Option.RANGE
        )
    return swings[kept][np.argsort(ratio[kept])][:LEAST_DAMPED]


def _growth(values: NDArray[np.complex128], *, step_map: bool) -> float:
    fastest = fastest_growth(values, step_map=step_map)
    return 0.0 if fastest is None else fastest.real


def _tried(
    prepared: PreparedScenario,
    master: Master,
    name: ScheduleName,
    steps: Sequence[float],
    critical: NDArray[np.complex128],
    growth: float,
    allowed: Allowed | None,
) -> list[TriedStep]:
    """Trials of one schedule; up to some steps that are too long, where it is said what is allowed."""
    trials: list[TriedStep] = []
    for step in steps:
        try:
            trial = _trial(prepared, master, name, step, critical, growth)
        except CosimError as error:
            nothing = np.zeros(0)
            trial = TriedStep(
                name, step, nothing, nothing, nothing.astype(complex), refused=str(error)
            )
        trials.append(trial)
        last = trials[-_AFTER_THE_FIRST:]
        if (
            allowed
            and len(last) == _AFTER_THE_FIRST
            and not any(one.is_within(allowed) for one in last)
        ):
            break
    return trials


def _trial(
    prepared: PreparedScenario,
    master: Master,
    name: ScheduleName,
    step: float,
    critical: NDArray[np.complex128],
    growth: float,
) -> TriedStep:
    schedule = prepared.rescheduled(name).schedule
    if name == "newton" and (
        stuck := [n for n, c in master.components.items() if not c.description.can_save_state]
    ):
        raise AnalysisError(f"component {', '.join(stuck)} declares no canGetAndSetFMUstate")
    blocks = Blocks(master, step, schedule=schedule)
    model = compose(blocks, schedule)
    if name in SECOND_ORDER and master.system.wires:
        raise AnalysisError("connections that can be disturbed need gauss-seidel or jacobi")
    values = eigenvalues(model)
    seen = _partners(values, critical)
    rate = _growth(values, step_map=True)
    return TriedStep(
        name,
        step,
        hertz=(seen.imag - critical.imag) / (2 * np.pi),
        points=np.array(
            [damping_percent(a) - damping_percent(b) for a, b in zip(seen, critical, strict=True)]
        ),
        eigenvalues=seen,
        growth=rate,
        stable=keeps_stability(rate, growth, seen, critical),
        doubts=_doubts(blocks, schedule, model),
    )


def keeps_stability(
    rate: float, growth: float, seen: NDArray[np.complex128], critical: NDArray[np.complex128]
) -> bool:
    """Tell if a step makes nothing grow by itself, and leaves each critical mode on its side of the imaginary axis.

    ``rate`` and ``growth``: largest growth rates [1/s] of the step map and of the continuous system; 0 where nothing
    grows.
    ``seen`` and ``critical``: the critical modes in both [rad/s]."""
    grown = rate > (_COUPLING_FACTOR * growth + _COUPLING_RATE if growth else 0.0)
    crossed = bool(np.any((seen.real > 0) != (critical.real > 0)))
    return not grown and not crossed


def _partners(
    values: NDArray[np.complex128], wanted: NDArray[np.complex128]
) -> NDArray[np.complex128]:
    """For each wanted eigenvalue one of the given ones, no one twice, so that all are as near as they can be."""
    from scipy.optimize import linear_sum_assignment  # noqa: PLC0415 - only this study needs it

    _, columns = linear_sum_assignment(np.abs(wanted[:, None] - values[None, :]))
    partners: NDArray[np.complex128] = values[columns]
    return partners


def _doubts(blocks: Blocks, schedule: Schedule, model: LinearModel) -> tuple[str, ...]:
    """Return what the perturbation found out about limits and noise, where a component gave reason to ask."""
    if not any(component.doubtful for component in blocks.components.values()):
        return ()
    modes = [mode for mode in find_spectrum(model).modes if mode.is_oscillation]
    return tell(doubts(blocks, schedule, model, modes))


def step_choice_json(choice: StepChoice) -> dict[str, Any]:
    largest = {name: choice.largest(name) for name in choice.schedules}
    critical = [
        {"frequency_hz": z.imag / (2 * np.pi), "damping_percent": damping_percent(z)}
        for z in choice.critical
    ]
    return {
        "scenario": choice.prepared.name,
        "allowed": {"hertz": choice.allowed.hertz, "points": choice.allowed.points},
        "critical": critical,
        "continuous_growth_rate": choice.growth,
        "largest_step_s": {name: best and best.step_size for name, best in largest.items()},
        "left_out_s": list(choice.left_out),
        "trials": [_trial_json(trial, choice.allowed) for trial in choice.trials],
    }


def _trial_json(trial: TriedStep, allowed: Allowed) -> dict[str, Any]:
    return {
        "schedule": trial.schedule,
        "step_size_s": trial.step_size,
        "frequency_error_hz": trial.hertz.tolist(),
        "damping_error_points": trial.points.tolist(),
        "growth_rate": None if trial.refused else trial.growth,
        "stable": None if trial.refused else trial.stable,
        "within": trial.is_within(allowed),
        "refused": trial.refused,
        "doubts": list(trial.doubts),
    }
