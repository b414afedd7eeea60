"""The arguments of every command on a case."""

import argparse
from dataclasses import replace
from typing import Any

from orchestrator.cases.case import Case, load_case, with_protection
from orchestrator.cases.flow.sharing import SharingRule
from orchestrator.cases.forcing import different_scenarios, with_events
from orchestrator.cases.form.parameter_files import ParameterFile, read_parameter_file
from orchestrator.cases.form.schema import Value
from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.core.errors import InputError
from orchestrator.face.api.scenario import Scenario, choose
from orchestrator.face.cli.arguments import add_options, asked_by, option, repeatable, seconds
from orchestrator.face.cli.terminal import print_questions
from orchestrator.studies.black_box.frequency_response import METHODS, Excitation
from orchestrator.studies.modes.request import ScenariosRequest
from orchestrator.systems.coupling.schedule import SCHEDULES

_ONE_SCENARIO = "the scenario (default: the first line tells which was taken)"


def add_case_arguments(
    parser: argparse.ArgumentParser,
    *,
    optional: bool = False,
    schedule: bool = False,
    several: bool = True,
) -> None:
    """The case, which may be left out where ``optional``, ``several`` scenarios or one, what is changed; its schedule
    where asked for."""
    parser.add_argument(
        "case",
        metavar="CASE",
        nargs="?" if optional else None,
        help="a built-in case (two_area), or the path of a case file or an .ssp",
    )
    text = "only this scenario (repeatable; default: all)" if several else _ONE_SCENARIO
    repeatable(parser, "--scenario", "NAME", text)
    add_options(parser, "case")
    add_trust_argument(parser)
    option(parser, "--step", "H", "communication step [s], e.g. 1e-4 or '200 us'", read=seconds)
    if schedule:
        add_options(parser, "schedule", schedules=SCHEDULES)
        add_options(parser, "sharing", rules=[str(rule) for rule in SharingRule])


def add_trust_argument(parser: argparse.ArgumentParser) -> None:
    """The user's own word on foreign FMUs."""
    add_options(parser, "trust")


def case_of(options: argparse.Namespace) -> Case:
    return load_case(options.case, trust_fmus=options.trust_fmus)


def chosen(options: argparse.Namespace) -> list[Scenario]:
    events = [getattr(options, name, ()) for name in ("force", "fault")]
    file, stop = with_events(case_of(options), *events), getattr(options, "stop", None)
    file = with_protection(file, getattr(options, "protection", None))
    file = replace(file, scans=getattr(options, "scans", False))
    asked: dict[str, Any] = {
        name: getattr(options, name, None) for name in ("schedule", "tolerance", "sharing")
    }
    asked["sharing"] = SharingRule(asked["sharing"]) if asked["sharing"] else None
    asked |= {
        "values": values_set(options),
        "step": options.step,
        "parameters": parameters(options),
    }
    request = ScenariosRequest(**asked)
    scenarios = choose(file, options.scenario or different_scenarios(file), request, stop)
    print_questions(
        [scenario.prepared for scenario in scenarios],
        as_json=getattr(options, "json", True),
        whole=getattr(options, "details", False),
    )
    return scenarios


def values_set(options: argparse.Namespace) -> dict[str, Value]:
    """The values of ``--set`` and ``--native``; of a name that is given twice, the last value, at its last place.

    Patterns make the order matter: a value overrides those before it."""
    values: dict[str, Value] = {}
    for key, value in options.set:
        values.pop(key, None)
        values[key] = value
    return values


def asked_of_case(options: argparse.Namespace, request: type, study: str) -> dict[str, Any]:
    """The fields of a request from all options: its own, and those of the case."""
    of_case = {
        "values": values_set(options),
        "step": options.step,
        "parameters": parameters(options),
    }
    if hasattr(request, "scenarios"):
        of_case["scenarios"] = tuple(options.scenario)
    elif len(options.scenario) > 1:
        given = " and ".join(options.scenario)
        raise InputError(
            f"--scenario: gfor {study} is for one scenario, not for {given}; start it once for each"
        )
    else:
        of_case["scenario"] = next(iter(options.scenario), None)
    return asked_by(options, request) | of_case


def prepare(options: argparse.Namespace) -> list[PreparedScenario]:
    return [scenario.prepared for scenario in chosen(options)]


def parameters(options: argparse.Namespace) -> list[ParameterFile]:
    return [read_parameter_file(path) for path in options.parameters]


_DEFAULTS = Excitation()


def add_excitation_arguments(parser: argparse.ArgumentParser) -> None:
    add_options(
        parser,
        "excitation",
        methods=METHODS,
        multisine=_DEFAULTS.method,
        **{name: getattr(_DEFAULTS, name) for name in ("amplitude", "lowest_hz", "highest_hz")},
    )


def excitation_given(options: argparse.Namespace) -> list[str]:
    """Options of the excitation that are not left to their defaults."""
    said = {
        "--method": options.method != _DEFAULTS.method,
        "--amplitude": options.amplitude != _DEFAULTS.amplitude,
        "--from-hz": options.from_hz != _DEFAULTS.lowest_hz,
        "--to-hz": options.to_hz != _DEFAULTS.highest_hz,
        "--no-state": options.no_state,
    }
    return [name for name, is_said in said.items() if is_said]


def excitation_of(options: argparse.Namespace) -> Excitation:
    if not options.from_hz < options.to_hz:
        raise InputError(f"--from-hz {options.from_hz:g} must be below --to-hz {options.to_hz:g}")
    return Excitation(options.method, options.from_hz, options.to_hz, amplitude=options.amplitude)
