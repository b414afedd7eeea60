"""Tables of ``gfor run``, the worst result first."""

from collections.abc import Sequence

from rich.console import Console
from rich.markup import escape

from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.devices.fmi.loaded_component import PYTHON_BACKED
from orchestrator.face.cli.terminal import print_named_modes, print_sources
from orchestrator.face.cli.verdict import print_answers, print_details
from orchestrator.studies.runs import tables
from orchestrator.studies.runs.answer import EarlyEnd
from orchestrator.studies.runs.answer_of_run import of_run
from orchestrator.studies.runs.run import RunResult
from orchestrator.systems.coupling.statistics import StepCounts, StepStatistics


def on_one_thread(statistics: StepStatistics) -> str:
    """Which components one thread alone may step, and why; "" where any thread may step all."""
    by_reason: dict[str, list[str]] = {}
    for name, reason in statistics.one_thread.items():
        by_reason.setdefault(reason, []).append(name)
    parts = [
        f"{', '.join(names[:4])}{' …' if len(names) > 4 else ''} ({why})"
        for why, names in by_reason.items()
    ]
    hint = "; with --native several threads can" if PYTHON_BACKED in by_reason else ""
    return f"One thread steps {'; '.join(parts)}{hint}." if parts else ""


def on_adaptive_steps(prepared: PreparedScenario, counts: StepCounts) -> str:
    taken = f"{counts.accepted} steps" if counts.accepted else "no step"
    if counts.accepted:
        taken += f" of {1e3 * counts.shortest:.3g} to {1e3 * counts.longest:.3g} ms"
    back = (
        "1 pair of steps was"
        if counts.rejected == 1
        else f"{counts.rejected or 'no'} pairs of steps were"
    )
    return (
        f"{prepared.title}: tolerance {prepared.schedule.tolerance:g}: {taken}; {back} taken back. The modes above are "
        "those of the fixed communication step."
    )


def print_run(
    console: Console,
    results: Sequence[RunResult],
    beside: Sequence[str],
    early_end: EarlyEnd | None,
    *,
    details: bool,
) -> None:
    if early_end is not None:
        colour = "yellow" if early_end.interrupted else "red"
        words = f"[bold {colour}]{early_end.word}[/] {escape(early_end.place)}"
        console.print(words, soft_wrap=True, highlight=False)
    modes = [r.modes for r in results]
    faults = dict.fromkeys(fault.in_words for m in modes for fault in m.prepared.faults)
    print_answers(console, [of_run(r) for r in results], modes, [*beside, *faults])
    print_named_modes(console, modes)
    print_sources(console, modes)
    ring_downs = tables.ring_downs(results)
    if ring_downs is not None:
        console.print("", ring_downs)
    console.print("", tables.steady_states(modes))
    if any(r.shifts for r in results):
        console.print("", tables.mode_shifts(results))
    if any(r.linear is not None for r in results):
        console.print("", tables.linear_differences(results))
    console.print("", tables.run_statistics(results), "")
    for r in results:
        if r.statistics and r.statistics.adaptive:
            words = on_adaptive_steps(r.modes.prepared, r.statistics.adaptive)
            console.print(escape(words), soft_wrap=True, highlight=False)
    for words in dict.fromkeys(
        text for r in results if r.statistics and (text := on_one_thread(r.statistics))
    ):
        console.print(escape(words), soft_wrap=True)
    if details:
        print_details(console, modes)
