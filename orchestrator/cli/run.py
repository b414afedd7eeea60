"""``gfor run``: steady state, modes and time response of a case's scenarios."""

import argparse
import json
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape

from orchestrator.api.scenario import RunEndedWarning
from orchestrator.cli import like
from orchestrator.cli.arguments import seconds
from orchestrator.cli.case_arguments import add_case_arguments, chosen
from orchestrator.cli.terminal import (
    made_folder,
    make_console,
    make_errors,
    print_findings,
    print_named_modes,
    print_sources,
    print_warnings,
)
from orchestrator.cli.verdict import add_verdict_argument, exit_code, print_verdicts
from orchestrator.coupling.progress import Progress
from orchestrator.errors import INTERRUPTED, CosimError, RunInterruptedError
from orchestrator.report.progress import progress_bar
from orchestrator.study import tables
from orchestrator.study.files import save_run, save_study, summary_of
from orchestrator.study.run import RunResult


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``gfor run``."""
    add_case_arguments(parser)
    parser.add_argument("--stop", type=seconds, metavar="T", help="stop time [s], e.g. 5 or '500 ms'")
    parser.add_argument("--out", type=Path, metavar="DIR", help="folder for results (default: results/<case>)")
    parser.add_argument("--linear", action="store_true", help="lay the linear model's response over the simulated one")
    parser.add_argument("--json", action="store_true", help="print the summary as JSON")
    add_verdict_argument(parser)
    like.add_arguments(parser)


def run(options: argparse.Namespace) -> int:
    """Run the scenarios one after the other; each is written as soon as it is done."""
    rules = like.rules_of(options)
    scenarios = chosen(options)
    if rules is not None:
        return like.run([scenario.prepared for scenario in scenarios], rules, options)
    folder = made_folder(options.out or Path("results") / scenarios[0].prepared.case.name)
    console = make_console(stderr=options.json)
    results: list[RunResult] = []
    stopped: tuple[str, BaseException] | None = None
    with progress_bar(console) as bar:
        for scenario in scenarios:
            task = bar.add_task(scenario.title, total=None)

            def report(done: int, total: int, task: Any = task) -> None:
                bar.update(task, completed=done, total=total)

            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore", RunEndedWarning)  # it is said at the end
                    result = scenario.run(linear=options.linear, observers=[Progress(report)]).result
            except (CosimError, KeyboardInterrupt) as error:
                if not results:
                    raise
                stopped = (scenario.name, error)
                break
            results.append(result)
            save_run(result, folder)
            print_warnings([result.modes])
            print_findings([result])
            if result.failure:
                stopped = (scenario.name, result.failure)
                break
    plots = save_study(results, folder)
    if options.json:
        print(json.dumps([summary_of(r) for r in results], indent=1, ensure_ascii=False))
    else:
        _print(console, results)
        console.print(f"Results in {folder}: trajectories (.nc, .csv), modes.csv, participation.csv, mode_shapes.csv, "
                      f"step_size.csv, summary.json, "
                      f"{', '.join(p.name for p in plots)}", soft_wrap=True)  # fmt: skip
    if stopped:
        return _end(*stopped, folder)
    gone_bad = options.fail_unstable and any(r.went_unstable for r in results)
    return int(gone_bad) or exit_code(options, [r.modes.stability for r in results])


def _end(scenario: str, error: BaseException, folder: Path) -> int:
    """Say where a study ended before its time, and what is left of it."""
    interrupted = isinstance(error, KeyboardInterrupt | RunInterruptedError)
    head = "" if interrupted else "[bold red]error:[/bold red] "
    text = f"scenario {scenario!r}: {str(error) or 'interrupted'}\nWhat was computed until then is in {folder}"
    make_errors().print(f"{head}{escape(text)}")
    return INTERRUPTED if interrupted else 1


def _print(console: Console, results: Sequence[RunResult]) -> None:
    modes = [r.modes for r in results]
    for r in results:
        for finding in r.went_unstable:
            words = escape(f"{r.modes.prepared.title}: {finding.message}")
            console.print(f"[bold red]UNSTABLE in the simulation[/]: {words}", soft_wrap=True, highlight=False)
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
