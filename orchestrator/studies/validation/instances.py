"""An instance of a device between its runs: unpacking and loading an FMU takes as long as seconds of a recording."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from orchestrator.devices.fmi.component import Component
from orchestrator.devices.fmi.description import FmuDescription
from orchestrator.devices.fmi.instance import is_ours, open_component


class InstanceShelf:
    """Instances that go back to their start instead of being opened anew, between `keeping` and its end.

    Only one of our own FMUs does: that `fmi2Reset` leaves nothing of a run behind is tested for these alone."""

    def __init__(self) -> None:
        self._free: dict[int, Component] = {}
        self._keeps = 0

    @contextmanager
    def keeping(self) -> Iterator[None]:
        """Inside ``with``, instances are kept; at the end of the outermost one they are closed."""
        self._keeps += 1
        try:
            yield
        finally:
            self._keeps -= 1
            if not self._keeps:
                while self._free:
                    self._free.popitem()[1].close()

    @contextmanager
    def instance(self, description: FmuDescription, isolated: bool | None) -> Iterator[Component]:
        """An instance at its start; one that failed is not used again.

        ``isolated``: as in `open_component`."""
        component = self._free.pop(id(description), None)
        if component is None:
            component = open_component("device", description, isolated=isolated)
        else:
            component.reset()
        try:
            yield component
        except BaseException:
            component.close()
            raise
        if self._keeps and not isolated and is_ours(description.path):
            self._free[id(description)] = component
        else:
            component.close()
