"""All connections of a running system that do more than carry a value."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray

from orchestrator.core.errors import InputError
from orchestrator.systems.coupling.connections import Endpoint
from orchestrator.systems.coupling.imperfections import Imperfection
from orchestrator.systems.coupling.schedule import Schedule
from orchestrator.systems.coupling.system import System
from orchestrator.systems.coupling.wire_bank import STRETCH, WireBank


class Wires:
    """Banks of such connections, one before each group that they lead into.

    ``values``: y, and behind it a place for what arrives over each of these connections."""

    def __init__(
        self,
        system: System,
        schedule: Schedule,
        step_size: float,
        output_index: Mapping[Endpoint, int],
        values: NDArray[np.float64],
    ) -> None:
        if system.wires and not schedule.is_plain:
            names = ", ".join(plan.name for plan in system.wires.values())
            raise InputError(
                f"schedule {schedule.name!r} hands values over in a way of its own, so that connections cannot be "
                f"disturbed in it ({names}); take gauss-seidel or jacobi, or leave the imperfections out"
            )
        sources = {c.target: c.source for c in system.connections}
        self._y = values[: len(output_index)]
        self.banks: list[WireBank | None] = []
        self._place: dict[Endpoint, tuple[WireBank, int]] = {}
        self.delivered: dict[Endpoint, int] = {}
        first = len(output_index)
        for group in schedule.groups:
            targets = [target for target in system.wires if target.component in group]
            window = slice(first, first + len(targets))
            index = np.array([output_index[sources[target]] for target in targets], dtype=np.int64)
            plans = [system.wires[target] for target in targets]
            bank = WireBank(plans, step_size, index, values[window], window) if targets else None
            self.banks.append(bank)
            for k, target in enumerate(targets):
                if bank is not None:
                    self._place[target] = bank, k
                self.delivered[target] = first + k
            first = window.stop

    def __bool__(self) -> bool:
        return bool(self._place)

    @property
    def _present(self) -> list[WireBank]:
        return [bank for bank in self.banks if bank is not None]

    def settle(self, *, first: bool = False) -> None:
        for bank in self._present:
            bank.settle(self._y, first=first)

    def stretches(self, index: int, count: int) -> Iterator[tuple[int, int]]:
        """Index and number of steps of parts for which the noise is ready when they are asked for."""
        while count > 0:
            part = min(count, STRETCH)
            for bank in self._present:
                bank.prepare(index, part)
            yield index, part
            index, count = index + part, count - part

    def begin(self, target: Endpoint, imperfection: Imperfection) -> None:
        bank, k = self._place_of(target)
        bank.begin(k, imperfection)

    def end(self, target: Endpoint, kind: type[Imperfection]) -> None:
        """From now on the connection into ``target`` is as its permanent settings have it."""
        bank, k = self._place_of(target)
        bank.end(k, kind)

    def _place_of(self, target: Endpoint) -> tuple[WireBank, int]:
        if target not in self._place:
            raise InputError(
                f"the connection into {target} was to be disturbed, but the system does not foresee it; announce it "
                "with System.foresee before the run"
            )
        return self._place[target]

    @contextmanager
    def quiet(self) -> Iterator[None]:
        """Inside, noise and quantisation are left out: they have no place in a steady state or a linear model."""
        before = [bank.quiet for bank in self._present]
        try:
            for bank in self._present:
                bank.quiet = True
            yield
        finally:
            for bank, value in zip(self._present, before, strict=True):
                bank.quiet = value

    def state(self) -> Sequence[dict[str, NDArray[np.float64]]]:
        """Delay lines, noise generators and settings, a dictionary of arrays for each group that has any."""
        return [bank.state() for bank in self._present]

    def restore(self, state: Sequence[Mapping[str, NDArray[np.float64]]]) -> None:
        for bank, own in zip(self._present, state, strict=True):
            bank.restore(dict(own))
