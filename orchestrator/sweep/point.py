"""One point of a sweep: its task and its result.

Everything here can be sent to another process or another machine.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any, Self

from orchestrator.analysis.mode_tracking import ModeSet
from orchestrator.analysis.threads import alone
from orchestrator.cases.parameter_files import ParameterFile
from orchestrator.cases.prepare import PreparedScenario
from orchestrator.cases.schema import Value
from orchestrator.points.executor import WorkerLostError
from orchestrator.points.failure import Failure
from orchestrator.points.key import fingerprint, key_of, reference_to, same_case, scenario_content
from orchestrator.points.store import Arrays
from orchestrator.study.modes import ModesResult, compute_modes


@dataclass(frozen=True)
class SweepPointTask:
    case: str  # name of a built-in case, or path of a file that every worker can read
    fingerprint: str  # Hash of the case file's text and of the code. A worker whose hash differs refuses the task.
    scenario: str
    # parameter files and values of the command line, weakest first; each is assigned as a whole, as in a scenario
    layers: tuple[ParameterFile, ...]
    overrides: dict[str, Value]  # the varied values by ``component.variable``, which override all layers
    step_size: float | None  # communication step [s]; None for the case's
    frequency_range: tuple[float, float]  # of the modes [Hz]
    key: str  # name of the point's file: a hash of everything that the result depends on
    trust_fmus: bool = False  # as `load_case`: the user's word holds in every worker


@dataclass(frozen=True)
class PointRecord:
    """The modes of a point, or the reason why it has no modes."""

    modes: ModeSet | None = None  # least damped first
    named: dict[str, int] = field(default_factory=dict)  # names that the case gives to some of these modes, by index
    failure: Failure | None = None  # why there are none; None for a point with modes
    residual: float = float("nan")  # of the steady state, as in `OperatingPoint`
    warnings: tuple[str, ...] = ()
    linearised: dict[str, str] = field(default_factory=dict)  # how the linear model of every component was found
    # stability, because: the verdict over the whole spectrum, as `Stability.as_json` gives it, and its figures in
    # words; empty where the point failed
    stability: dict[str, Any] = field(default_factory=dict)
    because: str = ""

    @property
    def error(self) -> str | None:
        """The message of the failure."""
        return None if self.failure is None else self.failure.text

    @property
    def lasting(self) -> bool:
        """Whether computing the point again would give the same result."""
        return self.failure is None or self.failure.lasting

    @property
    def is_unstable(self) -> bool:
        """Whether a mode is known to grow."""
        return self.stability.get("stable") is False

    @classmethod
    def lost(cls, _: SweepPointTask, error: WorkerLostError) -> Self:
        return cls(failure=Failure.lost(error))

    def stored(self) -> tuple[dict[str, Any], Arrays]:
        """Header and arrays for a `PointStore`."""
        header = {name: value for name, value in vars(self).items() if name != "modes"}
        header["failure"] = None if self.failure is None else asdict(self.failure)
        return (header, {}) if self.modes is None else (header | {"names": self.modes.names}, self.modes.arrays())

    @classmethod
    def restored(cls, header: dict[str, Any], arrays: Arrays) -> Self | None:
        """The record that was stored in this form; None if the file has another form."""
        try:
            names = tuple(header.pop("names", ()))
            modes = ModeSet(**arrays, names=names) if arrays else None
            failure = Failure.restored(header["failure"])
            return cls(**header | {"warnings": tuple(header["warnings"]), "failure": failure, "modes": modes})
        except (KeyError, TypeError, ValueError):
            return None


def make_task(
    prepared: PreparedScenario,
    layers: Sequence[ParameterFile],
    varied: Mapping[str, Value],
    step_size: float | None,
    frequency_range: tuple[float, float],
) -> SweepPointTask:
    """The task of one point.

    ``prepared``: the scenario without what is varied: its FMUs and values go into the key.
    ``layers``: parameter files and values of the command line that hold at every point, weakest first.
    ``varied``: values by ``component.variable``. They have priority over every layer.
    ``step_size``: communication step [s]; the case's where None.
    ``frequency_range``: modes of these frequencies are kept [Hz].
    """
    content = {
        "case": prepared.case.text,
        **scenario_content(prepared),
        "layers": [list(layer.values.items()) for layer in layers],
        "overrides": sorted(varied.items()),
        "step": step_size,
        "range": list(frequency_range),
    }
    reference, mark = reference_to(prepared.case), fingerprint(prepared.case)
    return SweepPointTask(reference, mark, prepared.name, tuple(layers), dict(varied), step_size, frequency_range,
                          key_of(content), prepared.case.trust_fmus)  # fmt: skip


# -- computing ---------------------------------------------------------------------------------------


def compute_point(task: SweepPointTask) -> PointRecord:
    """Prepare, find the steady state, linearise, find the modes; a failure becomes a record as well."""
    case = same_case(task.case, task.fingerprint, task.trust_fmus)
    with alone():
        try:
            (prepared,) = case.prepare([task.scenario], task.overrides, task.step_size, None, task.layers)
            asked = tuple(question for question in prepared.questions if question not in prepared.idle.values())
            # A sweep follows modes from point to point itself, and asks of all scenarios together.
            alone_here = replace(prepared, beside=None, questions=asked)
            return _record(compute_modes(alone_here, task.frequency_range))
        except Exception as error:  # an unexpected error of a foreign FMU or library must not end the other points
            return PointRecord(failure=Failure.of(error))


def _record(result: ModesResult) -> PointRecord:
    modes = result.modes
    return PointRecord(
        ModeSet.of(modes, result.model.names),
        {name: next(i for i, m in enumerate(modes) if m is mode) for name, mode in result.named.items()},
        residual=result.operating_point.residual,
        warnings=result.warnings,
        linearised=result.linearised,
        stability=result.stability.as_json(),
        because=result.stability.because(),
    )
