"""Tables of ``gfor run``, the worst result first."""

import math
from collections.abc import Sequence

from rich.console import Console
from rich.markup import escape

from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.devices.fmi.loaded_component import PYTHON_BACKED
from orchestrator.face.cli.terminal import announced_questions, print_named_modes, print_sources
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
    answers = [of_run(r) for r in results]
    relays = [f"{one.subject}: {one.quiet_relays}" for one in answers if one.quiet_relays]
    below = announced_questions(m.prepared for m in modes)
    print_answers(console, answers, modes, [*beside, *faults, *relays, *below], details=details)
    print_named_modes(console, modes, details=details)
    print_sources(console, modes)
    ring_downs = tables.ring_downs(results)
    if ring_downs is not None:
        console.print(ring_downs, "")
    if any(r.linear is not None for r in results):
        console.print(tables.linear_differences(results), "")
    if details:
        console.print(tables.steady_states(modes))
        if any(r.shifts for r in results):
            console.print("", tables.mode_shifts(results))
        console.print("", tables.run_statistics(results), "")
    else:
        console.print(escape(how_computed(results)), soft_wrap=True, highlight=False)
    for words in _on_steps(results):
        console.print(escape(words), soft_wrap=True, highlight=False)
    if details:
        print_details(console, modes)


def how_computed(results: Sequence[RunResult]) -> str:
    """The tables of the details in one line: the worst of all scenarios."""
    residuals = [r.modes.operating_point.residual for r in results]
    known = [one for one in residuals if not math.isnan(one)]
    told = [f"steady states hold to {max(known):.1e} in a communication step"] if known else []
    shifts = [abs(shift) for r in results if (shift := r.own_shift) is not None]
    if shifts:
        told.append(f"the step moves the electromechanical mode by {max(shifts):.1e} rad/s")
    speeds = [r.statistics.real_time_factor for r in results if r.statistics]
    if speeds:
        told.append(f"{_range(speeds)} times as fast as real time")
    return f"How it was computed: {'; '.join([*told, '--details has the tables'])}."


def _range(values: Sequence[float]) -> str:
    low, high = f"{min(values):.3g}", f"{max(values):.3g}"
    return low if low == high else f"{low} to {high}"


def _on_steps(results: Sequence[RunResult]) -> list[str]:
    """Sentences on steps that follow a tolerance, and on threads."""
    texts = []
    for r in results:
        if r.statistics and r.statistics.adaptive:
            texts.append(on_adaptive_steps(r.modes.prepared, r.statistics.adaptive))
    threads = [on_one_thread(r.statistics) for r in results if r.statistics]
    return [*texts, *dict.fromkeys(filter(None, threads))]
