"""One row of a code, run on the test bench. It can run in another process."""

from dataclasses import dataclass, field
from typing import Any, Self

import numpy as np

from orchestrator.analysis.threads import alone
from orchestrator.arrays import Numbers
from orchestrator.certification.codes.bench_case import BENCH
from orchestrator.errors import ComponentError, CosimError
from orchestrator.points.executor import WorkerLostError
from orchestrator.points.key import same_case
from orchestrator.points.store import Arrays
from orchestrator.study.modes import running
from orchestrator.watch.watch import Watch

_SIGNAL = "signal "
"""Beginning of the names of signals among a stored row's arrays."""


@dataclass(frozen=True)
class BenchTask:
    """A row's case file.

    Attributes
    ----------
    row
        Name of the row.
    case, fingerprint
        Path of the case file, and its fingerprint.
    key
        Name of the result's file: a hash of everything that the result depends on.
    """

    row: str
    case: str
    fingerprint: str
    key: str


@dataclass
class BenchResult:
    """The response of a row.

    Attributes
    ----------
    signals
        By the bench's names, each of the shape of ``times``.
    findings
        Of the watch, in the form of `Finding.as_json`.
    failure
        Why there is no whole response.
    """

    row: str
    times: Numbers = field(default_factory=lambda: np.empty(0))
    signals: dict[str, Numbers] = field(default_factory=dict)
    findings: list[dict[str, Any]] = field(default_factory=list)
    failure: str | None = None

    @property
    def lasting(self) -> bool:
        """Failed rows are not kept: the cause, such as a missing licence, may be gone next time."""
        return self.failure is None

    @classmethod
    def lost(cls, task: BenchTask, error: WorkerLostError) -> Self:
        """The result of a row whose worker died."""
        return cls(task.row, failure=str(error))

    def stored(self) -> tuple[dict[str, Any], Arrays]:
        """Header and arrays for a `PointStore`."""
        header = {"row": self.row, "findings": self.findings}
        return header, {"times": self.times, **{_SIGNAL + name: values for name, values in self.signals.items()}}

    @classmethod
    def restored(cls, header: dict[str, Any], arrays: Arrays) -> Self | None:
        """The result that was stored in this form; None if the file has another form."""
        try:
            signals = {name.removeprefix(_SIGNAL): a for name, a in arrays.items() if name.startswith(_SIGNAL)}
            return cls(header["row"], arrays["times"], signals, header["findings"])
        except KeyError:
            return None


def compute_row(task: BenchTask) -> BenchResult:
    """Run a row; a failure becomes part of the result.

    Raises
    ------
    InputError
        As `same_case`.
    """
    case = same_case(task.case, task.fingerprint)
    result = BenchResult(task.row)
    try:
        with alone():
            (prepared,) = case.prepare()
            watch = Watch(prepared)
            ended: CosimError | None = None
            with running(prepared) as master:
                try:
                    master.run(prepared.stop_time, prepared.events, watch.observers)
                except ComponentError as error:
                    if error.status.startswith("hang"):
                        raise  # a machine that is too busy looks the same: no verdict, and nothing is kept
                    ended = error  # the converter gave up, or its values were no numbers: the row is not met
            _keep(result, watch)
            result.findings = [finding.as_json() for finding in watch.findings(ended)]
    except CosimError as error:
        result.failure = str(error)
    except Exception as error:  # an unexpected error of a foreign FMU or library must not end the other rows
        result.failure = f"{type(error).__name__}: {error}"
    return result


def _keep(result: BenchResult, watch: Watch) -> None:
    recorder = watch.recorder
    result.times = recorder.times.copy()
    named = zip(recorder.names, recorder.values.T.copy(), strict=True)
    result.signals = {name.removeprefix(f"{BENCH}."): values for name, values in named}
