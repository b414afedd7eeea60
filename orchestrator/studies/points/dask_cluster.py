"""Tasks on a Dask cluster, which may span many machines.

Scheduler, workers and client exchange pickled Python objects: each of them can have any program run by the others. TLS
with certificates of one's own authority keeps strangers out; it does not protect one member of the cluster from
another."""

import asyncio
import ipaddress
import logging
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from queue import Empty, SimpleQueue
from threading import Thread
from typing import Any
from urllib.parse import urlsplit

from fmus.toolchain.extras import require
from orchestrator.core.errors import CosimError, ErrorKind, InputError
from orchestrator.core.options import Option
from orchestrator.studies.points.lost_workers import ATTEMPTS, Result, Task, WorkerLostError

INTERVAL = 5.0  # seconds between two looks at the workers


class ClusterWatch:
    """The workers of one run.

    ``client``: of `distributed`.
    ``module``: of the tasks' function; a worker that cannot import it dies of the first task, and nobody says why.
    ``patience``: seconds without any worker after which the run ends."""

    def __init__(self, client: Any, address: str, module: str, patience: float) -> None:
        self._client, self._address, self._patience = client, address, patience
        # evaluated on a worker, which needs nothing of ours for it
        found = client.run(eval, f"bool(__import__({module!r}))", on_error="return")
        self.able = sorted(worker for worker, has in found.items() if has is True)
        self.unable = {
            worker: f" ({error})" for worker, error in sorted(found.items()) if error is not True
        }
        if found and not self.able:
            raise InputError(
                Option.SCHEDULER
                + f" {address}: none of its {len(found)} workers can import gfor-cosim"
                f"{next(iter(self.unable.values()))}; install it, in this version, where they "
                "run"
            )
        for worker, error in self.unable.items():
            _LOG.warning(
                (
                    Option.SCHEDULER
                    + " %s: worker %s cannot import gfor-cosim%s and is given nothing"
                ),
                address,
                worker,
                error,
            )
        self._known, self._errors = set(self.able), dict[str, str]()
        self._seen = self._looked = time.monotonic()

    def look(self) -> None:
        now = time.monotonic()
        if now - self._looked < INTERVAL:
            return
        self._looked = now
        workers = self._workers() - set(self.unable)
        for worker in sorted(self._known - workers):
            _LOG.warning(
                (Option.SCHEDULER + " %s: worker %s is lost%s; %s"),
                self._address,
                worker,
                self._last_error(worker),
                "others compute its points" if workers else "no other is there",
            )
        self._known = workers
        if workers:
            self._seen = now
            self._note_errors()
        elif now - self._seen > self._patience:
            errors = sorted({self._last_error(worker) for worker in self._errors})
            raise CosimError(
                (
                    Option.SCHEDULER
                    + f" {self._address}: no usable worker is left since {now - self._seen:.0f} s"
                    f"{(errors[0] if errors else '')}; points that were computed are kept. Start "
                    f"workers with `dask worker {self._address}`, and give the same command again"
                ),
                kind=ErrorKind.WORKER_LOST,
            )

    def _workers(self) -> set[str]:
        try:
            return set(self._client.nthreads())
        except Exception:  # whatever Dask raises where the scheduler does not answer
            return set()

    def _note_errors(self) -> None:
        try:
            logs = self._client.get_worker_logs(n=20)
        except Exception:  # a worker that dies now
            return
        for worker, lines in logs.items():
            for level, text in lines if isinstance(lines, list | tuple) else ():  # the newest first
                if level in ("ERROR", "CRITICAL"):
                    self._errors[worker] = text.strip().splitlines()[-1]
                    break

    def _last_error(self, worker: str) -> str:
        return f" (its last error: {self._errors[worker]})" if worker in self._errors else ""


_LOG = logging.getLogger("gfor")

TLS_FILES = ("ca.pem", "cert.pem", "key.pem")
"""In the folder with certificates: the authority's, the client's, and the client's private key."""

# longest time to wait for a scheduler, for its first worker, and for another one when all are lost
# [s]
_PATIENCE = 30


