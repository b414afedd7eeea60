"""Parts that the commands on many points share: options, the folder, what is printed, and the last line."""

import argparse
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Protocol

from rich.console import RenderableType
from rich.markup import escape

from orchestrator.cli.arguments import add_json_argument, option
from orchestrator.cli.executors import add_executor_arguments, choose_executor
from orchestrator.cli.interrupted import saying_how_it_goes_on
from orchestrator.cli.points import Progressing
from orchestrator.cli.terminal import make_console, make_errors, print_json, print_parts, print_questions
from orchestrator.cli.verdict import add_verdict_argument
from orchestrator.points.study import Plan, PointStudy, Result, Shown
from orchestrator.results.lock import held
from orchestrator.safe_files import made_folder


class Counted(Protocol):
    """A result that knows how many of its points were computed now, and how many were read."""

    computed: int
    stored: int


def add_study_arguments(parser: argparse.ArgumentParser, study: str, what: str = "points") -> None:
    add_executor_arguments(parser)
    where = f"folder for results (default: results/<case>_{study}); {what} that are there are not computed again"
    option(parser, "--out", "DIR", where, read=Path)
    add_json_argument(parser)
    add_verdict_argument(parser)


@contextmanager
def working_in(
    options: argparse.Namespace, folder: Path, study: PointStudy[Plan, Result, Shown], plan: Callable[[], Plan]
) -> Iterator[tuple[Plan, Callable[..., Shown]]]:
    """Plan, make the folder and keep other commands from it; after an interrupt say how the study goes on.

    Gives the plan and what computes it."""
    executor, progress = choose_executor(options, study.imports), Progressing(folder)
    with saying_how_it_goes_on(progress.how_it_goes_on):
        planned = plan()
        print_questions(study.prepared(planned), as_json=options.json)

        def compute(*more: object) -> Shown:
            return progress.compute(
                lambda report: study.compute(planned, executor, folder, report, *more), executor,
                make_console(stderr=options.json),
            )  # fmt: skip

        with held(made_folder(folder, "--out")):
            yield planned, compute


def folder_of(options: argparse.Namespace, case: str, study: str) -> Path:
    return options.out or Path("results") / f"{case}_{study}"


def present(
    options: argparse.Namespace,
    as_json: Callable[[], object],
    parts: Iterable[RenderableType],
    remarks: Iterable[str] = (),
    end: str = "",
) -> None:
    """Print a study: JSON, or its parts and then its last line; remarks on standard error in either case."""
    console = make_console(stderr=options.json)
    if options.json:
        print_json(as_json())
    else:
        print_parts(console, parts)
    for text in remarks:
        make_errors().print(escape(text), soft_wrap=True)
    if end and not options.json:
        console.print(escape(end), soft_wrap=True, highlight=False)


def last_line(result: Counted, what: str, folder: Path, written: Sequence[Path]) -> str:
    stored = f", {result.stored} were there already" if result.stored else ""
    return f"{result.computed} {what}computed{stored}. Results in {folder}: {', '.join(path.name for path in written)}"
