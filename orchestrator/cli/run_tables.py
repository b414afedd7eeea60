"""What ``gfor run`` prints of its results, the worst first."""

from collections.abc import Sequence

from rich.console import Console
from rich.markup import escape

from orchestrator.cli.terminal import print_named_modes, print_sources
from orchestrator.cli.verdict import print_verdicts
from orchestrator.study import tables
from orchestrator.study.early_end import EarlyEnd
from orchestrator.study.run import RunResult


def print_run(console: Console, results: Sequence[RunResult], early_end: EarlyEnd | None) -> None:
    """How a study came out.

    Parameters
    ----------
    console
        Where it is printed.
    results
        Of the scenarios that ran.
    early_end
        Where it ended before its last scenario.
    """
    if early_end is not None:
        colour = "yellow" if early_end.interrupted else "red"
        words = f"[bold {colour}]{early_end.word}[/] {escape(early_end.place)}"
        console.print(words, soft_wrap=True, highlight=False)
    modes = [r.modes for r in results]
    for r in results:
        for finding in r.went_unstable:
            words = escape(f"{r.modes.prepared.title}: {finding.message}")
            console.print(f"[bold red]UNSTABLE in the simulation[/]: {words}", soft_wrap=True, highlight=False)
        if r.stable_in_simulation is None:
            words = f"{escape(r.modes.prepared.title)}: not judged throughout; the warnings above say where and why"
            console.print(f"[bold yellow]stability in the simulation[/]: {words}", soft_wrap=True, highlight=False)
    if not all(r.stable_in_simulation for r in results):
        console.print("[bold]By the modes at the operating point:[/]")
    print_verdicts(console, modes)
    console.print(tables.steady_states(modes), "")
    print_named_modes(console, modes)
    print_sources(console, modes)
    if any(r.ring_down for r in results):
        console.print("", tables.ring_downs(results))
    if any(r.shifts for r in results):
        console.print("", tables.mode_shifts(results))
    if any(r.linear is not None for r in results):
        console.print("", tables.linear_differences(results))
    console.print("", tables.run_statistics(results), "")
