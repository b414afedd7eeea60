"""Request of a run."""

from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass
from pathlib import Path
from typing import Any

from orchestrator.cases.form.given import Time, in_seconds
from orchestrator.core.asked import FLAG, FieldKind, read_whole, request_field, whole_number
from orchestrator.core.cores import MOST_THREADS
from orchestrator.core.errors import InputError
from orchestrator.output.results.recording_writer import RecordingFolder
from orchestrator.simulation.federates import Federates
from orchestrator.studies.points.request import ANYTHING
from orchestrator.studies.runs.checkpoints import EVERY, Checkpoints
from orchestrator.systems.coupling.observers import Observer


def _observers(given: Any, argument: str) -> Sequence[Observer]:
    parts = ("every", "begin", "observe", "end")
    if not isinstance(given, Sequence) or not all(
        hasattr(one, part) for one in given for part in parts
    ):
        raise InputError(f"{argument} = {given!r}; give a list of observers, or leave it out")
    return given


def _of_kind(kind: type, rule: str) -> FieldKind:
    def check(given: Any, argument: str) -> Any:
        if given is not None and not isinstance(given, kind):
            raise InputError(f"{argument} = {given!r}; {rule}, or leave it out")
        return given

    return FieldKind("", str, check)


_TIME, _OBSERVERS = FieldKind("T", str, in_seconds), FieldKind("", str, _observers)
_RECORDING = _of_kind(
    RecordingFolder, "give a RecordingFolder; `checkpoints` takes a folder's path"
)
_FEDERATES = _of_kind(
    Federates, 'give Federates(("gfor",)) of orchestrator.simulation.federation.choice'
)
_THREADS = FieldKind(
    "N",
    read_whole(1, MOST_THREADS),
    lambda given, argument: (
        None if given is None else whole_number(given, argument, 1, MOST_THREADS)
    ),
)


@dataclass(frozen=True)
class RunRequest:
    """Modes, and the response to the scenario's events.

    A component that fails in the middle ends the run, and so does Ctrl-C: a `RunEndedWarning` says it, and what was
    recorded until then is in the result.

    With a folder for checkpoints, the same call goes on where an interrupted or killed one was left, and gives the
    same values as an undisturbed one. What should be known of that is a `CheckpointWarning`.

    Raises
    ------
    InputError
        If ``threads`` is no such number, both checkpoints and federates are asked for, if what was left in the folder
        is damaged, or if the run is made of something else now: another case, FMU or library.

    Examples
    --------
    >>> import orchestrator as gfor
    >>> run = gfor.load("infinite_bus").scenario("dip").run(stop=1.2)
    >>> print(f"the voltage falls to {run.dataset['grid.v'].min().item():.2f} pu")
    the voltage falls to 0.92 pu
    """

    stop: Time | None = request_field(
        _TIME, None, "time at which the run ends [s]; the case's by default", option=None
    )
    _: KW_ONLY
    linear: bool = request_field(
        FLAG, False, "lay the linear model's response over the simulated one"
    )
    progress: bool = request_field(FLAG, False, "show a bar", option=None)
    observers: Sequence[Observer] = request_field(
        _OBSERVERS, (), "what else looks on at every communication step", option=None
    )
    recording: RecordingFolder | None = request_field(
        _RECORDING,
        None,
        "a folder on the disk that takes the rows while the run goes on; by default they stay in "
        "memory, and those of a run that would need more than 256 MB go to a temporary folder, which is removed when "
        "Python ends",
        option=None,
    )
    checkpoints: str | Path | Checkpoints | None = request_field(
        ANYTHING,
        None,
        "folder in which the run is kept while it goes on; by default none. It is empty again at the "
        "end, but for the recording of a run that would need more than 256 MB",
        option=None,
    )
    checkpoint_every: Time = request_field(
        _TIME, EVERY, "wall-clock time between two checkpoints [s]", option=None
    )
    federates: Federates | None = request_field(
        _FEDERATES,
        None,
        'components that run as federates at HELICS, such as ``Federates(("gfor",))`` of '
        "`orchestrator.simulation.federation.choice`; by default everything runs here",
        option=None,
    )
    threads: int | None = request_field(
        _THREADS,
        None,
        "threads that step native FMUs (default: as many as are faster than one, up to one for each "
        "core); no value depends on it",
        python="how many step native FMUs, from 1 to 64. By default as many as make "
        "a step shortest, up to one for each core, and only while they are seen to be faster than one. No value "
        "depends on it",
    )
    black_box: bool = request_field(
        FLAG,
        False,
        "identify the components that hide their states, for the modes before the events; else there are "
        "none",
        option=None,
    )
