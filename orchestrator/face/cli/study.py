"""A study of many points as a command: options, the folder, what is printed, and the last line."""

import argparse
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from rich.console import Console, RenderableType
from rich.markup import escape

from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.core.errors import few, number_of
from orchestrator.core.options import Option
from orchestrator.core.safe_files import made_folder
from orchestrator.face.api.progress import shown_progress
from orchestrator.face.cli import arguments
from orchestrator.face.cli.case_arguments import add_case_arguments, asked_of_case, case_of
from orchestrator.face.cli.interrupted import saying_how_it_goes_on
from orchestrator.face.cli.progress_lines import both, progress_lines
from orchestrator.face.cli.terminal import (
    make_console,
    make_errors,
    print_json,
    print_parts,
    print_questions,
    say,
    with_announced_questions,
)
from orchestrator.face.cli.verdict import add_verdict_argument
from orchestrator.output.report.progress import progress_bar
from orchestrator.output.results.lock import hold_folder
from orchestrator.studies.points.executor import Executor
from orchestrator.studies.points.points import CountReport
from orchestrator.studies.points.store import POINTS, any_kept
from orchestrator.studies.points.study import PointStudy, StudyAtOnce
from orchestrator.studies.points.under_way import counting

Result = TypeVar("Result")

_OTHERS = 6  # scenarios that are named beside the one that was taken


class Progressing:
    """A study of many points, for whoever interrupts it."""

    def __init__(self, folder: Path) -> None:
        self._folder, self._done, self._total = folder, 0, 0

    def compute(
        self,
        study: Callable[[CountReport], Result],
        executor: Executor,
        console: Console,
        told: tuple[str, str] = ("computing", "points"),
    ) -> Result:
        """Run the study, and close its executor.

        ``told``: the study, and what it counts, for lines on standard error where there is no terminal."""
        lines = progress_lines(console, *told)
        with counting(), lines, progress_bar(console) as bar:
            task = bar.add_task("Points", total=None)

            def report(done: int, total: int) -> None:
                self._done, self._total = done, total
                bar.update(task, completed=done, total=total)
                lines.report(done, total)

            try:
                return study(report)
            finally:
                executor.close()

    def how_it_goes_on(self) -> str:
        """How to go on after an interrupt; "" where nothing is kept."""
        if not any_kept(self._folder / POINTS) or (self._total and not self._done):
            return ""
        counted = f"{self._done} of {self._total} points" if self._total else "points"
        return f"{counted} are in {self._folder}; the same command continues from there"


AnyStudy = PointStudy[..., Any, Any, Any]
Simple = StudyAtOnce[..., Any]


def add_study_arguments(
    name: str, study: AnyStudy | Simple, parser: argparse.ArgumentParser
) -> None:
    add_case_arguments(parser, several=study.of_several)
    arguments.add_request_arguments(parser, study.asks)
    if isinstance(study, PointStudy):
        arguments.add_executor_arguments(parser)
        kept = f"{study.counted} that are there are not computed again"
        where = f"folder for results (default: results/<case>_{name}); {kept}"
        arguments.option(parser, "--out", "DIR", where, read=Path)
        add_verdict_argument(parser)
    elif study.files:
        arguments.option(parser, "--out", "DIR", f"write {study.files}", read=Path)
    arguments.add_json_argument(parser)


def run_study(name: str, study: AnyStudy | Simple, options: argparse.Namespace) -> int:
    if isinstance(study, StudyAtOnce):
        return _run_at_once(name, study, options)
    with working_in(options, name, study) as (planned, compute, folder):
        found = compute()
        written, prepared = found.save(folder), study.prepared(planned)
        return print_study(options, study, found, folder, written, prepared=prepared)


def _run_at_once(name: str, study: Simple, options: argparse.Namespace) -> int:
    request = study.request(**asked_of_case(options, study.asks, name))
    folder = made_folder(options.out, "--out") if getattr(options, "out", None) else None
    console = make_console(stderr=options.json)
    with (
        counting(),
        progress_lines(console, name, study.counted) as lines,
        shown_progress(study.counted.capitalize(), shown=not options.json) as report,
    ):
        found = study.compute(case_of(options), request, both(report, lines.report))
    print_questions(study.prepared(found), as_json=options.json)
    written = found.save(folder) if folder else []
    end = f"Written: {', '.join(map(str, written))}" if written else ""
    say("warning", study.warnings(found))
    prepared = study.prepared(found)
    present(options, found.as_json, study.parts(found), study.remarks(found), end, prepared)
    return study.code(found, False)


