"""A component of ours as a federate: the process that `federation` starts, and that `gfor master federate` is.

It steps one FMU, which runs in a process of its own: the libraries of HELICS and those of an FMU that share a process
can stop each other, as a Python-backed FMU showed that was loaded after them. Numbers come and go as values of HELICS.
What is more than numbers (its set-up, its state, events) comes as commands of HELICS, which need no time to pass."""

import base64
import ctypes
import json
import os
import pickle
import sys
import threading
import traceback
from collections.abc import Callable
from contextlib import suppress
from importlib.metadata import version
from typing import Any

from orchestrator.core.errors import ComponentError, CosimError, InputError
from orchestrator.devices.fmi.component import Component, RealBatch
from orchestrator.devices.fmi.description import FmuDescription
from orchestrator.devices.fmi.instance import open_component
from orchestrator.simulation.federation import helics_calls
from orchestrator.simulation.federation.choice import OVER, PROTOCOL


class OwnFederate:
    """An FMU that steps when HELICS grants it time."""

    def __init__(self, name: str, description: FmuDescription, broker: str, to_join: float) -> None:
        self.name, self._description, self._broker, self._to_join = (
            name,
            description,
            broker,
            to_join,
        )
        self._lock, self._configured = threading.Lock(), threading.Event()
        self._ended = False
        self._setting: dict[str, Any] = {}
        self._component: Component | None = None

    def run(self) -> None:
        helics = helics_calls.library()
        with open_component(self.name, self._description, isolated=True) as component:
            self._component = component
            try:
                self._federate = helics_calls.join(self.name, self._broker, self._to_join)
            except helics.HelicsException as error:
                raise InputError(
                    f"broker {self._broker} does not take the federate {self.name!r}: {helics_calls.text_of(error)}; "
                    "look whether it runs there, and whether the name is taken"
                ) from error
            self._register()
            threading.Thread(target=self._listen, daemon=True).start()
            try:
                helics.helicsFederateEnterExecutingMode(self._federate)
                self._configured.wait()
                self._steps()
            except helics.HelicsException as error:
                if OVER in helics_calls.text_of(error):
                    return
                raise ComponentError(
                    self.name, "the federation", "an end", helics_calls.text_of(error)
                ) from error
            with suppress(helics.HelicsException):
                helics.helicsFederateDisconnect(self._federate)

    def abandon(self) -> None:
        """Free the FMU while another thread waits for HELICS."""
        component = self._component
        if component is not None and self._lock.acquire(timeout=1.0):
            component.close()

    def _register(self) -> None:
        variables = self._description.variables
        outputs = [v for v in self._description.outputs if variables[v].type == "Real"]
        self._outputs = [
            helics_calls.publication(self._federate, f"{self.name}.{v}", variables[v].unit)
            for v in outputs
        ]
        self._inputs = {
            v: helics_calls.optional_subscription(
                self._federate, f"{self.name}.{v}", variables[v].unit
            )
            for v in self._description.inputs
            if variables[v].type == "Real"
        }
        self._fault = helics_calls.text_publication(
            self._federate, f"{self.name}/{helics_calls.FAULT_MARK}"
        )
        helics_calls.text_publication(self._federate, f"{self.name}/{helics_calls.OURS_MARK}")
        self._read = RealBatch(self._fmu(), outputs)

    def _fmu(self) -> Component:
        assert self._component is not None
        return self._component

    def _steps(self) -> None:
        helics = helics_calls.library()
        period, offset = self._setting["period"], self._setting["offset"]
        step_size: float = self._setting["step_size"]
        handles = [self._inputs[v] for v in self._setting["inputs"]]
        written = RealBatch(self._fmu(), self._setting["inputs"])
        index = 0
        while True:
            wanted = index * period + offset
            granted = helics.helicsFederateRequestTime(self._federate, wanted * 1e-9)
            if self._ended or round(granted * 1e9) != wanted:
                return  # gfor has left
            written.values[:] = [helics.helicsInputGetDouble(handle) for handle in handles]
            try:
                with self._lock:
                    written.write()
                    self._fmu().step(index * step_size, step_size)
                    values = self._read.read().tolist()
            except CosimError as error:
                helics.helicsPublicationPublishString(self._fault, str(error))
                values = []
            for handle, value in zip(self._outputs, values, strict=False):
                helics.helicsPublicationPublishDouble(handle, value)
            index += 1

    def _listen(self) -> None:
        helics = helics_calls.library()
        try:
            while True:
                text = helics.helicsFederateWaitCommand(self._federate)
                source = helics.helicsFederateGetCommandSource(self._federate)
                if text.startswith("{"):
                    helics.helicsFederateSendCommand(
                        self._federate, source, json.dumps(self._answer(text))
                    )
        except helics.HelicsException:
            return  # the federation is over, as the main thread hears

    def _answer(self, text: str) -> dict[str, Any]:
        asked = json.loads(text)
        function: Callable[..., Any] | None = getattr(self, f"do_{asked['command']}", None)
        if function is None:
            return {
                "number": asked["number"],
                "error": f"it does not know the command {asked['command']!r}",
            }
        try:
            with self._lock:
                return {"number": asked["number"], "result": function(*asked["arguments"])}
        except CosimError as error:
            return {"number": asked["number"], "error": str(error)}

    def do_hello(self) -> dict[str, Any]:
        return {
            "protocol": PROTOCOL,
            "version": version("gfor-cosim"),
            "guid": self._description.guid,
        }

    def do_configure(self, setting: dict[str, Any]) -> None:
        self._setting = setting

    def do_begin(self) -> None:
        self._configured.set()

    def do_end(self) -> None:
        self._ended = True

    def do_replay(self, calls: list[list[Any]]) -> None:
        for command, *arguments in calls:
            if command in ("set_real", "get_real"):
                references, values = arguments
                self._real(command, references, values)
            else:
                getattr(self._fmu(), command)(*arguments)

    def do_state(self, content: str) -> None:
        """Take a state, as base64."""
        state = self._fmu().deserialize_state(base64.b64decode(content))
        self._fmu().restore_state(state)
        self._fmu().free_state(state)

    def do_get(self, references: list[int], values: list[list[Any]]) -> list[float]:
        if values:
            self._real("set_real", [r for r, _ in values], [x for _, x in values])
        return self._real("get_real", references, [0.0] * len(references))

    def do_set(self, values: dict[str, float | bool]) -> None:
        self._fmu().set(values)

    def do_values(self, names: list[str]) -> dict[str, float | bool]:
        return self._fmu().values(names)

    def _real(self, command: str, references: list[int], values: list[float]) -> list[float]:
        n = len(references)
        where, numbers = (ctypes.c_uint * n)(*references), (ctypes.c_double * n)(*values)
        function = getattr(self._fmu(), command)
        status = function(
            self._fmu().pointer, ctypes.addressof(where), n, ctypes.addressof(numbers)
        )
        self._fmu().check(status, "fmi2SetReal" if command == "set_real" else "fmi2GetReal")
        return list(numbers)


def _end_with_parent(federate: OwnFederate) -> None:
    while sys.stdin.buffer.read(4096):
        pass
    federate.abandon()
    os._exit(1)


def main() -> None:
    """Be the federate that the pickled request on standard input asks for: it is from the process that started this."""
    length = int(sys.stdin.buffer.readline())
    federate = OwnFederate(*pickle.loads(sys.stdin.buffer.read(length)))
    threading.Thread(target=_end_with_parent, args=(federate,), daemon=True).start()
    code = 0
    try:
        federate.run()
    except CosimError as error:
        print(error, file=sys.stderr, flush=True)
        code = 1
    except BaseException:
        traceback.print_exc()
        sys.stderr.flush()
        code = 1
    os._exit(code)  # HELICS may wait for somebody who is gone


if __name__ == "__main__":
    main()
