"""Where the points of a study are computed."""

from collections.abc import Sequence
from pathlib import Path

from orchestrator.cores import number_of_cores
from orchestrator.errors import InputError
from orchestrator.points.dask_cluster import DaskCluster
from orchestrator.points.executor import Executor
from orchestrator.points.processes import Processes
from orchestrator.points.serial import Serial


def choose_executor(
    workers: int | None, scheduler: str | None, imports: Sequence[str], tls: str | Path | None = None
) -> Executor:
    """Where the points are computed.

    Parameters
    ----------
    workers
        Number of processes on this machine; one for each core where None.
    scheduler
        Address of a Dask cluster, such as ``tcp://host:8786``; this machine where None.
    imports
        As `Processes` takes them.
    tls
        Folder with the certificates for the scheduler, as `DaskCluster` takes it.

    Raises
    ------
    InputError
        If the number of workers is below 1, there are workers beside a cluster, or certificates that are incomplete or
        that nothing uses.
    """
    if scheduler is not None:
        if workers not in (None, 1):
            raise InputError("workers and scheduler exclude each other; a Dask cluster brings its own workers")
        return DaskCluster(scheduler, None if tls is None else Path(tls))
    if tls is not None:
        raise InputError(f"--tls {tls}: certificates are for a Dask cluster; name its address with --scheduler")
    if workers is not None and (isinstance(workers, bool) or not isinstance(workers, int) or workers < 1):
        raise InputError(f"workers = {workers!r}; it must be a whole number of at least 1")
    workers = workers or number_of_cores()
    return Processes(workers, imports) if workers > 1 else Serial()
