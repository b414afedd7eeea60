"""Whether a Dask cluster can still compute: its workers have this project, and some are left."""

import logging
import time
from typing import Any

from orchestrator.errors import CosimError, ErrorKind, InputError

_LOG = logging.getLogger("gfor")
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
        self.unable = {worker: f" ({error})" for worker, error in sorted(found.items()) if error is not True}
        if found and not self.able:
            raise InputError(
                f"--scheduler {address}: none of its {len(found)} workers can import gfor-cosim"
                f"{next(iter(self.unable.values()))}; install it, in this version, where they run"
            )
        for worker, error in self.unable.items():
            _LOG.warning(
                "--scheduler %s: worker %s cannot import gfor-cosim%s and is given nothing", address, worker, error
            )
        self._known, self._errors = set(self.able), dict[str, str]()
        self._seen = self._looked = time.monotonic()

    def look(self) -> None:
        """Tell which workers are lost."""
        now = time.monotonic()
        if now - self._looked < INTERVAL:
            return
        self._looked = now
        workers = self._workers() - set(self.unable)
        for worker in sorted(self._known - workers):
            _LOG.warning(
                "--scheduler %s: worker %s is lost%s; %s", self._address, worker, self._last_error(worker),
                "others compute its points" if workers else "no other is there",
            )  # fmt: skip
        self._known = workers
        if workers:
            self._seen = now
            self._note_errors()
        elif now - self._seen > self._patience:
            errors = sorted({self._last_error(worker) for worker in self._errors})
            raise CosimError(
                f"--scheduler {self._address}: no usable worker is left since {now - self._seen:.0f} s"
                f"{errors[0] if errors else ''}; points that were computed are kept. Start workers with "
                f"`dask worker {self._address}`, and give the same command again",
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
