"""``gfor sensitivities``: how each parameter of each FMU moves a mode."""

import argparse
from collections.abc import Iterator, Sequence
from contextlib import nullcontext
from dataclasses import replace
from itertools import chain
from pathlib import Path

from rich.console import RenderableType
from rich.markup import escape

from orchestrator.core.safe_files import made_folder
from orchestrator.face.api.progress import shown_progress
from orchestrator.face.api.scenario import Scenario, sensitivities_of
from orchestrator.face.cli.arguments import (
    add_json_argument,
    add_request_arguments,
    asked_by,
    option,
)
from orchestrator.face.cli.case_arguments import add_case_arguments, chosen
from orchestrator.face.cli.progress_lines import both, progress_lines
from orchestrator.face.cli.terminal import (
    make_console,
    print_json,
    print_parts,
    print_warnings,
    warn,
    with_announced_questions,
)
from orchestrator.face.cli.verdict import add_verdict_argument, exit_code, print_verdicts
from orchestrator.output.results.lock import hold_folder
from orchestrator.studies.sensitivities.request import SensitivitiesRequest
from orchestrator.studies.sensitivities.sensitivities import SensitivityResult
from orchestrator.studies.sensitivities.view import left_out, sensitivity_table, tell_most


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_case_arguments(parser)
    add_request_arguments(parser, SensitivitiesRequest)
    option(
        parser, "--out", "DIR", "write sensitivities.csv and sensitivities.json there", read=Path
    )
    add_json_argument(parser)
    add_verdict_argument(parser)


def run(options: argparse.Namespace) -> int:
    """Compute, print, and write what is asked for; returns 1 if no parameter has a derivative."""
    scenarios = chosen(options)
    folder = made_folder(options.out, "--out") if options.out else None
    with hold_folder(folder) if folder else nullcontext():
        return _compute(scenarios, options, folder)


def _compute(
    scenarios: Sequence[Scenario], options: argparse.Namespace, folder: Path | None
) -> int:
    request, found = SensitivitiesRequest(**asked_by(options, SensitivitiesRequest)), []
    for scenario in scenarios:
        name = f"sensitivities of {scenario.name}" if len(scenarios) > 1 else "sensitivities"
        with (
            progress_lines(make_console(), name, "parameters") as lines,
            shown_progress("Parameters", shown=not options.json) as report,
        ):
            told = replace(request, report=both(lines.report, report))
            found.append(sensitivities_of(scenario, told))
    written = []
    if folder:
        for scenario, one in zip(scenarios, found, strict=True):
            written += one.save(folder / scenario.name)
    results = [one.result.modes for one in found]
    if options.json:
        print_json([one.as_json() for one in found])
    else:
        console = make_console(names=scenarios[0].prepared.names)
        print_verdicts(console, results)
        print_warnings(results)
        for one in found:
            warn(one.result.modes.prepared.name, one.result.warnings)
        parts = chain.from_iterable(_parts(one.result) for one in found)
        print_parts(console, with_announced_questions(parts, [one.prepared for one in results]))
        if written:
            console.print(escape(f"Written: {', '.join(map(str, written))}"), soft_wrap=True)
    failed = int(all(row.derivative is None for one in found for row in one.result.rows))
    return failed or exit_code(options, [r.stability for r in results])


def _parts(result: SensitivityResult) -> Iterator[RenderableType]:
    yield from (escape(tell_most(result)), "", sensitivity_table(result), "")
    missing = left_out(result)
    if missing:
        yield f"{len(missing)} of {len(result.rows)} parameters have no derivative"
        yield ""
