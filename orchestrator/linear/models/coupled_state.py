"""The state of the whole coupled system as one vector, and its step map as a function of it."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from orchestrator.core.arrays import Matrix
from orchestrator.linear.models.state_access import StateAccess
from orchestrator.systems.coupling.master import Master


class CoupledState:
    """The states of all components. A step can be tried from any state and taken back."""

    def __init__(self, master: Master) -> None:
        self._master = master
        self._access = {
            name: StateAccess(component) for name, component in master.components.items()
        }

    def read(self) -> Matrix:
        return np.concatenate([access.read() for access in self._access.values()])

    def write(self, x: Matrix) -> None:
        first = 0
        for access in self._access.values():
            last = first + len(access.batch.names)
            access.write(x[first:last])
            first = last
        self._master.before = None
        self.settle()

    def settle(self) -> None:
        """Exchange outputs until they stop changing; two passes do, unless feed-through is chained.

        Over a connection with a delay all arrives at once, as if it had long been so."""
        for _ in range(2):
            for name in [name for group in self._master.schedule.groups for name in group]:
                self._master.renew(name)

    def step_from(self, x: Matrix) -> Matrix:
        """States one communication step after ``x``; the system is put back where it was."""
        with self.put_back():
            self.write(x)
            self._master.advance(1)
            return self.read()

    @contextmanager
    def put_back(self) -> Iterator[None]:
        """On leaving ``with``, restore all FMUs, the coupled outputs and the clock."""
        saved, y, index = self._save()
        before = self._master.before
        wires = self._master.wires.state()
        try:
            with self._master.wires.quiet():
                yield
        finally:
            self._restore(saved, y, index)
            self._master.before = before
            self._master.wires.restore(wires)

    def _save(self) -> tuple[dict[str, Any], Matrix, int]:
        master = self._master
        return (
            {n: c.save_state() for n, c in master.components.items()},
            master.y.copy(),
            master.index,
        )

    def _restore(self, saved: dict[str, Any], y: Matrix, index: int) -> None:
        master = self._master
        for name, component in master.components.items():
            component.restore_state(saved[name])
            component.free_state(saved[name])
        master.y[:] = y
        master.index = index
