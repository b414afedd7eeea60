"""``gfor sweep``: from its options to points, files and words."""

import argparse
import json
from pathlib import Path

from rich.console import Console
from rich.markup import escape

from orchestrator.analysis.modes import ELECTROMECHANICAL_HZ
from orchestrator.cases.case import load_case
from orchestrator.cli.arguments import frequency_range
from orchestrator.cli.case_arguments import add_case_arguments, parameters
from orchestrator.cli.executors import add_executor_arguments, choose_executor
from orchestrator.cli.points import compute_points
from orchestrator.cli.terminal import made_folder, make_console, make_errors, print_questions
from orchestrator.cli.verdict import add_verdict_argument
from orchestrator.errors import INTERRUPTED
from orchestrator.points.store import PointStore
from orchestrator.sweep import tables
from orchestrator.sweep.axes import Vary, parse_vary
from orchestrator.sweep.dataset import Samples, save_sweep, sweep_json
from orchestrator.sweep.plots import save_sweep_plots
from orchestrator.sweep.sweep import SweepResult, plan_sweep, run_sweep


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``gfor sweep``."""
    add_case_arguments(parser)
    parser.add_argument(
        "--vary",
        action="append",
        required=True,
        type=_vary,
        metavar="COMPONENT.PARAMETER=START:STOP:COUNT",
        help="what to vary; also =log:START:STOP:COUNT and =0.1,0.2,0.5 (repeatable: a full grid, followed along the "
        "last one)",
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
    executor = choose_executor(options.workers, options.scheduler, ["orchestrator.sweep.worker"])
    case = load_case(options.case)
    values = {key: value for file in parameters(options) for key, value in file.values.items()} | dict(options.set)
    plan = plan_sweep(case, options.vary, options.scenario, values, options.step, options.range)
    print_questions(plan.scenarios)
    folder = made_folder(options.out or Path("results") / f"{case.name}_sweep")
    console = make_console(stderr=options.json)
    store = PointStore(folder / "points")
    result = compute_points(lambda report: run_sweep(plan, executor, store, report), executor, folder, console)
    if result is None:
        return INTERRUPTED
    failed = _present(result, folder, console, as_json=options.json)
    return failed or int(options.fail_unstable and not all(s.stable for s in result.scenarios))


def _present(result: SweepResult, folder: Path, console: Console, *, as_json: bool) -> int:
    """Write a sweep's files and print its summary; returns 1 if no point has modes."""
    samples = Samples(result)
    save_sweep(samples, folder)
    plots = save_sweep_plots(samples, folder)
    if as_json:
        print(json.dumps(sweep_json(samples), indent=1, ensure_ascii=False))
    else:
        for line in tables.stability(samples):
            console.print(line, soft_wrap=True, highlight=False)
        console.print("", tables.trajectories(samples), "")
    for text in tables.remarks(samples):
        make_errors().print(escape(text))
    if not as_json:
        stored = f", {result.stored} were there already" if result.stored else ""
        files = ", ".join(["sweep.nc", "sweep.csv", *(path.name for path in plots)])
        words = f"{result.computed} points computed{stored}. Results in {folder}: {files}"
        console.print(escape(words), soft_wrap=True)
    return 0 if any(s.trajectories for s in result.scenarios) else 1


def _vary(text: str) -> Vary:
    try:
        return parse_vary(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from error
