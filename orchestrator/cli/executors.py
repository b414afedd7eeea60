"""Where points are computed: the options ``--workers`` and ``--scheduler``."""

import argparse
from collections.abc import Sequence

from orchestrator.cli.arguments import count
from orchestrator.errors import InputError
from orchestrator.points.dask_cluster import DaskCluster
from orchestrator.points.executor import Executor
from orchestrator.points.processes import Processes, number_of_cores
from orchestrator.points.serial import Serial


def add_executor_arguments(parser: argparse.ArgumentParser) -> None:
    """Both options."""
    parser.add_argument("--workers", type=count, metavar="N", help="processes to compute in (default: one a core)")
    parser.add_argument("--scheduler", metavar="ADDRESS", help="compute on a Dask cluster, such as tcp://host:8786")


def choose_executor(workers: int | None, scheduler: str | None, imports: Sequence[str]) -> Executor:
    """Where the points are computed.

    Parameters
    ----------
    imports
        As `Processes` takes them.

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
    return Processes(workers, imports) if workers > 1 else Serial()
