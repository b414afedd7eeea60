"""One point of a study: its task, which can be sent to another process or machine, and the record that is kept of it.

A study has, in a module of its own, a subclass of `Task` with the fields in which its points differ, and a dataclass
with `Kept` for what comes out. The key of a task is made of all its fields, and of the code of that module."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any, ClassVar, Self, TypeVar

from orchestrator.cases.case import Case
from orchestrator.cases.form.parameter_files import ParameterFile
from orchestrator.cases.form.schema import Value
from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.core.spelling import as_options
from orchestrator.core.threads import alone
from orchestrator.studies.points.codec import packed, plain, unpacked
from orchestrator.studies.points.failure import Failure
from orchestrator.studies.points.key import (
    digest,
    fingerprint,
    key_of,
    reference_to,
    same_case,
    scenario_content,
)
from orchestrator.studies.points.store import Arrays


@dataclass(frozen=True)
class StudyCase:
    """The case that all points of a study have in common: a scenario with its layers, found again by any worker."""

    reference: str  # name of a built-in case, or path of a file that every worker can read
    # of the texts and of the code; a worker whose fingerprint differs refuses the task
    fingerprint: str
    scenario: str
    # parameter files and values of the command line, weakest first
    layers: tuple[ParameterFile, ...]
    step_size: float | None  # communication step [s]; None for the case's
    trust_fmus: bool  # as `load_case`: the user's word holds in every worker
    mark: str  # hash of all of it, and of the FMUs
    varied: frozenset[str] = frozenset()  # as in `CaseDefinition`
    line_ends: frozenset[str] = frozenset()  # as in `CaseDefinition`

    @classmethod
    def of(
        cls,
        prepared: PreparedScenario,
        layers: Sequence[ParameterFile] = (),
        step_size: float | None = None,
        text: str | None = None,
        varied: Iterable[str] = (),
        **besides: Any,
    ) -> Self:
        """The case of a scenario as it is without what differs between the points.

        ``text``: what stands for the case's own in keys. ``varied``: as in `CaseDefinition`.
        ``besides``: what the results depend on as well [JSON's types]."""
        case = prepared.case
        content = {
            "case": case.text if text is None else text,
            **scenario_content(prepared),
            "layers": [list(layer.values.items()) for layer in layers],
            "step": step_size,
            **besides,
        }
        return cls(
            reference=reference_to(case),
            fingerprint=fingerprint(case),
            scenario=prepared.name,
            layers=tuple(layers),
            step_size=step_size,
            trust_fmus=case.trust_fmus,
            mark=digest(content),
            varied=frozenset(varied),
            line_ends=case.line_ends,
        )

    def prepare(self, case: Case, values: Mapping[str, Value]) -> PreparedScenario:
        """The scenario with further values by ``component.variable``, which go before all layers."""
        (prepared,) = case.prepare([self.scenario], dict(values), self.step_size, None, self.layers)
        return prepared


class Kept:
    """The outcome of a point; mixed into a dataclass, which `PointStore` keeps."""

    failure: Failure | None
    keeps_failures = True  # False where the cause, such as a missing licence, may be gone next time

    @property
    def error(self) -> str | None:
        return None if self.failure is None else self.failure.text

    @property
    def lasting(self) -> bool:
        """Return whether computing the point again would give the same. Only such records are kept."""
        return self.failure is None or (self.keeps_failures and self.failure.lasting)

    def stored(self) -> tuple[dict[str, Any], Arrays]:
        return packed(self)

    @classmethod
    def restored(cls, header: dict[str, Any], arrays: Arrays) -> Self | None:
        """The record that was stored in this form; None if the file has another form."""
        try:
            found: Self = unpacked(cls, header, arrays)
        except (KeyError, TypeError, ValueError, IndexError):
            return None
        return found


@dataclass(frozen=True)
class Task:
    study: StudyCase
    record: ClassVar[Any]  # the class of what comes out, a dataclass with `Kept`

    @property
    def scenario(self) -> str:
        return self.study.scenario

    @cached_property
    def key(self) -> str:
        """Name of the point's file: a hash of everything that the result depends on."""
        return key_of({"study": self.study.mark, "point": self.content()}, *self.modules())

    def modules(self) -> tuple[str, ...]:
        """Modules whose code computes the point: with all that they import, they count in its key."""
        return (type(self).__module__,)

    def content(self) -> Any:
        """The fields in which points differ; fields that are not compared only follow from the others."""
        own = [one.name for one in fields(self) if one.compare and one.name != "study"]
        return plain({name: getattr(self, name) for name in own})

    def failed(self, failure: Failure) -> Any:
        return self.record(failure=failure)


AnyTask = TypeVar("AnyTask", bound=Task)
Out = TypeVar("Out")


def computed(task: AnyTask, compute: Callable[[AnyTask, Case], Out]) -> Out:
    """Compute a point where it is: with the study's case, on one thread of BLAS; a failure becomes a record as well.

    Its texts name options as they are typed, in every worker process: a kept point is the same for everybody."""
    study = task.study
    case = same_case(
        study.reference, study.fingerprint, study.trust_fmus, study.varied, study.line_ends
    )
    with alone(), as_options():
        try:
            return compute(task, case)
        except (
            Exception
        ) as error:  # an unexpected error of a foreign FMU or library must not end the other points
            failed: Out = task.failed(Failure.of(error))
            return failed
