"""The process in which a foreign FMU is checked: it does what it is asked; `supervisor` calls it.

No check runs here and no verdict is made here: code of the FMU can change whatever is in its process."""

import ctypes
import gc
import os
import sys
from pathlib import Path
from typing import Any

from orchestrator.devices.acceptance.shifted_clock import shift_clock
from orchestrator.devices.fmi.binary import absent_functions, load, unload
from orchestrator.devices.fmi.bound_component import BoundComponent
from orchestrator.devices.fmi.component import Component
from orchestrator.devices.fmi.description import FmuDescription, runs_under_wine
from orchestrator.devices.fmi.instance import open_component
from orchestrator.devices.fmi.isolated_component_worker import Worker, prepare
from orchestrator.devices.fmi.loaded_component import LoadedComponent
from orchestrator.devices.fmi.port_mapping import BoundDescription, PortMap, without_binding
from orchestrator.devices.sandbox.mailbox import DIED, Served

_MALLINFO2 = [
    "arena",
    "ordblks",
    "smblks",
    "hblks",
    "hblkhd",
    "usmblks",
    "fsmblks",
    "uordblks",
    "fordblks",
    "keepcost",
]


class _MallocInfo(ctypes.Structure):
    _fields_ = tuple((name, ctypes.c_size_t) for name in _MALLINFO2)


def memory_in_use() -> int | None:
    """Bytes that are allocated now; the resident size where the C library does not tell, None where nothing does.

    Garbage of Python is freed before, so that it does not matter when Python would have done so."""
    gc.collect()
    try:
        info = ctypes.CDLL(None).mallinfo2
        info.restype = _MallocInfo
        now = info()
        # An interpreter keeps small objects in blocks of its own, which malloc does not see.
        return int(now.uordblks + now.hblkhd) + 32 * sys.getallocatedblocks()
    except (AttributeError, OSError, TypeError):
        pass
    if sys.platform == "linux":
        import resource  # noqa: PLC0415 - only where it exists

        return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize()
    return None


def open_files() -> int:
    """Files that this process has open; 0 where the platform does not tell."""
    try:
        return len(list(Path("/proc/self/fd").iterdir()))
    except OSError:
        return 0


_MOST = 256  # instances at the same time


class Host(Worker):
    """Answers for several instances, each under a number."""

    def __init__(self, request: dict[str, Any]) -> None:
        if request["clock_shift"]:
            shift_clock(request["clock_shift"])
        super().__init__(request)
        self._table = (Served * _MOST)()
        self._instances: dict[int, Component] = {}
        self._asked = 0

    def _described(self) -> FmuDescription:
        described, port = super()._described(), self._request["port"]
        return described if port is None else BoundDescription.of(described, PortMap.of_dict(port))

    def serve(self) -> None:
        """Answer the mailbox: runs in C, everything else here."""
        box = self._box
        while box.library.mailbox_host(box.address, self._parent, self._table, _MOST):
            self._asked, command, *arguments = box.read_text()
            self._answer(command, arguments)
        os._exit(DIED)

    def _instance(self) -> Component:
        return self._instances[self._asked]

    def do_open(self, name: str) -> int:
        component = open_component(
            name, self._description, Path(self._request["directory"]), isolated=False
        )
        number = next(n for n in range(_MOST) if n not in self._instances)
        self._instances[number] = component
        functions = (component.set_real, component.get_real, component.do_step)
        self._table[number] = Served(
            component.pointer, *(ctypes.cast(f, ctypes.c_void_p).value for f in functions)
        )
        return number

    def do_absent_functions(self) -> list[list[str]]:
        """Functions that the binary lacks: those that it needs by what it declares, and the others."""
        described = without_binding(self._description)
        if runs_under_wine(described):
            return [[], []]  # each call of one that is not there says so
        library = load(described, Path(self._request["directory"]))
        try:
            return list(absent_functions(described, library))
        finally:
            unload(library)

    def do_close(self, lost: bool) -> None:
        component = self._instances.pop(self._asked)
        self._table[self._asked] = Served()
        inner = component.inner if isinstance(component, BoundComponent) else component
        assert isinstance(inner, LoadedComponent)
        inner.lost = inner.lost or lost  # told here, as it was found out there
        component.close()

    def do_memory_in_use(self) -> int:
        gc.collect()
        return 0 if self._elsewhere() else memory_in_use() or 0

    def do_open_files(self) -> int:
        return 0 if self._elsewhere() else open_files()

    def _elsewhere(self) -> bool:
        """Return whether the FMU's code runs in a process under Wine, and nothing of it is seen in this one."""
        return runs_under_wine(without_binding(self._description))


__all__ = ["main", "prepare"]


def main(request: dict[str, Any]) -> None:
    Host(request).serve()
