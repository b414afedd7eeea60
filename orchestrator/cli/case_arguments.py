"""The arguments of every command on a case."""

import argparse
from pathlib import Path

from orchestrator.api.scenario import Scenario, choose
from orchestrator.cases.case import load_case
from orchestrator.cases.forcing import forced
from orchestrator.cases.parameter_files import ParameterFile, read_parameter_file
from orchestrator.cases.prepare import PreparedScenario
from orchestrator.cases.schema import Value
from orchestrator.cli.arguments import assignment, seconds
from orchestrator.cli.terminal import print_questions
from orchestrator.coupling.schedule import SCHEDULES


def add_case_arguments(parser: argparse.ArgumentParser, *, optional: bool = False, schedule: bool = False) -> None:
    """The case, which may be left out where ``optional``, and what is changed of it; its schedule where asked for."""
    parser.add_argument(
        "case",
        metavar="CASE",
        nargs="?" if optional else None,
        help="a built-in case (two_area), or the path of a case file or an .ssp",
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
    add_trust_argument(parser)
    parser.add_argument("--step", type=seconds, metavar="H", help="communication step [s], e.g. 1e-4 or '200 us'")
    if schedule:
        add_schedule_argument(parser)
    parser.add_argument(
        "--native",
        dest="set",
        action="append_const",
        const=("*.native", True),
        help="run native FMUs instead of Python-backed ones; short for --set '*.native=true'",
    )


def add_schedule_argument(parser: argparse.ArgumentParser) -> None:
    """In which order components step."""
    parser.add_argument(
        "--schedule",
        choices=SCHEDULES,
        help="in which order components step, and what their inputs do meanwhile: midpoint and newton are of second "
        "order in the step (default: the case's)",
    )


def add_trust_argument(parser: argparse.ArgumentParser) -> None:
    """The user's own word on foreign FMUs."""
    parser.add_argument(
        "--trust-fmus",
        action="store_true",
        help="let FMUs of others run in gfor's own process where the case says isolated = false; they can do there "
        "whatever you can",
    )


def chosen(options: argparse.Namespace) -> list[Scenario]:
    file = forced(load_case(options.case, trust_fmus=options.trust_fmus), getattr(options, "force", ()))
    stop = getattr(options, "stop", None)
    scenarios = choose(
        file, options.scenario, values_set(options), step=options.step, stop=stop, parameters=options.parameters,
        schedule=getattr(options, "schedule", None), tolerance=getattr(options, "tolerance", None),
    )  # fmt: skip
    print_questions([scenario.prepared for scenario in scenarios], as_json=getattr(options, "json", True))
    return scenarios


def values_set(options: argparse.Namespace) -> dict[str, Value]:
    """The values of ``--set`` and ``--native``; of a name that is given twice, the last value, at its last place.

    Patterns make the order matter: a value overrides those before it.
    """
    values: dict[str, Value] = {}
    for key, value in options.set:
        values.pop(key, None)
        values[key] = value
    return values


def prepare(options: argparse.Namespace) -> list[PreparedScenario]:
    """The same, ready to run."""
    return [scenario.prepared for scenario in chosen(options)]


def parameters(options: argparse.Namespace) -> list[ParameterFile]:
    return [read_parameter_file(path) for path in options.parameters]
