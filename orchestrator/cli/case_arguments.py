"""The arguments of every command on a case."""

import argparse
from pathlib import Path

from orchestrator.api.scenario import Scenario, choose
from orchestrator.cases.case import load_case
from orchestrator.cases.parameter_files import ParameterFile, read_parameter_file
from orchestrator.cases.prepare import PreparedScenario
from orchestrator.cli.arguments import assignment, seconds
from orchestrator.cli.terminal import print_questions


def add_case_arguments(parser: argparse.ArgumentParser) -> None:
    """The case and what is changed of it."""
    parser.add_argument(
        "case", metavar="CASE", help="a built-in case (two_area), or the path of a case file or an .ssp"
    )
    parser.add_argument(
        "--scenario", action="append", default=[], metavar="NAME", help="only this scenario (repeatable)"
    )
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        type=assignment,
        metavar="COMPONENT.PARAMETER=VALUE",
        help="override a value (repeatable)",
    )
    parser.add_argument(
        "--parameters",
        action="append",
        default=[],
        type=Path,
        metavar="FILE",
        help="values from a parameter file, as `gfor design` writes it (repeatable; --set overrides it)",
    )
    parser.add_argument("--step", type=seconds, metavar="H", help="communication step [s], e.g. 1e-4 or '200 us'")
    parser.add_argument(
        "--native",
        dest="set",
        action="append_const",
        const=("*.native", True),
        help="run native FMUs instead of Python-backed ones; short for --set '*.native=true'",
    )


def chosen(options: argparse.Namespace) -> list[Scenario]:
    """The scenarios of a case, as the options have them."""
    file, stop = load_case(options.case), getattr(options, "stop", None)
    scenarios = choose(
        file, options.scenario, dict(options.set), step=options.step, stop=stop, parameters=options.parameters
    )
    print_questions([scenario.prepared for scenario in scenarios])
    return scenarios


def prepare(options: argparse.Namespace) -> list[PreparedScenario]:
    """The same, ready to run."""
    return [scenario.prepared for scenario in chosen(options)]


def parameters(options: argparse.Namespace) -> list[ParameterFile]:
    """The parameter files that are given."""
    return [read_parameter_file(path) for path in options.parameters]
