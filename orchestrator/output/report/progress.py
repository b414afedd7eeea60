"""A progress bar on a terminal or in a notebook."""

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn


def progress_bar(console: Console) -> Progress:
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.percentage:>3.0f} %"),
        TimeRemainingColumn(),
    )
    shown = console.is_terminal or console.is_jupyter
    return Progress(*columns, console=console, disable=not shown, transient=True)
