"""``gfor interactions``: which modes several vendors' converters share, and which pair of them does not agree."""

import argparse
from collections.abc import Iterator
from dataclasses import replace

from rich.console import RenderableType
from rich.markup import escape

from orchestrator.certification.devices import devices_of
from orchestrator.cli.arguments import add_request_arguments, asked_by, repeatable
from orchestrator.cli.case_arguments import add_case_arguments, case_of, of_one_scenario
from orchestrator.cli.study import add_study_arguments, folder_of, last_line, present, working_in
from orchestrator.cli.terminal import say
from orchestrator.errors import InputError
from orchestrator.fmi.devices import as_device
from orchestrator.interactions.request import GivenDevice, InteractionsRequest
from orchestrator.interactions.study import plan_interactions
from orchestrator.interactions.view import STUDY, Interactions, assignments_table, modes_table, systems_table
from orchestrator.interactions.words import verdict_of


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_case_arguments(parser, several=False)
    add_request_arguments(parser, InteractionsRequest)
    repeatable(parser, "--device", "[NAME=]FILE", "try this FMU or DLL at the places as well; it implies --swap "
               "(repeatable)")  # fmt: skip
    repeatable(parser, "--binding", "[NAME=]FILE", "binding of a --device (repeatable)")
    add_study_arguments(parser, "interactions", "systems")


def run(options: argparse.Namespace) -> int:
    """Plan, compute, write and print; returns 1 if the system as it is has no modes."""
    of_case = of_one_scenario(options, "interactions are those of one scenario")
    case = case_of(options)
    request = _request(options)
    folder = folder_of(options, case.name, "interactions")
    with working_in(options, folder, STUDY, lambda: plan_interactions(case, request, **of_case)) as (_, compute):
        found = compute()
        end = last_line(found.result, "systems ", folder, found.save(folder))
        say("warning", found.warnings)
        present(options, found.as_json, _parts(found), end=end)
    failed = found.judgement.whole.record.error is not None
    return int(failed or (options.fail_unstable and not found.judgement.stable))


def _request(options: argparse.Namespace) -> InteractionsRequest:
    request = InteractionsRequest(**asked_by(options, InteractionsRequest))
    if request.swapped and not (request.swap or options.device):
        raise InputError("--place says where devices are swapped; give --swap or a --device as well")
    if options.binding and not options.device:
        raise InputError("--binding is of a --device; a converter of the case has its binding in the case file")
    found = devices_of(options.device, options.binding) if options.device else []
    devices = tuple(GivenDevice(one.name, as_device(one.file, one.binding), one.binding) for one in found)
    return replace(request, swap=request.swap or bool(devices), devices=devices)


def _parts(found: Interactions) -> Iterator[RenderableType]:
    judgement = found.judgement
    yield verdict_of(judgement).markup()
    yield from map(escape, found.sentences[1:])
    yield from ("", modes_table(judgement), "", systems_table(judgement), "")
    if found.result.plan.swapped:
        yield from (assignments_table(judgement), "")
