"""The command ``gfor sweep``: from its options to points, files and words."""

import json
from collections.abc import Callable
from pathlib import Path

from rich.console import Console
from rich.markup import escape

from orchestrator.distributed.dask_cluster import DaskCluster
from orchestrator.distributed.executor import Executor
from orchestrator.distributed.processes import Processes, number_of_cores
from orchestrator.distributed.serial import Serial
from orchestrator.errors import InputError
from orchestrator.report import sweep_tables
from orchestrator.report.sweep_dataset import Samples, save_sweep, sweep_json
from orchestrator.report.sweep_plots import save_sweep_plots
from orchestrator.study.sweep import SweepPlan, SweepResult, run_sweep
from orchestrator.study.sweep_point import PointStore

INTERRUPTED = 130


def choose_executor(workers: int | None, scheduler: str | None) -> Executor:
    """Where the points are computed.

    Raises
    ------
    InputError
        If both a number of workers and a scheduler are given.
    """
    if scheduler is not None:
        if workers is not None:
            raise InputError("--workers and --scheduler exclude each other; a Dask cluster brings its own workers")
        return DaskCluster(scheduler)
    workers = workers or number_of_cores()
    return Processes(workers, ["orchestrator.study.point_worker"]) if workers > 1 else Serial()


def run(plan: SweepPlan, executor: Executor, folder: Path, report: Callable[[int, int], None]) -> SweepResult | None:
    """Run a sweep; None, with a word on how to continue, after Ctrl-C."""
    done = (0, plan.number_of_points)

    def progress(number: int, total: int) -> None:
        nonlocal done
        done = (number, total)
        report(number, total)

    try:
        return run_sweep(plan, executor, PointStore(folder / "points"), progress)
    except KeyboardInterrupt:
        _errors().print(
            f"interrupted: {done[0]} of {done[1]} points are in {escape(str(folder))}; "
            "the same command continues from there"
        )
        return None
    finally:
        executor.close()


def present(result: SweepResult, folder: Path, console: Console, *, as_json: bool) -> int:
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


def _errors() -> Console:
    return Console(stderr=True, soft_wrap=True, highlight=False, emoji=False)
