"""A study of many points, and where they are computed."""

from collections.abc import Callable, Iterable, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Concatenate, Generic, ParamSpec, TypeVar, cast

from rich.console import RenderableType

from orchestrator.cases.case import Case
from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.core.cores import number_of_cores
from orchestrator.core.errors import InputError
from orchestrator.core.options import Option
from orchestrator.studies.points.dask_cluster import DaskCluster
from orchestrator.studies.points.executor import Executor, Serial
from orchestrator.studies.points.points import CountReport, Work
from orchestrator.studies.points.processes import Processes
from orchestrator.studies.points.task import Task

Asks = ParamSpec("Asks")
Plan = TypeVar("Plan")
Result = TypeVar("Result")
Shown = TypeVar("Shown")

_WORKER_IMPORTS = "orchestrator.studies.points.worker_imports"


def choose_executor(
    workers: int | None,
    scheduler: str | None,
    imports: Sequence[str],
    tls: str | Path | None = None,
) -> Executor:
    if scheduler is not None:
        if workers not in (None, 1):
            raise InputError(
                "workers and scheduler exclude each other; a Dask cluster brings its own workers"
            )
        return DaskCluster(scheduler, None if tls is None else Path(tls))
    if tls is not None:
        raise InputError(
            Option.TLS
            + f" {tls}: certificates are for a Dask cluster; name its address with "
            + Option.SCHEDULER
        )
    if workers is not None and (
        isinstance(workers, bool) or not isinstance(workers, int) or workers < 1
    ):
        raise InputError(f"workers = {workers!r}; it must be a whole number of at least 1")
    workers = workers or number_of_cores()
    return Processes(workers, (_WORKER_IMPORTS, *imports)) if workers > 1 else Serial()


def _nothing(shown: Any) -> Iterable[str]:
    return ()


@dataclass(frozen=True, kw_only=True)
class Study(Generic[Asks, Shown]):
    """Request of a study of a case, and how a command shows what users get of it.

    The class of its request says what it is; options, keywords and documentation come from there. What users get has
    ``as_json`` and, where files are written, ``save``."""

    request: Callable[Asks, Any]
    parts: Callable[[Shown], Iterable[RenderableType]]  # for a terminal
    # exit code of a command, which is told whether instability fails it
    code: Callable[[Shown, bool], int] = lambda shown, fail_unstable: 0
    counted: str = "points"  # what is counted, in words
    warnings: Callable[[Shown], Iterable[str]] = _nothing
    remarks: Callable[[Shown], Iterable[str]] = _nothing

    @property
    def asks(self) -> type:
        return cast("type", self.request)

    @property
    def of_several(self) -> bool:
        return hasattr(self.request, "scenarios")


@dataclass(frozen=True, kw_only=True)
class StudyAtOnce(Study[Asks, Shown]):
    """A study that computes all in this process, and keeps nothing on its way."""

    compute: Callable[[Case, Any, CountReport], Shown]
    prepared: Callable[[Shown], Sequence[PreparedScenario]]  # the scenarios that were computed
    files: str = ""  # what is written into a folder, in words; nothing is where it is empty


@dataclass(frozen=True, kw_only=True)
class PointStudy(Study[Asks, Shown], Generic[Asks, Plan, Result, Shown]):
    """A study of many points, from its plan to what users get."""

    plan: Callable[[Case, Any], Plan]
    run: Callable[Concatenate[Plan, Work, ...], Result]  # computes all points of a plan
    shown: Callable[[Result], Shown]  # what users get of its result
    task: type[Task]  # whose module a worker imports
    # the scenarios of a plan
    prepared: Callable[[Any], Sequence[PreparedScenario]] = lambda plan: [plan.prepared]

    @property
    def imports(self) -> tuple[str, ...]:
        return (self.task.__module__,)

    def compute(
        self,
        planned: Plan,
        executor: Executor,
        folder: str | Path | None,
        report: CountReport,
        *more: Any,
    ) -> Shown:
        with TemporaryDirectory() as passing, closing(executor):
            return self.shown(
                self.run(planned, Work.into(Path(folder or passing), executor, report), *more)
            )