class DaskCluster:
    """Runs tasks on the workers of a Dask scheduler.

    ``address``: of the scheduler, such as ``tcp://host:8786`` or ``tls://host:8786``. Its workers need this project, in
    the same version.
    ``tls``: folder with the files of `TLS_FILES`, for an address with ``tls://``; where None, Dask's own configuration
    says where they are."""

    def __init__(self, address: str, tls: Path | None = None) -> None:
        self.address, self._tls = address, tls
        if tls is None:
            return
        if not address.startswith("tls://"):
            raise InputError(
                Option.SCHEDULER
                + f" {address}: "
                + Option.TLS
                + " needs an address that begins with tls://"
            )
        missing = [name for name in TLS_FILES if not (tls / name).is_file()]
        if missing:
            raise InputError(
                Option.TLS
                + f" {tls}: there is no {' and no '.join(missing)}; the folder must hold "
                f"{', '.join(TLS_FILES)}"
            )

    def run(
        self, function: Callable[[Task], Result], tasks: Sequence[Task]
    ) -> Iterator[tuple[int, Result | WorkerLostError]]:
        if not tasks:
            return
        distributed = _distributed()
        with _event_loop() as loop, self._client(distributed, loop) as client:
            watch = ClusterWatch(client, self.address, function.__module__, _PATIENCE)
            where = watch.able if watch.unable else None
            futures = [client.submit(function, task, pure=False, workers=where) for task in tasks]
            ready: SimpleQueue[int] = SimpleQueue()
            for index, future in enumerate(futures):
                future.add_done_callback(partial(_note, ready, index))
            try:
                for _ in futures:
                    index = _next(ready, watch)
                    yield index, self._result(distributed, futures[index])
                    futures[index].release()
            finally:
                client.cancel(futures)

    def close(self) -> None:
        """See `Executor.close`; the workers are the cluster's own."""

    def _client(self, distributed: Any, loop: Any) -> Any:
        if not (self.address.startswith("tls://") or _on_this_machine(self.address)):
            _LOG.warning(
                (
                    Option.SCHEDULER
                    + " %s: the connection is not encrypted and nobody is checked; whoever can "
                    "reach the scheduler can run programs on its workers and on this machine: "
                    "use tls:// and " + Option.TLS + " outside of a network of your own"
                ),
                self.address,
            )
        security = self._security(distributed)
        try:
            # A client that finds no scheduler is never closed, and waits for itself when it is collected.
            asyncio.run_coroutine_threadsafe(
                self._call(distributed, security), loop.asyncio_loop
            ).result()
            client = distributed.Client(
                self.address, timeout=_PATIENCE, set_as_default=False, security=security, loop=loop
            )
        except (
            OSError,
            ValueError,
            TypeError,
        ) as error:  # Dask's, in this order: no answer, address, certificates
            raise InputError(
                Option.SCHEDULER
                + f" {self.address}: no Dask scheduler answers there ({error}); start one with "
                "`dask scheduler`, and give its address, such as tcp://host:8786, or "
                "tls://host:8786 with " + Option.TLS
            ) from error
        try:
            client.wait_for_workers(1, timeout=_PATIENCE)
        except TimeoutError as error:
            client.close()
            raise InputError(
                Option.SCHEDULER
                + f" {self.address}: the scheduler has no workers; start some with `dask worker "
                f"{self.address}` where gfor-cosim is installed"
            ) from error
        return client

    async def _call(self, distributed: Any, security: Any) -> None:
        """Open a connection to the scheduler and close it."""
        arguments = security.get_connection_args("client")
        await (await distributed.comm.connect(self.address, timeout=_PATIENCE, **arguments)).close()

    def _security(self, distributed: Any) -> Any:
        """Dask's description of the certificates; where `tls` is None, of Dask's own configuration."""
        if self._tls is None:
            return distributed.Security()
        authority, certificate, key = (str(self._tls / name) for name in TLS_FILES)
        return distributed.Security(
            tls_ca_file=authority,
            tls_client_cert=certificate,
            tls_client_key=key,
            require_encryption=True,
        )

    def _result(self, distributed: Any, future: Any) -> Any:
        error = future.exception()
        if isinstance(error, distributed.KilledWorker):
            return WorkerLostError(
                f"its worker process died {ATTEMPTS} times (Dask: {error}); give the workers more memory, "
                "or try this point alone with `gfor modes`"
            )
        if isinstance(error, ImportError):
            raise InputError(
                Option.SCHEDULER
                + f" {self.address}: a worker cannot import what it needs ({error}); install "
                "gfor-cosim, in this version, where the workers run"
            ) from error
        return future.result()


def _note(ready: SimpleQueue[int], index: int, future: Any) -> None:
    ready.put(index)


def _next(ready: SimpleQueue[int], watch: ClusterWatch) -> int:
    """Index of the next task that is done; the workers are looked at meanwhile."""
    while True:
        watch.look()
        with suppress(Empty):
            return ready.get(timeout=INTERVAL)


@contextmanager
def _event_loop() -> Iterator[Any]:
    """Run the client's event loop in a thread, and end both.

    Dask's own gives up where its thread does not run within 10 s, as on a busy machine, and goes on after an address
    at which nothing answers."""
    from tornado.ioloop import IOLoop  # noqa: PLC0415 - of the extra `cluster`

    async def running() -> IOLoop:
        return IOLoop.current()

    loop = asyncio.new_event_loop()
    thread = Thread(target=loop.run_forever, name="gfor Dask client", daemon=True)
    thread.start()
    try:
        yield asyncio.run_coroutine_threadsafe(running(), loop).result()
    finally:
        loop.call_soon_threadsafe(loop.stop)
        thread.join()
        loop.close()


def _on_this_machine(address: str) -> bool:
    host = urlsplit(address).hostname or ""
    try:
        return host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:
        return address.startswith("inproc://")


def _distributed() -> Any:
    require(Option.SCHEDULER, "distributed")
    import distributed  # noqa: PLC0415 - of the extra `cluster`, and slow to import

    return distributed
