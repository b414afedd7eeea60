"""Where points are computed: the options ``--workers``, ``--scheduler`` and ``--tls``."""

import argparse
from collections.abc import Sequence

from orchestrator.asked import read_whole
from orchestrator.cli.arguments import option
from orchestrator.errors import InputError
from orchestrator.points import study
from orchestrator.points.executor import Executor


def add_executor_arguments(parser: argparse._ActionsContainer) -> None:
    option(parser, "--workers", "N", "processes to compute in (default: one a core)", read=read_whole(1, 1000))
    option(parser, "--scheduler", "ADDRESS", "compute on a Dask cluster, such as tcp://host:8786")
    option(parser, "--tls", "DIR", "folder with ca.pem, cert.pem, key.pem, for --scheduler tls://…")


def choose_executor(options: argparse.Namespace, imports: Sequence[str]) -> Executor:
    if options.scheduler is not None and options.workers is not None:
        raise InputError("--workers and --scheduler exclude each other; a Dask cluster brings its own workers")
    return study.choose_executor(options.workers, options.scheduler, imports, options.tls)
