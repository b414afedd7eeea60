"""``gfor fmu check``: acceptance tests of an FMU."""

import argparse
from collections import Counter
from dataclasses import replace

from rich.console import Console
from rich.markup import escape

from orchestrator.core.foreign_files import one_line
from orchestrator.devices.acceptance.checks.base import CheckResult, Verdict
from orchestrator.devices.acceptance.runner import AcceptanceReport
from orchestrator.devices.sandbox.protections_in_force import missing
from orchestrator.face.api.acceptance import check
from orchestrator.face.api.progress import shown_progress
from orchestrator.face.cli.arguments import add_kept_argument, add_options
from orchestrator.face.cli.progress_lines import both, progress_lines
from orchestrator.face.cli.terminal import keep_json, make_console, print_json

_COLOURS = {
    Verdict.PASS: "green",
    Verdict.REMARK: "yellow",
    Verdict.FAIL: "bold red",
    Verdict.NOT_APPLICABLE: "dim",
    Verdict.NOT_SUPPORTED: "bold yellow",
}
NOT_SUPPORTED = 2  # exit code where nothing failed, but the FMU could not be run here


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_options(parser, "check")
    add_kept_argument(parser, "check")
    add_options(parser, "check 2")


def run(options: argparse.Namespace) -> int:
    """Check, print, and write what is asked for; 1 if it is not to be accepted, 2 if it is not supported here."""
    with (
        progress_lines(make_console(), "fmu check", "checks") as lines,
        shown_progress("Checks", shown=not options.json) as report,
    ):
        found = check(
            options.file,
            options.binding,
            step=options.step,
            only=options.only,
            case=options.case or None,
            component=options.component,
            scenario=options.scenario,
            seed=options.seed,
            frequency=options.frequency,
            time_limit=options.time_limit,
            memory_limit=options.memory_limit,
            report=both(lines.report, report),
        )
    if options.junit:
        found.save_junit(options.junit)
    keep_json(found.as_json(), options.out, "check")
    if options.json:
        print_json(found.as_json())
    else:
        _print(found.report)
    if found.faults or found.report.reasons:
        return 1
    return NOT_SUPPORTED if found.not_supported else 0


def _each_once(results: list[CheckResult]) -> list[CheckResult]:
    """Join checks that were left out for the same reason in one line."""
    lines: list[CheckResult] = []
    for result in results:
        if (
            result.verdict is Verdict.NOT_APPLICABLE
            and lines
            and lines[-1].evidence == result.evidence
        ):
            lines[-1] = replace(lines[-1], check=f"{lines[-1].check}, {result.check}")
        else:
            lines.append(result)
    return lines


def _print(report: AcceptanceReport) -> None:
    console = Console(soft_wrap=True, highlight=False, emoji=False)
    if report.used_as:
        console.print(f"As {escape(report.used_as)}.", end="\n\n")
    told: dict[tuple[str, str], str] = {}
    advised: set[str] = set()
    for result in _each_once(report.results):
        mark = f"[{_COLOURS[result.verdict]}]{result.verdict:<14}[/]"
        fault = f"[bold]{result.fault}:[/] " if result.fault else ""
        evidence = escape(one_line(result.evidence))
        if result.fault:
            first = told.setdefault((result.fault, result.evidence), result.check)
            evidence = evidence if first == result.check else f"the same as in {first!r}"
        console.print(f"{mark} {result.check:<22} {fault}{evidence}")
        if result.remedy and result.remedy not in advised:
            console.print(f"{'':<38}[dim]{escape(result.remedy)}[/]")
            advised.add(result.remedy)
    console.print()
    if report.drawn:
        console.print(
            f"Dips, jumps and points were drawn at random; --seed {report.seed} draws the same ones again."
        )
    if report.protections:
        in_force = [protection.name for protection in report.protections if protection.in_force]
        console.print(f"In force around the FMU's process: {', '.join(in_force)}.")
    lacking = missing(report.protections)
    if lacking:
        console.print(f"Not in force on this system: {', '.join(lacking)}.")
    counts = Counter(str(result.verdict) for result in report.results)
    console.print(", ".join(f"{verdict} {count}" for verdict, count in counts.items()) + ".")
    colour = "bold red" if report.failures else "bold yellow"
    style = "" if report.trusted else colour
    console.print(escape(f"{report.fmu.name}: {report.sentence}"), style=style)
