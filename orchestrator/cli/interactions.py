"""``gfor interactions``: which modes several vendors' converters share, and which pair of them does not agree."""

import argparse
import json
from pathlib import Path

from rich.console import Console
from rich.markup import escape

from orchestrator.api.interactions import WORKERS_IMPORT, Interactions, compute
from orchestrator.cases.case import load_case
from orchestrator.certification.devices import devices_of
from orchestrator.cli.arguments import frequency_range
from orchestrator.cli.case_arguments import add_case_arguments, parameters, values_set
from orchestrator.cli.executors import add_executor_arguments, choose_executor
from orchestrator.cli.interrupted import saying_how_it_goes_on
from orchestrator.cli.points import Progressing
from orchestrator.cli.terminal import make_console, make_errors, print_questions
from orchestrator.cli.verdict import add_verdict_argument
from orchestrator.errors import InputError
from orchestrator.fmi.devices import as_device
from orchestrator.interactions import tables
from orchestrator.interactions.request import RANGE_HZ, THRESHOLD, GivenDevice, InteractionsRequest
from orchestrator.interactions.study import plan_interactions
from orchestrator.interactions.words import verdict_of
from orchestrator.results.lock import held
from orchestrator.safe_files import made_folder


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_case_arguments(parser, several=False)
    parser.add_argument(
        "--threshold",
        type=_share,
        default=THRESHOLD,
        metavar="PERCENT",
        help="share of a mode from which on a vendor takes part in it (default: 5)",
    )
    parser.add_argument(
        "--range", type=frequency_range, default=RANGE_HZ, metavar="LO:HI", help="frequencies [Hz] (default: 0.1:100)"
    )
    parser.add_argument(
        "--stand-in",
        metavar="MODEL",
        help="model at the places of the vendors that a system does without (default: static_generation, a current "
        "without dynamics; gfor is the reference converter)",
    )
    parser.add_argument("--swap", action="store_true", help="each vendor's device at each place, in all ways")
    parser.add_argument(
        "--device",
        action="append",
        default=[],
        metavar="[NAME=]FILE",
        help="try this FMU or DLL at the places as well; it implies --swap (repeatable)",
    )
    parser.add_argument(
        "--binding", action="append", default=[], metavar="[NAME=]FILE", help="binding of a --device (repeatable)"
    )
    parser.add_argument(
        "--place", action="append", default=[], metavar="COMPONENT", help="swap only at this place (repeatable)"
    )
    parser.add_argument(
        "--black-box",
        action="store_true",
        help="identify the components that hide their states from their inputs and outputs",
    )
    add_executor_arguments(parser)
    parser.add_argument(
        "--out",
        type=Path,
        metavar="DIR",
        help="folder for results (default: results/<case>_interactions); systems that are there are not computed again",
    )
    parser.add_argument("--json", action="store_true", help="print JSON")
    add_verdict_argument(parser)


def run(options: argparse.Namespace) -> int:
    """Plan, compute, write and print; returns 1 if the system as it is has no modes."""
    if len(options.scenario) > 1:
        raise InputError("--scenario: interactions are those of one scenario; start the command once for each")
    executor = choose_executor(options, WORKERS_IMPORT)
    case = load_case(options.case, trust_fmus=options.trust_fmus)
    planned = plan_interactions(
        case,
        _request(options),
        options.scenario[0] if options.scenario else None,
        values_set(options),
        options.step,
        parameters(options),
    )
    print_questions([planned.prepared], as_json=options.json)
    folder = made_folder(options.out or Path("results") / f"{case.name}_interactions", "--out")
    progress, console = Progressing(folder), make_console(stderr=options.json)
    with saying_how_it_goes_on(progress.how_it_goes_on), held(folder):
        found = progress.compute(lambda report: compute(planned, executor, folder, report), executor, console)
        _present(found, folder, console, as_json=options.json)
    failed = found.judgement.whole.record.error is not None
    return int(failed or (options.fail_unstable and not found.judgement.stable))


def _share(text: str) -> float:
    """A share of a mode [%], as a ratio; a bare number below 1 looks like a ratio and is refused."""
    try:
        number = float(text.removesuffix("%"))
    except ValueError:
        number = float("nan")
    if not 0 < number <= 50 or (number < 1 and not text.endswith("%")):
        raise argparse.ArgumentTypeError(f"{text!r} is not a share in percent up to 50, such as 5 (or 0.5% below 1)")
    return number / 100


def _request(options: argparse.Namespace) -> InteractionsRequest:
    swap = bool(options.swap or options.device)
    if options.place and not swap:
        raise InputError("--place says where devices are swapped; give --swap or a --device as well")
    if options.binding and not options.device:
        raise InputError("--binding is of a --device; a converter of the case has its binding in the case file")
    devices = devices_of(options.device, options.binding) if options.device else []
    given = tuple(
        GivenDevice(device.name, as_device(device.file, device.binding), device.binding) for device in devices
    )
    return InteractionsRequest(
        options.threshold, options.range, options.stand_in, swap, given, tuple(options.place), options.black_box
    )


def _present(found: Interactions, folder: Path, console: Console, *, as_json: bool) -> None:
    written, result, judgement = found.save(folder), found.result, found.judgement
    for text in found.warnings:
        make_errors().print(f"[bold yellow]warning:[/bold yellow] {escape(text)}")
    if as_json:
        print(json.dumps(found.as_json(), indent=1, ensure_ascii=False))
        return
    console.print(verdict_of(judgement).markup(), soft_wrap=True, highlight=False)
    for text in found.sentences[1:]:
        console.print(escape(text), soft_wrap=True, highlight=False)
    console.print("", tables.modes_table(judgement), "", tables.systems_table(judgement), "")
    if result.plan.swapped:
        console.print(tables.assignments_table(judgement), "")
    stored = f", {result.stored} were there already" if result.stored else ""
    files = ", ".join(path.name for path in written)
    words = f"{result.computed} systems computed{stored}. Results in {folder}: {files}"
    console.print(escape(words), soft_wrap=True)
