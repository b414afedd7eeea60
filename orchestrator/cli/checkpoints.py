"""``gfor run --checkpoint`` and ``--resume``: what was asked is kept beside the checkpoints, and asked again."""

import argparse
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from shutil import rmtree
from typing import Any

from rich.markup import escape

from orchestrator.cases.case import built_in_cases
from orchestrator.cases.prepare import PreparedScenario
from orchestrator.cli.arguments import seconds_or_none
from orchestrator.cli.terminal import make_errors, warn
from orchestrator.errors import InputError
from orchestrator.results.checkpoint_file import CHECKPOINTS
from orchestrator.results.recording import TRAJECTORY, RecordingFolder
from orchestrator.results.staging import ScenarioFolder, new_run_id, remove_at_once, unfinished
from orchestrator.safe_files import PARTIAL, write_text
from orchestrator.study.checkpoints import CASE, EVERY, Checkpoints, not_kept

_REQUEST = "request.json"
_OF_THE_RUN: Mapping[str, Any] = {
    "case": None, "scenario": [], "set": [], "parameters": [], "step": None, "stop": None, "linear": False, "csv": True,
    "require_checkpoint": False,
}  # fmt: skip
"""Options that say what is computed, as they are where nothing is said; a resumed run keeps those that it had."""

_NOT_WITH_RESUME: Mapping[str, Any] = {**_OF_THE_RUN, "out": None, "like": None, "order": None}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Both options, and what goes with them."""
    parser.add_argument(
        "--checkpoint",
        type=seconds_or_none,
        metavar="SECONDS",
        help=f"wall-clock time between two checkpoints (default: {EVERY:g}); 0 writes none",
    )
    parser.add_argument(
        "--require-checkpoint",
        action="store_true",
        help="refuse a run that could not be resumed, because an FMU cannot serialise its state",
    )
    parser.add_argument(
        "--resume",
        type=Path,
        metavar="DIR",
        help="go on with the interrupted run whose results are in DIR; case and options are those that it had",
    )


def with_request(options: argparse.Namespace) -> argparse.Namespace:
    """The options of a new run, or those of the run that is to be resumed.

    Raises
    ------
    InputError
        If there is no case, nothing to resume, or something is asked of a resumed run that it did not have.
    """
    if options.resume is None:
        if options.case is None:
            raise InputError("the case is missing: gfor run CASE, such as gfor run two_area")
        return options
    _refuse_other_options(options)
    file = options.resume / CHECKPOINTS / _REQUEST
    try:
        asked = json.loads(file.read_text(encoding="utf-8"))
        kept = {name: asked[name] for name in (*_OF_THE_RUN, "run")}
    except FileNotFoundError as error:
        raise InputError(
            f"--resume {options.resume}: there is no interrupted run in it; one that came to its end, or was started "
            "with --checkpoint 0, leaves nothing to resume"
        ) from error
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(
            f"--resume {options.resume}: {file} cannot be read ({error}); start the run anew, without --resume"
        ) from error
    kept["set"] = [(name, value) for name, value in kept["set"]]
    kept["parameters"] = [Path(path) for path in kept["parameters"]]
    return argparse.Namespace(**{**vars(options), **kept, "out": options.resume})


def interval(options: argparse.Namespace) -> float:
    """Wall-clock time between two checkpoints [s]; 0 where none are written, as in a run with federates."""
    if options.engine != "local":
        return 0.0  # the state of a federate stays with it
    return EVERY if options.checkpoint is None else float(options.checkpoint)


def _refuse_other_options(options: argparse.Namespace) -> None:
    asked = [name for name, unsaid in _NOT_WITH_RESUME.items() if getattr(options, name) != unsaid]
    asked += ["checkpoint 0"] if options.checkpoint == 0 else []
    if asked:
        special = {"case": "CASE", "csv": "--no-csv"}
        words = ", ".join(special.get(name, f"--{name.replace('_', '-')}") for name in asked)
        raise InputError(
            f"--resume {options.resume} goes on with the run as it was asked for, so {words} cannot go with it; leave "
            "that away, or start a run anew, without --resume"
        )


class StudyCheckpoints:
    """The checkpoints of all scenarios of a command.

    Parameters
    ----------
    scenarios
        All of them.
    folder
        Of the results.
    options
        As `with_request` gave them.

    Raises
    ------
    InputError
        If the run to be resumed is made of something else now, or an FMU cannot be kept where that is required.

    Attributes
    ----------
    run
        Id of the run, which a resumed one keeps.
    """

    def __init__(self, scenarios: Sequence[PreparedScenario], folder: Path, options: argparse.Namespace) -> None:
        self._results, self._folder, self._every = folder, folder / CHECKPOINTS, options.checkpoint
        self._of: dict[str, Checkpoints] = {}
        self.run = str(options.run) if options.resume else new_run_id()
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
                done = "it was done" if one.time >= prepared.stop_time else f"it goes on from t = {one.time:.6g} s"
                _say(f"scenario {prepared.name!r}: {done}")

    def _begin(self, scenarios: Sequence[PreparedScenario], options: argparse.Namespace) -> None:
        """Forget an earlier run, and keep what is asked of this one.

        Parameters
        ----------
        scenarios
            All of them.
        options
            Of the command.
        """
        if self._interrupted():
            _say(f"{self._results} holds an interrupted run, which is given up: it would have gone on with --resume")
        rmtree(self._folder, ignore_errors=True)
        if not self._every:
            return
        content = {name: getattr(options, name) for name in _OF_THE_RUN}
        content["run"] = self.run
        content["case"] = options.case if options.case in built_in_cases() else str(Path(options.case).resolve())
        content["parameters"] = [str(path.resolve()) for path in options.parameters]
        write_text(self._folder / CASE, scenarios[0].case.text)
        write_text(self._folder / _REQUEST, json.dumps(content, indent=1))

    def _interrupted(self) -> bool:
        """Whether an earlier run left checkpoints, or was killed before the first one and left its recording."""
        if any(path.suffix in (".checkpoint", ".previous") for path in self._folder.glob("*")):
            return True
        try:
            run = str(json.loads((self._folder / _REQUEST).read_text(encoding="utf-8"))["run"])
        except (OSError, ValueError, KeyError, TypeError):
            return False
        return any(path.name.endswith(f"{PARTIAL}{run}") for path in unfinished(self._results))

    def of(self, name: str, recording: RecordingFolder, place: ScenarioFolder) -> Checkpoints | None:
        """Those of a scenario, which has what it recorded until then; None where none are wanted.

        Parameters
        ----------
        name
            Of the scenario.
        recording, place
            Where its rows go, and its other files.
        """
        found = self._of.get(name)
        if found is not None:
            found.take_back(recording, [place.path / TRAJECTORY, place.place / TRAJECTORY], self.run)
        return found

    def end(self, *, whole: bool) -> None:
        """After a study that came to its end nothing is left; else say how it goes on."""
        if whole:
            remove_at_once(self._folder, self.run)
        elif any(one.exist for one in self._of.values()):
            _say(f"gfor run --resume {self._results} goes on from there")


def _name_those_not_kept(scenarios: Sequence[PreparedScenario], options: argparse.Namespace) -> None:
    if not (options.checkpoint or options.require_checkpoint):
        return
    for prepared in scenarios:
        plans = prepared.system.components
        found = [f"{n!r} ({plans[n].description.path.name}): {why}" for n, why in not_kept(prepared).items()]
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
