"""Process of an isolated FMU, which loads it within limits, then answers the mailbox; `supervisor` calls it."""

import ctypes
import itertools
import os
from dataclasses import astuple
from pathlib import Path
from typing import Any

from orchestrator.core.errors import ComponentError, CosimError, UnsupportedFmuError
from orchestrator.devices.fmi.binary import prototypes
from orchestrator.devices.fmi.component import Component
from orchestrator.devices.fmi.description import FmuDescription, read_description
from orchestrator.devices.fmi.instance import compile_adapters
from orchestrator.devices.fmi.loaded_component import LoadedComponent
from orchestrator.devices.fmi.messages import on_message
from orchestrator.devices.sandbox.access_restriction import Means, protections
from orchestrator.devices.sandbox.mailbox import DIED, OK, Mailbox
from orchestrator.devices.sandbox.resource_limits import Limits, apply_limits

_PASSED_ON = frozenset(
    (
        "setup",
        "enter_initialization_mode",
        "exit_initialization_mode",
        "progress_of_step",
        "reset",
        "set",
        "values",
    )
)
"""Commands that are methods of a component, whose answers are JSON's types."""


class Worker:
    """Answers until it is told to close, or its parent is gone."""

    def __init__(self, request: dict[str, Any]) -> None:
        folder = Path(request["folder"])
        self._request, self._parent = request, os.getppid() if hasattr(os, "getppid") else 0
        self._box = Mailbox(request["mailbox"])
        if isinstance(request["mailbox"], int):
            os.close(request["mailbox"])  # it is mapped by now
        limits = Limits(**request["limits"])
        self._description = self._described()
        compile_adapters(self._description)
        means = Means(**request["means"])
        lacking = apply_limits(limits, folder / "work", own_users=not means.namespaces)
        self._protections = protections(means, lacking)
        on_message(
            limits.messages,
            lambda: self._box.head.steps + self._box.head.request,
            self._box.write_log,
        )
        self._component: Component | None = None
        self._states: dict[int, Any] = {}
        self._next = itertools.count(1)

    def _described(self) -> FmuDescription:
        return read_description(self._request["fmu"])

    def serve(self) -> None:
        box = self._box
        while box.library.mailbox_serve(box.address, self._parent, *self._pointers()):
            command, *arguments = box.read_text()
            if command == "close":
                if self._component is not None:
                    self._component.close()
                box.write_text({})
                box.library.mailbox_answer(box.address, OK)
                # what an FMU registered for the end of the process is of no use to anyone
                os._exit(0)
            self._answer(command, arguments)
        os._exit(DIED)

    def _pointers(self) -> tuple[Any, ...]:
        component = self._component
        if component is None:
            return (None, None, None, None)
        functions = (component.set_real, component.get_real, component.do_step)
        return (component.pointer, *(ctypes.cast(f, ctypes.c_void_p) for f in functions))

    def _answer(self, command: str, arguments: list[Any]) -> None:
        function = (
            getattr(self._instance(), command)
            if command in _PASSED_ON
            else getattr(self, f"do_{command}")
        )
        try:
            answer = {"result": function(*arguments)}
        except ComponentError as error:
            answer = {"component_error": [error.call, error.status, error.log]}
        except UnsupportedFmuError as error:
            answer = {"unsupported": [error.evidence, error.fault, error.remedy]}
        except CosimError as error:
            answer = {"input_error": str(error)}
        except MemoryError:
            answer = {
                "component_error": [
                    "memory",
                    "memory limit",
                    "the FMU's process has no memory left",
                ]
            }
        try:
            self._box.write_text(answer)
        except ValueError as error:
            self._box.write_text({"component_error": ["answer", "too long", str(error)]})
        self._box.library.mailbox_answer(self._box.address, OK)

    def _instance(self) -> Component:
        assert self._component is not None
        return self._component

    def do_begin(self) -> list[tuple[str, bool, str]]:
        """Tell that from here on it is the FMU that takes time, and what keeps it from the rest of the machine."""
        return [astuple(protection) for protection in self._protections]

    def do_instantiate(self) -> None:
        if self._description.guid != self._request["guid"]:
            said = f"the guid {self._request['guid']} is not that of the FMU; read its description again"
            raise ComponentError(self._request["name"], "fmi2Instantiate", "no instance", said)
        directory = Path(self._request["directory"])
        self._component = LoadedComponent(self._request["name"], self._description, directory)

    def do_release(self) -> None:
        """Free the instance with its library and its saved states; the process goes on."""
        component, self._component = self._instance(), None
        self._states.clear()
        component.close()

    def do_jacobian(self, unknowns: list[str], knowns: list[str]) -> Any:
        return self._instance().jacobian(unknowns, knowns).tolist()

    def _keep_state(self, state: Any) -> int:
        number = next(self._next)
        self._states[number] = state
        return number

    def do_save_state(self) -> int:
        return self._keep_state(self._instance().save_state())

    def do_restore_state(self, number: int) -> None:
        self._instance().restore_state(self._states[number])

    def do_free_state(self, number: int) -> None:
        self._instance().free_state(self._states.pop(number))

    def do_serialize_state(self, number: int) -> str:
        return self._instance().serialize_state(self._states[number]).hex()

    def do_deserialize_state(self, content: str) -> int:
        return self._keep_state(self._instance().deserialize_state(bytes.fromhex(content)))


def prepare() -> None:
    """Do what all workers do alike, in the process of which they are copies."""
    prototypes()


def main(request: dict[str, Any]) -> None:
    Worker(request).serve()
