"""Studies of many points: a bar while they are computed, and after Ctrl-C a word on how to continue."""

from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from rich.console import Console
from rich.markup import escape

from orchestrator.cli.terminal import make_errors
from orchestrator.points.executor import Executor
from orchestrator.points.points import CountReport
from orchestrator.report.progress import progress_bar

Result = TypeVar("Result")


def compute_points(
    study: Callable[[CountReport], Result], executor: Executor, folder: Path, console: Console
) -> Result | None:
    """Run a study, and close its executor.

    Parameters
    ----------
    study
        Computes all points; it is given a callback for how many are done, of how many.
    executor
        Where the points are computed.
    folder
        Keeps the points.
    console
        Shows the progress.

    Returns
    -------
    Result | None
        Of the study; None where it was interrupted.
    """
    state = (0, 0)
    with progress_bar(console) as bar:
        task = bar.add_task("Points", total=None)

        def report(done: int, total: int) -> None:
            nonlocal state
            state = (done, total)
            bar.update(task, completed=done, total=total)

        try:
            return study(report)
        except KeyboardInterrupt:
            done, total = state
            counted = f"{done} of {total}" if total else "no"
            make_errors().print(
                f"interrupted: {counted} points are in {escape(str(folder))}; the same command continues from there"
            )
            return None
        finally:
            executor.close()
