"""Tasks on a Dask cluster, which may span many machines."""

from collections.abc import Callable, Iterator, Sequence
from typing import Any

from fmus.toolchain.extras import require
from orchestrator.errors import InputError
from orchestrator.points.executor import ATTEMPTS, Result, Task, WorkerLostError

_PATIENCE = 30
"""How long is waited for a scheduler and for its first worker [s]."""


class DaskCluster:
    """Runs tasks on the workers of a Dask scheduler.

    Parameters
    ----------
    address
        Of the scheduler, such as ``tcp://host:8786``. Its workers need this project, in the same version.
    """

    def __init__(self, address: str) -> None:
        self.address = address

    def run(
        self, function: Callable[[Task], Result], tasks: Sequence[Task]
    ) -> Iterator[tuple[int, Result | WorkerLostError]]:
        """See `Executor.run`."""
        if not tasks:
            return
        distributed = _distributed()
        with self._client(distributed) as client:
            futures = [client.submit(function, task, pure=False) for task in tasks]
            index_of = {future.key: index for index, future in enumerate(futures)}
            try:
                for future in distributed.as_completed(futures, loop=client.loop):
                    yield index_of[future.key], self._result(distributed, future)
                    future.release()
            finally:
                client.cancel(futures)

    def close(self) -> None:
        """See `Executor.close`; the workers are the cluster's own."""

    def _client(self, distributed: Any) -> Any:
        try:
            client = distributed.Client(self.address, timeout=_PATIENCE, set_as_default=False)
        except (OSError, ValueError) as error:
            raise InputError(
                f"--scheduler {self.address}: no Dask scheduler answers there ({error}); start one with "
                "`dask scheduler`, and give its address, such as tcp://host:8786"
            ) from error
        try:
            client.wait_for_workers(1, timeout=_PATIENCE)
        except TimeoutError as error:
            client.close()
            raise InputError(
                f"--scheduler {self.address}: the scheduler has no workers; start some with "
                f"`dask worker {self.address}` where gfor-cosim is installed"
            ) from error
        return client

    def _result(self, distributed: Any, future: Any) -> Any:
        error = future.exception()
        if isinstance(error, distributed.KilledWorker):
            return WorkerLostError(
                f"its worker process died {ATTEMPTS} times (Dask: {error}); give the workers more memory, "
                "or try this point alone with `gfor modes`"
            )
        if isinstance(error, ImportError):
            raise InputError(
                f"--scheduler {self.address}: a worker cannot import what it needs ({error}); install gfor-cosim, "
                "in this version, where the workers run"
            ) from error
        return future.result()


def _distributed() -> Any:
    require("--scheduler", "distributed")
    import distributed  # noqa: PLC0415 - of the extra `cluster`, and slow to import

    return distributed
