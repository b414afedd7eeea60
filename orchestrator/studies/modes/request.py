"""Requests of scenarios: how they are prepared, their modes, their communication step."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass
from math import inf
from typing import Any

from orchestrator.cases.flow.sharing import SharingRule
from orchestrator.cases.form.given import Time, in_seconds
from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.core.asked import (
    CALLED,
    DAMPING,
    FLAG,
    FREQUENCIES,
    NAMES,
    FieldKind,
    Names,
    names,
    one_of,
    plain_value,
    request_field,
)
from orchestrator.core.errors import InputError
from orchestrator.core.options import Option
from orchestrator.linear.spectra.modes import ELECTROMECHANICAL_HZ
from orchestrator.studies.modes.step_choice import TRIED
from orchestrator.studies.points.request import (
    ANYTHING,
    OfCase,
    of_black_box,
    of_protection,
    of_scenarios,
    of_values,
)
from orchestrator.systems.coupling.schedule import SCHEDULES, SECOND_ORDER, ScheduleName

_SHARING, _SCHEDULE, _STOP = one_of(SharingRule), one_of(SCHEDULES), FieldKind("T", str, in_seconds)


@dataclass(frozen=True, kw_only=True)
class Preparing(OfCase):
    schedule: ScheduleName | None = request_field(
        _SCHEDULE,
        None,
        "``gauss-seidel``, ``jacobi``, ``midpoint`` or ``newton``; the case's by default",
        option=None,
    )
    tolerance: float | None = request_field(
        ANYTHING,
        None,
        "steps of a run are as long as this error of a coupled output allows, of 1 or of its value, "
        "from 1e-8 to 0.1; under ``newton`` unless the schedule is ``midpoint``; by default steps are fixed, or the "
        "case's",
        option=None,
    )
    sharing: str | None = request_field(
        _SHARING,
        None,
        "how the other units replace the power of a unit that ``values`` take out of service, such as by "
        '``sg5.connected``: by ``"droop"``, by ``"rating"``, or the ``"slack"`` alone; as the case says by default, '
        "which is by droop; if ``values`` give powers (``P_0``) as well, nothing is shared",
        option=None,
    )

    def scheduled(self, prepared: PreparedScenario) -> PreparedScenario:
        """A scenario with another schedule and steps within a tolerance, where they are given."""
        if (
            self.tolerance is not None
            and self.schedule is not None
            and self.schedule not in SECOND_ORDER
        ):
            raise InputError(
                f"schedule {self.schedule!r} with tolerance = {self.tolerance!r}: a tolerance goes with midpoint or "
                "newton; choose one of them, or leave the schedule out, which takes newton"
            )
        prepared = prepared.rescheduled(self.schedule) if self.schedule else prepared
        return prepared if self.tolerance is None else prepared.with_tolerance(self.tolerance)


@dataclass(frozen=True)
class ScenarioRequest(Preparing):
    """One scenario, checked and ready to run; FMUs that are missing are built.

    Data that are most unusual give an `UnusualDataWarning`.

    Raises
    ------
    CaseError
        With every problem of the case and of the values.

    Examples
    --------
    >>> import orchestrator as gfor
    >>> case = gfor.load("two_area")
    >>> case.scenario("pod_p", {"grid.X_L": 0.3}).values["grid.X_L"]
    0.3
    """

    name: str | None = request_field(
        ANYTHING, None, "of the scenario; may be left out where the case has one only", option=None
    )
    values: Mapping[str, Any] | None = of_values()
    _: KW_ONLY
    force: Names = request_field(
        NAMES,
        (),
        'references that swing, in the place of the case\'s events: ``"sg1 0.8 Hz 2 %"``, as ``gfor run '
        "--force``",
        option=None,
    )
    fault: Names = request_field(
        NAMES,
        (),
        'short circuits in the place of the case\'s events: ``"bus_9, 150 ms"``',
        option=None,
    )
    protection: str | None = of_protection(option=None)


@dataclass(frozen=True)
class ScenariosRequest(Preparing):
    """Several scenarios, or all; the mistakes of all are reported together.

    Raises
    ------
    CaseError
        With every problem of the case and of the values.

    Examples
    --------
    >>> import orchestrator as gfor
    >>> [scenario.title for scenario in gfor.load("two_area").choose(["gfor", "pod_p"])]
    ['SG + GFOR', 'SG + GFOR POD-P']
    """

    names: Names = of_scenarios()
    values: Mapping[str, Any] | None = of_values()
    _: KW_ONLY
    stop: Time | None = request_field(
        _STOP, None, "time at which runs end [s]; the case's by default", option=None
    )


@dataclass(frozen=True)
class ModesRequest:
    """Steady state and modes.

    Raises
    ------
    AnalysisError
        If no steady state is found, or the system cannot be linearised.

    Examples
    --------
    >>> import orchestrator as gfor
    >>> modes = gfor.load("two_area").scenario("pod_p").modes()
    >>> modes.table()[["frequency_hz", "damping_percent", "name"]].round(2).head(2)
          frequency_hz  damping_percent               name
    mode
    1             0.76            22.55  electromechanical
    2             0.34            32.70
    """

    frequencies: tuple[float, float] = request_field(
        FREQUENCIES,
        ELECTROMECHANICAL_HZ,
        "frequencies shown [Hz] (default: 0.1:2)",
        option="--range",
    )
    critical: float | None = request_field(
        DAMPING,
        None,
        "only modes with less damping than this (20 by default), by sparse search instead of the full "
        "spectrum",
        option=None,
        python="damping below which modes are looked for, by sparse search; by default the "
        "whole spectrum is computed",
    )
    _: KW_ONLY
    directional: bool = request_field(
        FLAG,
        False,
        "linearise with the FMUs' own directional derivatives instead of by perturbation (with --native)",
    )
    black_box: bool = of_black_box()
    report: Callable[[str], None] | None = request_field(
        CALLED,
        None,
        "called with a sentence before each run of an identification, which may take minutes; such as "
        "``print``",
        option=None,
    )

    def check(self) -> None:
        if self.critical is not None and not self.frequencies[0] > 0:
            raise InputError(
                Option.CRITICAL + " needs " + Option.RANGE + " to begin above 0 Hz, such as 0.1:2"
            )
        if self.black_box and self.directional:
            raise InputError(
                Option.BLACK_BOX
                + " identifies, "
                + Option.DIRECTIONAL
                + " asks the FMUs for derivatives; give one of them"
            )


def _read_errors(text: str) -> tuple[float, float]:
    try:
        hertz, points = map(float, text.split(":"))
    except ValueError:
        raise ValueError(f"{text!r} is not of the form HZ:POINTS, such as 0.001:0.1") from None
    if not (0 < hertz < inf and 0 < points < inf):
        raise ValueError(f"{text!r}: both errors must be above 0 and finite")
    return hertz, points


def _errors(given: Any, argument: str) -> tuple[float, float]:
    errors = [plain_value(error) for error in given] if isinstance(given, Sequence) else []
    if len(errors) != 2 or not all(isinstance(x, int | float) and 0 < x < inf for x in errors):
        raise InputError(
            f"{argument} = {given!r}; give two errors above 0 [Hz, points], such as (0.001, 0.1)"
        )
    return float(errors[0]), float(errors[1])


def _lengths(given: Any, argument: str) -> list[float]:
    listed = [given] if isinstance(given, int | float | str) else given
    return [length for step in listed if (length := in_seconds(step, argument)) is not None]


def _read_schedule(text: str) -> str:
    if text not in SCHEDULES:
        raise ValueError(f"{text!r} is none; choose from {', '.join(SCHEDULES)}")
    return text


def _schedules(given: Any, argument: str) -> tuple[str, ...]:
    chosen = names(given, argument)
    wrong = [name for name in chosen if name not in SCHEDULES]
    if wrong:
        raise InputError(f"{argument}: {wrong[0]!r} is none; give some of {', '.join(SCHEDULES)}")
    return chosen


_ERRORS = FieldKind("HZ:POINTS", _read_errors, _errors)
_STEPS = FieldKind(
    "H,H,...", lambda text: _lengths([part.strip() for part in text.split(",")], "--try"), _lengths
)
_SCHEDULES = FieldKind(f"{{{','.join(SCHEDULES)}}}", _read_schedule, _schedules, several=True)


@dataclass(frozen=True)
class StepsRequest:
    """Effect of communication steps and schedules on the critical modes, as ``gfor steps`` says it.

    Returns
    -------
    StepChoice
        All trials; its ``largest(schedule)`` is the largest step within the error.

    Raises
    ------
    InputError
        If an error is not above 0, a schedule does not exist, or no step fits the case's events.
    AnalysisError
        If there is no continuous system to compare with, or no mode in range.

    Examples
    --------
    >>> import orchestrator as gfor
    >>> choice = gfor.load("two_area").scenario("pod_pq").steps(steps=["100 us", "500 us"], schedules=["midpoint"])
    >>> choice.largest("midpoint").step_size
    0.0005
    """

    allowed: tuple[float, float] = request_field(
        _ERRORS,
        (1e-3, 0.1),
        "accepted error of a critical mode's frequency [Hz] and damping [points] (default: "
        "0.001:0.1)",
        option="--error",
    )
    steps: Sequence[Time] = request_field(
        _STEPS,
        (),
        "communication steps to try, such as '100 us,500 us' (default: 0.5 to 50 times the case's own)",
        option="--try",
    )
    schedules: Names = request_field(
        _SCHEDULES,
        (),
        f"schedule to try (repeatable; default: {', '.join(TRIED)})",
        option="--schedule",
    )
    frequencies: tuple[float, float] = request_field(
        FREQUENCIES,
        ELECTROMECHANICAL_HZ,
        "frequencies of the critical modes [Hz] (default: 0.1:2)",
        option="--range",
    )
