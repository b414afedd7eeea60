"""One point of a sweep: what is asked, and what comes out.

Everything here can be sent to another process or another machine.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Self

from orchestrator.analysis.mode_tracking import ModeSet
from orchestrator.analysis.threads import alone
from orchestrator.cases.prepare import PreparedScenario
from orchestrator.cases.schema import Value
from orchestrator.errors import AnalysisError, CaseError, CosimError
from orchestrator.points.executor import WorkerLostError
from orchestrator.points.key import fingerprint, key_of, reference_to, same_case, scenario_content
from orchestrator.points.store import Arrays
from orchestrator.study.modes import ModesResult, compute_modes


@dataclass(frozen=True)
class SweepPointTask:
    """A scenario with the values of one point.

    Attributes
    ----------
    case
        Name of a built-in case, or path of a file that every worker can read.
    fingerprint
        Of the case file's text and of the code that computes; a worker with others refuses.
    overrides
        Values by ``component.variable``.
    step_size
        Communication step [s]; None for the case's.
    frequency_range
        Of the modes [Hz].
    key
        Names the point's file: a hash of all that the result depends on.
    """

    case: str
    fingerprint: str
    scenario: str
    overrides: dict[str, Value]
    step_size: float | None
    frequency_range: tuple[float, float]
    key: str


@dataclass(frozen=True)
class PointRecord:
    """The modes of a point, or why there are none.

    Attributes
    ----------
    modes
        Least damped first.
    named
        Names that the case gives to some of these modes, by index.
    error
        The message of the failure; None where all is well.
    lasting
        Whether the same would come out again: not so where a worker, the machine or an FMU was at fault.
    residual
        Of the steady state, as in `OperatingPoint`.
    linearised
        How the linear model of every component was found.
    stability
        The verdict over the whole spectrum, as `Stability.as_json` gives it; empty where the point failed.
    """

    modes: ModeSet | None = None
    named: dict[str, int] = field(default_factory=dict)
    error: str | None = None
    lasting: bool = True
    residual: float = float("nan")
    warnings: tuple[str, ...] = ()
    linearised: dict[str, str] = field(default_factory=dict)
    stability: dict[str, Any] = field(default_factory=dict)

    @property
    def is_unstable(self) -> bool:
        """Whether a mode is known to grow."""
        return self.stability.get("stable") is False

    @classmethod
    def lost(cls, _: SweepPointTask, error: WorkerLostError) -> Self:
        """That of a point whose worker died."""
        return cls(error=str(error), lasting=False)

    def stored(self) -> tuple[dict[str, Any], Arrays]:
        """Header and arrays for a `PointStore`."""
        header = {name: value for name, value in vars(self).items() if name != "modes"}
        return (header, {}) if self.modes is None else (header | {"names": self.modes.names}, self.modes.arrays())

    @classmethod
    def restored(cls, header: dict[str, Any], arrays: Arrays) -> Self | None:
        """The record that was stored in this form; None if the file has another form."""
        try:
            names = tuple(header.pop("names", ()))
            modes = ModeSet(**arrays, names=names) if arrays else None
            return cls(**header | {"warnings": tuple(header["warnings"]), "modes": modes})
        except (KeyError, TypeError, ValueError):
            return None


def make_task(
    prepared: PreparedScenario,
    fixed: Mapping[str, Value],
    varied: Mapping[str, Value],
    step_size: float | None,
    frequency_range: tuple[float, float],
) -> SweepPointTask:
    """The task of one point.

    Parameters
    ----------
    prepared
        The scenario without what is varied: its FMUs and values go into the key.
    fixed, varied
        Overrides; the varied ones go first.
    step_size
        Communication step [s]; the case's where None.
    frequency_range
        Modes of these frequencies are kept [Hz].
    """
    overrides = {**fixed, **varied}
    content = {
        "case": prepared.case.text,
        **scenario_content(prepared),
        "overrides": sorted(overrides.items()),
        "step": step_size,
        "range": list(frequency_range),
    }
    reference, mark = reference_to(prepared.case), fingerprint(prepared.case)
    return SweepPointTask(reference, mark, prepared.name, overrides, step_size, frequency_range, key_of(content))


# -- computing ---------------------------------------------------------------------------------------


def compute_point(task: SweepPointTask) -> PointRecord:
    """Prepare, find the steady state, linearise, find the modes; a failure becomes a record as well.

    Raises
    ------
    InputError
        If this worker has another case file or other code than the sweep was started with.
    """
    case = same_case(task.case, task.fingerprint)
    with alone():
        try:
            (prepared,) = case.prepare([task.scenario], task.overrides, task.step_size)
            return _record(compute_modes(prepared, task.frequency_range))
        except CaseError as error:
            return PointRecord(error="; ".join(str(problem) for problem in error.problems))
        except CosimError as error:
            return PointRecord(error=str(error), lasting=isinstance(error, AnalysisError))
        except Exception as error:  # whatever a foreign FMU or library does, the other points go on
            return PointRecord(error=f"{type(error).__name__}: {error}", lasting=False)


def _record(result: ModesResult) -> PointRecord:
    modes = result.modes
    return PointRecord(
        ModeSet.of(modes, result.model.names),
        {name: next(i for i, m in enumerate(modes) if m is mode) for name, mode in result.named.items()},
        residual=result.operating_point.residual,
        warnings=result.warnings,
        linearised=result.linearised,
        stability=result.stability.as_json(),
    )
