"""``gfor sweep``: from its options to points, files and words."""

import argparse
import json
from pathlib import Path

from rich.console import Console
from rich.markup import escape

from orchestrator.analysis.modes import ELECTROMECHANICAL_HZ
from orchestrator.api.sweep import WORKERS_IMPORT, ParameterSweep, compute, plan
from orchestrator.cases.case import Case, load_case
from orchestrator.cli.arguments import frequency_range
from orchestrator.cli.case_arguments import add_case_arguments, values_set
from orchestrator.cli.executors import add_executor_arguments, choose_executor
from orchestrator.cli.interrupted import saying_how_it_goes_on
from orchestrator.cli.points import Progressing
from orchestrator.cli.terminal import make_console, make_errors, print_questions
from orchestrator.cli.verdict import add_verdict_argument
from orchestrator.errors import InputError
from orchestrator.points.executor import Executor
from orchestrator.results.lock import held
from orchestrator.safe_files import made_folder
from orchestrator.sweep import tables
from orchestrator.sweep.axes import Vary, parse_vary
from orchestrator.sweep.limit import Ending


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_case_arguments(parser)
    parser.add_argument(
        "--vary",
        action="append",
        default=[],
        type=_vary,
        metavar="COMPONENT.PARAMETER=START:STOP:COUNT",
        help="what to vary; also =log:START:STOP:COUNT and =0.1,0.2,0.5 (repeatable: a full grid, followed along the "
        "last one); several together: 'grid.X_a,grid.X_b=…', 'grid.X_line_7_*=…', 'line_7_9,line_8_9: length=1:4:7'",
    )
    parser.add_argument("--scr", action="append", dest="vary", type=_scr, metavar="BUS=START:STOP:COUNT", help="SCR of "
                        "the converters at a bus, or its short-circuit power ('bus_9=3000 MVA:800 MVA:5'): R and X of "
                        "all branches that end there are multiplied")  # fmt: skip
    parser.add_argument(
        "--until",
        metavar="unstable|PERCENT",
        help="how far the range START:STOP may go before the system is unstable, or a mode of --range is damped less "
        "than so many percent: coarse grid (COUNT, 9), then bisection",
    )
    parser.add_argument(
        "--range", type=frequency_range, default=ELECTROMECHANICAL_HZ, metavar="LO:HI", help="frequencies [Hz] (0.1:2)"
    )
    add_executor_arguments(parser)
    parser.add_argument(
        "--out",
        type=Path,
        metavar="DIR",
        help="folder for results (default: results/<case>_sweep); points that are there are not computed again",
    )
    parser.add_argument("--json", action="store_true", help="print JSON")
    add_verdict_argument(parser)


def run(options: argparse.Namespace) -> int:
    """Plan, compute, write and print; returns 1 if no point has modes."""
    if not options.vary:
        raise InputError("nothing is varied; give --vary, such as --vary grid.X_L=0.1:0.5:9, or --scr bus_9=5:1.2:5")
    executor = choose_executor(options, WORKERS_IMPORT)
    case = load_case(options.case, trust_fmus=options.trust_fmus)
    folder = options.out or Path("results") / f"{case.name}_sweep"
    progress = Progressing(folder)
    with saying_how_it_goes_on(progress.how_it_goes_on):
        return _sweep(case, folder, progress, executor, options)


def _sweep(case: Case, folder: Path, progress: Progressing, executor: Executor, options: argparse.Namespace) -> int:
    """See `run`."""
    planned = plan(
        case,
        options.vary,
        options.scenario,
        values_set(options),
        step=options.step,
        parameters=options.parameters,
        frequencies=options.range,
        until=options.until,
    )
    print_questions(planned.scenarios, as_json=options.json)
    made_folder(folder, "--out")
    console = make_console(stderr=options.json)
    with held(folder):
        sweep = progress.compute(lambda report: compute(planned, executor, folder, report), executor, console)
        failed = _present(sweep, folder, console, as_json=options.json)
    held_up = all(x.kind is Ending.HOLDS for x in sweep.limits) and all(s.stable for s in sweep.result.scenarios)
    return failed or int(options.fail_unstable and not held_up)


def _present(sweep: ParameterSweep, folder: Path, console: Console, *, as_json: bool) -> int:
    """Write a sweep's files and print its summary; returns 1 if no point has modes."""
    written, result = sweep.save(folder), sweep.result
    if as_json:
        print(json.dumps(sweep.as_json(), indent=1, ensure_ascii=False))
    else:
        for line in tables.limits(sweep.samples) or tables.stability(sweep.samples):
            console.print(line, soft_wrap=True, highlight=False)
        console.print("", tables.trajectories(sweep.samples), "")
    for text in sweep.remarks:
        make_errors().print(escape(text))
    if not as_json:
        stored = f", {result.stored} were there already" if result.stored else ""
        files = ", ".join(path.name for path in written)
        words = f"{result.computed} points computed{stored}. Results in {folder}: {files}"
        console.print(escape(words), soft_wrap=True)
    return 0 if any(s.trajectories for s in result.scenarios) else 1


def _scr(text: str) -> Vary:
    bus, equals, values = text.partition("=")
    return _vary(f"{bus}: scr{equals}{values}")


def _vary(text: str) -> Vary:
    try:
        return parse_vary(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from error
