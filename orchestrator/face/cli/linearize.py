"""``gfor export linear``: a scenario's A, B, C, D for other tools."""

import argparse
from collections.abc import Callable
from functools import partial
from pathlib import Path

from orchestrator.core.safe_files import made_folder
from orchestrator.face.cli.arguments import add_options
from orchestrator.face.cli.case_arguments import add_case_arguments, chosen
from orchestrator.face.cli.terminal import make_console, said_stages, warn
from orchestrator.face.cli.verdict import add_verdict_argument, exit_code, print_stability
from orchestrator.linear.spectra.slowest_decay import LEAST_STATES
from orchestrator.linear.spectra.stability import Stability
from orchestrator.output.report.linearised import exceptions_in_words
from orchestrator.output.results.staging import new_run_id, staged
from orchestrator.studies.modes.linear_model_files import save_linear_model


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_case_arguments(parser, schedule=True)
    add_options(parser, "linearize")
    add_verdict_argument(parser)


def _say(report: Callable[[str], None], scenario: str, text: str) -> None:
    report(f"{scenario}: {text}")


def run(options: argparse.Namespace) -> int:
    scenarios = chosen(options)
    folder = made_folder(
        options.out or Path("results") / f"{scenarios[0].prepared.case.name}_linear", "--out"
    )
    verdicts: dict[str, Stability] = {}
    lines, run_id = [], new_run_id()
    for scenario in scenarios:
        with said_stages() as report:
            model = scenario.linearize(
                options.input or (),
                options.output or (),
                continuous=options.continuous,
                report=partial(_say, report, scenario.name),
            )
        verdicts[scenario.title] = model.stability
        warn(scenario.name, model.warnings)
        place = folder / scenario.name
        with said_stages() as report, staged(place, run_id) as staging:
            if len(model.states) >= LEAST_STATES:
                _say(report, scenario.name, f"{len(model.states)}² numbers of A are written")
            saved = save_linear_model(
                model, model.operating_point, model.stability, scenario.prepared, staging
            )
        paths = [place / path.name for path in saved]
        size = (
            f"{len(model.states)} states, {len(model.inputs)} inputs, {len(model.outputs)} outputs"
        )
        kind = "continuous" if model.step_size is None else f"step map of {model.step_size:g} s"
        lines.append(f"{scenario.name}: {kind}, {size}: {', '.join(map(str, paths))}")
        exceptions = exceptions_in_words(model.sources)
        if exceptions:
            lines.append(exceptions)
    print_stability(make_console(), verdicts)
    print("\n".join(lines))
    return exit_code(options, list(verdicts.values()))
