"""The stability verdict in a terminal, and what it does to a command's exit code."""

import argparse
from collections.abc import Mapping, Sequence

from rich.console import Console
from rich.markup import escape

from orchestrator.face.cli.arguments import switch
from orchestrator.face.cli.terminal import print_parts, print_reference
from orchestrator.linear.spectra.modes import ELECTROMECHANICAL_HZ
from orchestrator.linear.spectra.stability import Stability
from orchestrator.output.report.colours import OF_VERDICTS
from orchestrator.output.report.short_texts import LONGEST_REMARK
from orchestrator.output.report.verdict_sentence import VerdictSentence
from orchestrator.studies.modes.modes import ModesResult
from orchestrator.studies.runs import tables
from orchestrator.studies.runs.answer import ScenarioAnswer
from orchestrator.studies.runs.answers_table import answers_table, other_figures, outside


def add_verdict_argument(parser: argparse.ArgumentParser) -> None:
    switch(
        parser,
        "--fail-unstable",
        "end with exit code 1 unless everything is known to be stable, at any frequency",
    )


def print_stability(
    console: Console, verdicts: Mapping[str, Stability], outside: Mapping[str, str] | None = None
) -> None:
    """The verdict on all, and then on each by its title; what lies outside a frequency range behind it."""
    print_parts(console, [*stability_lines(verdicts, outside or {}), ""])


def stability_lines(verdicts: Mapping[str, Stability], outside: Mapping[str, str]) -> list[str]:
    lines = [_headline(verdicts)] if len(verdicts) != 1 else []
    for title, verdict in verdicts.items():
        head = "" if len(verdicts) == 1 else "  "
        lines.append(
            head + VerdictSentence(verdict.stable, verdict.verdict, verdict.because()).markup(title)
        )
        if outside.get(title):
            lines.append(f"{head}  {escape(outside[title])}")
    return lines


def _headline(verdicts: Mapping[str, Stability]) -> str:
    """One line on all of them; what is worst comes first."""
    for wanted, text in ((False, "UNSTABLE"), (None, "stability not known")):
        found = [title for title, verdict in verdicts.items() if verdict.stable is wanted]
        if found:
            colour = OF_VERDICTS[wanted]
            return f"[bold {colour}]{text}[/]: {escape(', '.join(found))} ({len(found)} of {len(verdicts)})"
    return f"[bold green]stable[/]: all {len(verdicts)}"


def add_details_argument(parser: argparse.ArgumentParser) -> None:
    words = "print also the power flow, each verdict with its eigenvalue, and how it was computed"
    switch(parser, "--details", words)


def print_answers(
    console: Console,
    answers: Sequence[ScenarioAnswer],
    results: Sequence[ModesResult],
    beside: Sequence[str],
    *,
    details: bool,
) -> None:
    ranges = [r.hidden.frequency_range for r in results if r.hidden is not None]
    looked_at = ranges[0] if ranges else ELECTROMECHANICAL_HZ
    others = other_figures(results)
    longest = LONGEST_REMARK if console.is_terminal else None  # who reads a file may want all of it
    console.print(answers_table(answers, looked_at, others, longest=longest))
    if others.figures:
        print_reference(console, results)
    print_parts(console, map(escape, beside))
    rest = outside(results, details=details)
    if rest:
        console.print(escape(rest), style="dim", soft_wrap=True, highlight=False)
    console.print("")


def print_details(console: Console, results: Sequence[ModesResult]) -> None:
    for table in tables.power_flows(results):
        console.print(table, "")
    print_verdicts(console, results)


def print_verdicts(console: Console, results: Sequence[ModesResult]) -> None:
    outside = {r.prepared.title: r.hidden.sentence() for r in results if r.hidden is not None}
    print_stability(console, {r.prepared.title: r.stability for r in results}, outside)


def exit_code(options: argparse.Namespace, verdicts: Sequence[Stability]) -> int:
    """1 where ``--fail-unstable`` is given and not everything is known to be stable."""
    return int(options.fail_unstable and not all(verdict.stable for verdict in verdicts))
