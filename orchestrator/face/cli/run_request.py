"""The request of a run, kept beside its checkpoints for ``gfor run --resume``."""

import argparse
import json
import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from orchestrator.cases.case import built_in_cases
from orchestrator.core.errors import InputError
from orchestrator.core.safe_files import write_text
from orchestrator.face.cli.arguments import add_options
from orchestrator.output.results.checkpoint_file import CHECKPOINT, CHECKPOINTS
from orchestrator.output.results.staging import new_run_id
from orchestrator.studies.runs.checkpoints import EVERY

_REQUEST = "request.json"
_OF_THE_RUN: Mapping[str, Any] = {
    "case": None,
    "scenario": [],
    "set": [],
    "parameters": [],
    "step": None,
    "schedule": None,
    "stop": None,
    "tolerance": None,
    "sharing": None,
    "force": [],
    "fault": [],
    "protection": None,
    "linear": False,
    "csv": True,
    "require_checkpoint": False,
    "checkpoint": None,
}
"""Options as they are where nothing is said; a resumed run keeps those that it had."""

_GIVEN_ANEW = "checkpoint"  # the one of them that may go with ``--resume``: no value depends on it

_NOT_WITH_RESUME: Mapping[str, Any] = {
    **{name: unsaid for name, unsaid in _OF_THE_RUN.items() if name != _GIVEN_ANEW},
    "out": None,
    "like": None,
    "order": None,
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_options(parser, "run_request", EVERY=EVERY)


def with_request(options: argparse.Namespace) -> argparse.Namespace:
    """The options of a new run, or those of the run that is to be resumed, and its id as ``run``.

    Raises `InputError` if there is no case, nothing to resume, or something is asked of a resumed run that it did not
    have."""
    if options.resume is None:
        if options.case is None:
            raise InputError("the case is missing: gfor run CASE, such as gfor run two_area")
        return argparse.Namespace(**{**vars(options), "run": new_run_id()})
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
    given_anew = options.checkpoint is not None
    if given_anew:
        kept[_GIVEN_ANEW] = options.checkpoint
    kept["set"] = [(name, value) for name, value in kept["set"]]
    kept["parameters"] = [Path(path) for path in kept["parameters"]]
    return argparse.Namespace(
        **{**vars(options), **kept, "out": options.resume, "given_anew": given_anew}
    )


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


def how_it_goes_on(options: argparse.Namespace) -> str:
    """The command that resumes a run that was ended; "" where it would be refused, or its folder is not known."""
    folder = options.out
    if folder is None or asked_by(folder) != options.run:  # another run's request is not this one's
        return ""
    command = f"gfor run --resume {shlex.quote(str(folder))}{' --trust-fmus' if options.trust_fmus else ''}"
    if any((folder / CHECKPOINTS).glob(f"*{CHECKPOINT}")):
        return f"{command} goes on from there"
    return f"{command} begins it again; there was no checkpoint yet"


def asked_by(folder: Path) -> str | None:
    """Id of the run whose request is kept in a folder; None where none is, or it cannot be read."""
    try:
        return str(json.loads((folder / CHECKPOINTS / _REQUEST).read_text(encoding="utf-8"))["run"])
    except (OSError, ValueError, KeyError, TypeError):
        return None


def keep_request(folder: Path, options: argparse.Namespace) -> None:
    content = {name: getattr(options, name) for name in _OF_THE_RUN} | {"run": options.run}
    content["case"] = (
        options.case if options.case in built_in_cases() else str(Path(options.case).resolve())
    )
    content["parameters"] = [str(path.resolve()) for path in options.parameters]
    write_text(folder / CHECKPOINTS / _REQUEST, json.dumps(content, indent=1))
