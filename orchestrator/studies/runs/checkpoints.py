"""Checkpoints of one scenario's run: when they are written, where a run goes on, and when it cannot."""

import hashlib
import json
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from time import perf_counter
from urllib.parse import quote

import numpy as np

from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.core.errors import ComponentError, InputError, ResultsError
from orchestrator.core.options import Option
from orchestrator.core.safe_files import write_text
from orchestrator.output.results import checkpoint_file
from orchestrator.output.results.netcdf import DAMAGED, stored_name
from orchestrator.output.results.recording_writer import (
    FOLDER,
    TRAJECTORY,
    RecordingFolder,
    parts_of,
    rows_in,
)
from orchestrator.studies.runs.checkpoint_mark import differences, mark_of
from orchestrator.systems.coupling.run_state import RunState, why_not_kept


def take_back(
    recording: RecordingFolder,
    names: tuple[str, ...],
    rows: int,
    block: int,
    whole: Iterable[Path],
    run: str,
) -> bool:
    """Make a recording hold at least so many rows, from files into which they were joined if need be."""
    import h5py  # noqa: PLC0415 - a tenth of a second that only a resumed run needs

    if rows_in(parts_of(recording.folder)) >= rows:
        return True
    for path in whole:
        try:
            with h5py.File(path, "r") as file:
                if file.attrs.get("run") != run or len(file["time"]) < rows:
                    continue
                recording.begin(names)
                for first in range(0, rows, block):
                    part = slice(first, min(first + block, rows))
                    values = np.column_stack([file[stored_name(name)][part] for name in names])
                    recording.keep(first, file["time"][part], values)
                return True
        except DAMAGED:  # it is not there, or not whole
            continue
    return False


CASE = "case.toml"  # among the checkpoints: the case's text when the run began
EVERY = 60.0  # wall-clock time between two checkpoints [s]
# most of a run's time that may go into checkpoints: where one takes long, the next waits longer
_SHARE = 0.02
# A scenario that was done in less wall-clock time [s] is run again: to keep it would cost a part of
# that
_SHORT = 10.0


def not_kept(prepared: PreparedScenario) -> dict[str, str]:
    """Components whose state cannot be kept, each with the reason; under ``newton`` and with a tolerance one stands for
    all."""
    if prepared.schedule.tolerance is not None:
        first = next(iter(prepared.system.components))
        return {first: "with a tolerance nothing is kept, as the length of the next step is not"}
    if prepared.schedule.coupling == "newton":
        first = next(iter(prepared.system.components))
        return {
            first: "under the schedule newton nothing is kept, as the derivatives of its steps are not"
        }
    reasons = {
        name: why_not_kept(plan.description) for name, plan in prepared.system.components.items()
    }
    return {name: reason for name, reason in reasons.items() if reason is not None}


