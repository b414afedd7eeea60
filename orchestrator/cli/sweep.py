"""``gfor sweep``: from its options to points, files and words."""

import argparse
import json
from pathlib import Path

from rich.console import Console
from rich.markup import escape

from orchestrator.cases.case import load_case
from orchestrator.cli.arguments import frequency_range
from orchestrator.cli.case_arguments import add_case_arguments, parameters
from orchestrator.cli.executors import add_executor_arguments, choose_executor
from orchestrator.cli.terminal import made_folder, make_console, progress_bar
from orchestrator.distributed.executor import Executor
from orchestrator.report import sweep_tables
from orchestrator.report.sweep_dataset import Samples, save_sweep, sweep_json
from orchestrator.report.sweep_plots import save_sweep_plots
from orchestrator.study.point_store import PointStore
from orchestrator.study.sweep import SweepPlan, SweepResult, plan_sweep, run_sweep
from orchestrator.study.sweep_axes import Vary, parse_vary

_INTERRUPTED = 130


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
        "--range", type=frequency_range, default=(0.1, 2.0), metavar="LO:HI", help="frequencies [Hz] (0.1:2)"
    )
    add_executor_arguments(parser)
    parser.add_argument(
        "--out",
        type=Path,
        metavar="DIR",
        help="folder for results (default: results/<case>_sweep); points that are there are not computed again",
    )
    parser.add_argument("--json", action="store_true", help="print JSON")


def run(options: argparse.Namespace) -> int:
    """Plan, compute, write and print; returns 1 if no point has modes."""
    executor = choose_executor(options.workers, options.scheduler, ["orchestrator.study.point_worker"])
    case = load_case(options.case)
    values = {key: value for file in parameters(options) for key, value in file.values.items()} | dict(options.set)
    plan = plan_sweep(case, options.vary, options.scenario, values, options.step, options.range)
    folder = made_folder(options.out or Path("results") / f"{case.name}_sweep")
    console = make_console(stderr=options.json)
    result = _compute(plan, executor, folder, console)
    return _INTERRUPTED if result is None else _present(result, folder, console, as_json=options.json)


def _compute(plan: SweepPlan, executor: Executor, folder: Path, console: Console) -> SweepResult | None:
    """Run a sweep; None, with a word on how to continue, after Ctrl-C."""
    state = (0, plan.number_of_points)
    with progress_bar(console) as bar:
        task = bar.add_task("Points", total=None)

        def report(done: int, total: int) -> None:
            nonlocal state
            state = (done, total)
            bar.update(task, completed=done, total=total)

        try:
            return run_sweep(plan, executor, PointStore(folder / "points"), report)
        except KeyboardInterrupt:
            _errors().print(
                f"interrupted: {state[0]} of {state[1]} points are in {escape(str(folder))}; "
                "the same command continues from there"
            )
            return None
        finally:
            executor.close()


def _present(result: SweepResult, folder: Path, console: Console, *, as_json: bool) -> int:
    """Write a sweep's files and print its summary; returns 1 if no point has modes."""
    samples = Samples(result)
    save_sweep(samples, folder)
    plots = save_sweep_plots(samples, folder)
    if as_json:
        print(json.dumps(sweep_json(samples), indent=1, ensure_ascii=False))
    else:
        console.print(sweep_tables.trajectories(samples), "")
    for text in sweep_tables.remarks(samples):
        _errors().print(escape(text))
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


def _errors() -> Console:
    return Console(stderr=True, soft_wrap=True, highlight=False, emoji=False)
