"""A bar or a line while something is computed, where it is wanted."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console

from orchestrator.output.report.progress import progress_bar


@contextmanager
def shown_progress(title: str, *, shown: bool) -> Iterator[Callable[[int, int], None]]:
    """Inside, a callback for how much is done, of how much; it moves a bar where one is wanted."""
    if not shown:
        yield lambda done, total: None
        return
    with progress_bar(Console()) as bar:
        task = bar.add_task(title, total=None)
        yield lambda done, total: bar.update(task, completed=done, total=total)


@contextmanager
def shown_stages(*, shown: bool) -> Iterator[Callable[[str], None]]:
    """Inside, a callback for the stage that a computation has come to; it changes a line where one is wanted."""
    if not shown:
        yield lambda text: None
        return
    with Console().status("starting") as status:
        yield status.update
