"""``gfor sensitivities``: how each parameter of each FMU moves a mode."""

import argparse
from collections.abc import Sequence
from contextlib import nullcontext
from pathlib import Path

from rich.markup import escape

from orchestrator.api.progress import shown_progress
from orchestrator.api.scenario import Scenario
from orchestrator.cli.arguments import option, repeatable, switch
from orchestrator.cli.case_arguments import add_case_arguments, add_range_argument, chosen
from orchestrator.cli.terminal import make_console, print_json, print_warnings, warn
from orchestrator.cli.verdict import add_verdict_argument, exit_code, print_verdicts
from orchestrator.errors import InputError
from orchestrator.results.lock import held
from orchestrator.safe_files import made_folder
from orchestrator.sensitivities.view import left_out, sensitivity_table


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_case_arguments(parser)
    option(parser, "--mode", "NAME", "a mode that the case names, or 'critical' for the least damped one (default: the "
           "first named one)")  # fmt: skip
    repeatable(parser, "--parameter", "COMPONENT.PARAMETER", "only this one, tunable or fixed; also a pattern "
               "(repeatable; default: all tunable ones)")  # fmt: skip
    switch(parser, "--fixed", "fixed parameters too: the case is started several times for each")
    switch(parser, "--held", "partial derivatives at the held operating point, instead of the total ones; tunable "
           "parameters only")  # fmt: skip
    add_range_argument(parser)
    switch(parser, "--directional", "linearise with the FMUs' own directional derivatives instead of by perturbation "
           "(with --native)")  # fmt: skip
    option(parser, "--out", "DIR", "write sensitivities.csv and sensitivities.json there", read=Path)
    switch(parser, "--json", "print JSON")
    add_verdict_argument(parser)


def run(options: argparse.Namespace) -> int:
    """Compute, print, and write what is asked for; returns 1 if no parameter has a derivative."""
    if options.held and options.fixed:
        raise InputError("--held holds the operating point, which a fixed parameter moves; give one of them")
    scenarios = chosen(options)
    folder = made_folder(options.out, "--out") if options.out else None
    with held(folder) if folder else nullcontext():
        return _compute(scenarios, options, folder)


def _compute(scenarios: Sequence[Scenario], options: argparse.Namespace, folder: Path | None) -> int:
    found = []
    for scenario in scenarios:
        with shown_progress("Parameters", shown=not options.json) as report:
            found.append(
                scenario.sensitivities(
                    options.mode, options.parameter, fixed=options.fixed, held=options.held,
                    directional=options.directional, frequencies=options.range, report=report,
                )
            )  # fmt: skip
    written = []
    if folder:
        for scenario, one in zip(scenarios, found, strict=True):
            written += one.save(folder / scenario.name)
    results = [one.result.modes for one in found]
    if options.json:
        print_json([one.as_json() for one in found])
    else:
        console = make_console()
        print_verdicts(console, results)
        print_warnings(results)
        for one in found:
            warn(one.result.modes.prepared.name, one.result.warnings)
            console.print(sensitivity_table(one.result), "")
            if missing := left_out(one.result):
                console.print(f"{len(missing)} of {len(one.result.rows)} parameters have no derivative", "")
        if written:
            console.print(escape(f"Written: {', '.join(map(str, written))}"), soft_wrap=True)
    failed = int(all(row.derivative is None for one in found for row in one.result.rows))
    return failed or exit_code(options, [r.stability for r in results])
