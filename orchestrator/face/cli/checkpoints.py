"""The checkpoints of all scenarios of ``gfor run``."""

import argparse
from collections.abc import Sequence
from pathlib import Path
from shutil import rmtree

from rich.markup import escape

from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.core.errors import InputError
from orchestrator.core.safe_files import PARTIAL, write_text
from orchestrator.face.cli.run_request import asked_by, how_it_goes_on, keep_request
from orchestrator.face.cli.terminal import make_errors, warn
from orchestrator.output.results.checkpoint_file import CHECKPOINT, CHECKPOINTS, PREVIOUS
from orchestrator.output.results.recording_writer import TRAJECTORY, RecordingFolder
from orchestrator.output.results.staging import ScenarioFolder, remove_at_once, unfinished
from orchestrator.studies.runs.checkpoints import CASE, Checkpoints, not_kept


class StudyCheckpoints:
    def __init__(
        self, scenarios: Sequence[PreparedScenario], folder: Path, options: argparse.Namespace
    ) -> None:
        self._results, self._folder, self._every = folder, folder / CHECKPOINTS, options.checkpoint
        self._of: dict[str, Checkpoints] = {}
        self.run, self._options = str(options.run), options
        _name_those_not_kept(scenarios, options)
        if options.resume is None:
            self._begin(scenarios, options)
        if not self._every:
            return
        for prepared in scenarios:
            self._of[prepared.name] = one = Checkpoints(
                prepared, self._folder, self._every, resume=options.resume is not None, say=_say
            )
            if one.time is not None:
                done = (
                    "it was done"
                    if one.time >= prepared.stop_time
                    else f"it goes on from t = {one.time:.6g} s"
                )
                _say(f"scenario {prepared.name!r}: {done}")
            elif options.resume is not None:
                _say(f"scenario {prepared.name!r}: nothing of it was kept, so it begins at t = 0")
        if options.resume is not None and options.given_anew:
            keep_request(folder, options)

    def _begin(self, scenarios: Sequence[PreparedScenario], options: argparse.Namespace) -> None:
        """Forget an earlier run, and keep what is asked of this one."""
        if self._interrupted():
            _say(
                f"{self._results} holds an interrupted run, which is given up: it would have gone on with --resume"
            )
        rmtree(self._folder, ignore_errors=True)
        if not self._every:
            return
        write_text(self._folder / CASE, scenarios[0].case.text)
        keep_request(self._results, options)

    def _interrupted(self) -> bool:
        """Return whether an earlier run left checkpoints, or was killed before the first one and left its recording."""
        if any(path.suffix in (CHECKPOINT, PREVIOUS) for path in self._folder.glob("*")):
            return True
        run = asked_by(self._results)
        return run is not None and any(
            path.name.endswith(f"{PARTIAL}{run}") for path in unfinished(self._results)
        )

    def of(
        self, name: str, recording: RecordingFolder, place: ScenarioFolder
    ) -> Checkpoints | None:
        """Those of a scenario, which has what it recorded until then; None where none are wanted."""
        found = self._of.get(name)
        if found:
            found.take_back(
                recording, [place.path / TRAJECTORY, place.place / TRAJECTORY], self.run
            )
        return found

    def end(self, *, whole: bool, interrupted: bool = False) -> None:
        """After a study that came to its end nothing is left; else say how it goes on."""
        if whole:
            remove_at_once(self._folder, self.run)
            return
        worth_it = interrupted or any(one.exist for one in self._of.values())
        text = how_it_goes_on(self._options) if worth_it else ""
        if text:
            _say(text)


def _name_those_not_kept(
    scenarios: Sequence[PreparedScenario], options: argparse.Namespace
) -> None:
    if not (options.checkpoint or options.require_checkpoint):
        return
    for prepared in scenarios:
        plans = prepared.system.components
        found = [
            f"{n!r} ({plans[n].description.path.name}): {why}"
            for n, why in not_kept(prepared).items()
        ]
        if found and options.require_checkpoint:
            raise InputError(
                f"scenario {prepared.name!r} cannot be resumed within its run, because of component "
                f"{'; '.join(found)}; ask for an FMU that can serialise its state, or leave --require-checkpoint out"
            )
        if found:
            text = f"if it is interrupted, it starts again at t = 0, because of component {'; '.join(found)}"
            warn(prepared.name, [text])


def _say(text: str) -> None:
    make_errors().print(escape(text))