@contextmanager
def working_in(
    options: argparse.Namespace, name: str, study: AnyStudy, place: Path | None = None, **more: Any
) -> Iterator[tuple[Any, Callable[..., Any], Path]]:
    """Plan, make the folder and keep other commands from it; after an interrupt say how the study goes on.

    Gives the plan, what computes it, and the folder; ``more`` is asked beside the options."""
    case = case_of(options)
    request = study.request(**asked_of_case(options, study.asks, name) | more)
    folder = place or options.out or Path("results") / f"{case.name}_{name}"
    executor, progress = arguments.choose_executor(options, study.imports), Progressing(folder)
    with saying_how_it_goes_on(progress.how_it_goes_on):
        planned = study.plan(case, request)
        print_questions(study.prepared(planned), as_json=options.json)

        def compute(*more: object) -> Any:
            others = any_kept(folder / POINTS)
            found = progress.compute(
                lambda report: study.compute(planned, executor, folder, report, *more),
                executor,
                make_console(stderr=options.json),
                (name, study.counted),
            )
            # parts are of one study; a design has its tables elsewhere
            if others and not any(more) and not getattr(found.result, "stored", True):
                point = study.counted[:-1]
                text = f"{folder} holds another study, with no {point} of this one: its tables are replaced"
                say("warning", [f"{text}, and its points stay; give another --out to keep both"])
            return found

        with hold_folder(made_folder(folder, "--out")):
            yield planned, compute, folder


def print_study(
    options: argparse.Namespace,
    study: AnyStudy,
    found: Any,
    folder: Path,
    written: Sequence[Path],
    end: str = "",
    *,
    prepared: Sequence[PreparedScenario] = (),
) -> int:
    """Print what was found, by default with a line on its files at the end; returns the exit code."""
    result = found.result
    if not end:
        stored = f", {result.stored} were there already" if result.stored else ""
        files = ", ".join(path.name for path in written)
        end = f"{number_of(result.computed, study.counted[:-1])} computed{stored}. Results in {folder}: {files}"
    say("warning", study.warnings(found))
    present(options, found.as_json, study.parts(found), study.remarks(found), end, prepared)
    return study.code(found, options.fail_unstable)


def present(
    options: argparse.Namespace,
    as_json: Callable[[], object],
    parts: Iterable[RenderableType],
    remarks: Iterable[str] = (),
    end: str = "",
    prepared: Sequence[PreparedScenario] = (),
) -> None:
    """Print a study: JSON, or its parts and then its last line; remarks on standard error in either case.

    ``prepared``: its scenarios, whose names of buses and branches are shown."""
    names = prepared[0].names if prepared else None
    console = make_console(stderr=options.json, names=names)
    if options.json:
        print_json(as_json())
    else:
        taken = _which_scenario(options, prepared)
        if taken:
            console.print(escape(taken), soft_wrap=True, highlight=False)
        print_parts(console, with_announced_questions(parts, prepared))
    for text in remarks:
        make_errors().print(escape(text), soft_wrap=True)
    if end and not options.json:
        console.print(escape(end), soft_wrap=True, highlight=False)


def _which_scenario(options: argparse.Namespace, prepared: Sequence[PreparedScenario]) -> str:
    """Tell which scenario of several was taken where none was asked for; "" where one was, or all were."""
    if getattr(options, "scenario", None) or len(prepared) != 1:
        return ""
    (one,) = prepared
    others = [name for name in one.case.scenarios if name != one.name]
    if not others:
        return ""
    return f"Scenario {one.name}; {Option.SCENARIO} takes another: {few(others, _OTHERS)}"


class StudyCommand:
    """A command that is made from a study alone."""

    def __init__(self, name: str, study: AnyStudy | Simple) -> None:
        self.add_arguments = partial(add_study_arguments, name, study)
        self.run = partial(run_study, name, study)