class Checkpoints:
    """Keeps the run of one scenario; given to `Master.run` as its keeper.

    ``every``: wall-clock time between two of them [s].
    ``resume``: go on from the newest that is there, instead of beginning anew.
    ``say``: told, in one line each, what a user should know."""

    def __init__(
        self,
        prepared: PreparedScenario,
        folder: Path,
        every: float,
        *,
        resume: bool,
        say: Callable[[str], None],
    ) -> None:
        self._name, self._say, self._every = prepared.name, say, every
        self._mark, self._step_size, self._recorded = (
            mark_of(prepared),
            prepared.step_size,
            prepared.record,
        )
        self._path = folder / f"{quote(prepared.name, safe='')}{checkpoint_file.CHECKPOINT}"
        self._case, self._text, self._file = folder / CASE, prepared.case.text, prepared.case.path
        self._written = False
        self._kept: RunState | None = None
        self._unable = bool(not_kept(prepared))
        try:
            folder.mkdir(parents=True, exist_ok=True)
            if resume:
                self._kept = self._read_latest()
            else:
                self.clear()
        except OSError as error:
            raise InputError(
                f"{folder}: checkpoints cannot be kept there: {error.strerror}; choose "
                "another folder, or leave them out with " + Option.CHECKPOINT + " 0"
            ) from error
        self._begun = perf_counter()
        self._due = self._begun + every

    @property
    def time(self) -> float | None:
        """Where the run goes on [s]; None where it begins."""
        return None if self._kept is None else self._kept.index * self._step_size

    @property
    def exist(self) -> bool:
        # perhaps written by a copy of this process
        return self._path.exists() or self._kept is not None

    def recording(self, prepared: PreparedScenario) -> RecordingFolder:
        """A recording beside the checkpoints, which has what was recorded until the newest."""
        folder = self._path.with_suffix(".rows")
        run = hashlib.sha256(json.dumps(self._mark).encode()).hexdigest()[:12]
        found = RecordingFolder(folder / FOLDER, prepared, {"run": run})
        self.take_back(found, [folder / TRAJECTORY], run)
        return found

    def take_back(self, recording: RecordingFolder, whole: Sequence[Path], run: str) -> None:
        """Have a recording hold the rows that the run has recorded where it goes on; without them, begin anew."""
        positions = () if self._kept is None else self._kept.observers
        position = next((p for p in positions if "block" in p and "times" not in p), None)
        if position is None:
            return
        rows, block = int(position["rows"]), int(position["block"])
        if not take_back(recording, self._recorded, rows, block, whole, run):
            self.forget(
                "what it has recorded until the checkpoint is not there any more, or is damaged"
            )

    def forget(self, reason: str) -> None:
        self._say(f"scenario {self._name!r} is computed from its start again: {reason}")
        self._kept = None

    def clear(self) -> None:
        for path in (self._path, checkpoint_file.previous(self._path)):
            path.unlink(missing_ok=True)
        if not any(path.suffix == self._path.suffix for path in self._path.parent.glob("*")):
            self._case.unlink(missing_ok=True)

    def latest(self) -> RunState | None:
        return self._kept

    def is_due(self) -> bool:
        return perf_counter() >= self._due

    def keep(self, state: Callable[[], RunState]) -> None:
        """See `Keeper.keep`; a checkpoint that cannot be written is said once and ends no run."""
        if not self._unable:
            self._write(state)

    def finish(self, state: Callable[[], RunState]) -> None:
        """See `Keeper.finish`; it makes a finished scenario of an unfinished study one that is not run again."""
        if perf_counter() - self._begun >= min(self._every, _SHORT):
            self._write(state)

    def _write(self, state: Callable[[], RunState]) -> None:
        begun = perf_counter()
        try:
            arrays = state().arrays()
        except ComponentError as error:
            self._give_up(str(error))  # an isolated FMU that died says so itself, at its next step
            return
        try:
            if not (self._written or self._case.exists()):
                write_text(self._case, self._text)
            checkpoint_file.write_checkpoint(self._path, {"mark": self._mark}, arrays)
            self._written = True
        except ResultsError as error:
            self._give_up(str(error))
        now = perf_counter()
        self._due = now + max(self._every, (now - begun) / _SHARE)

    def _give_up(self, reason: str) -> None:
        self._unable = True
        self._say(f"scenario {self._name!r}: no checkpoints are written any more: {reason}")

    def _read_latest(self) -> RunState | None:
        damaged = []
        for path in (self._path, checkpoint_file.previous(self._path)):
            try:
                header, arrays = checkpoint_file.read_checkpoint(path)
                state = RunState.of_arrays(arrays)
            except FileNotFoundError:
                continue
            except (
                checkpoint_file.DamagedCheckpointError,
                KeyError,
                ValueError,
                TypeError,
                OverflowError,
            ) as error:
                damaged.append(str(error))
                continue
            self._compare(header.get("mark", {}))
            if damaged:
                time = state.index * self._step_size
                self._say(f"{damaged[0]}; the one before it is taken, of t = {time:.6g} s")
            return state
        if damaged:
            raise InputError(
                f"scenario {self._name!r} cannot be resumed: {'; '.join(damaged)}; start it "
                "anew, without " + Option.RESUME
            )
        return None

    def _compare(self, then: dict[str, str]) -> None:
        try:
            was: str | None = self._case.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError):
            was = None
        said = differences(then, self._mark, None if was is None else (was, self._text), self._file)
        if said:
            raise InputError(
                f"scenario {self._name!r} cannot be resumed: {said}; bring that back to what "
                "it was, or start the run anew, without " + Option.RESUME
            )
