"""A federation for one run: its processes, what they are told, and their end, whatever happens.

Processes are started anew, never forked. Each of them ends when its standard input does, which is when this process is
gone, however that came about."""

import json
import pickle
import socket
import struct
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from ctypes import c_int
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, Self

from fmus.toolchain import temporary
from fmus.toolchain.extras import require
from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.core.closing import Closing
from orchestrator.core.errors import ComponentError, InputError
from orchestrator.core.interrupts import calls
from orchestrator.core.options import Option
from orchestrator.devices.fmi.component import Component
from orchestrator.devices.fmi.description import FmuDescription
from orchestrator.devices.fmi.instance import compile_adapters, open_component
from orchestrator.devices.sandbox.process_end import fault_of_exit, last_line
from orchestrator.devices.sandbox.resource_limits import Limits
from orchestrator.simulation.federation import frames
from orchestrator.simulation.federation.choice import PROTOCOL, Federates
from orchestrator.simulation.federation.component import FederatedComponent, obstacle_of
from orchestrator.simulation.federation.frames import Door, Frames
from orchestrator.simulation.federation.layout import (
    Layout,
    Part,
    claim_ports,
    make_layout,
    require_broker,
    require_free,
)
from orchestrator.simulation.federation.pace import Pace
from orchestrator.simulation.waiting_times import AFTER_CTRL_C, HUB_GRACE, TO_END
from orchestrator.systems.coupling.master import Master
from orchestrator.systems.coupling.system import ComponentPlan, System

_LOOK = 0.2  # between two looks at the processes while something is waited for [s]


class Federation(Closing):
    """The processes of one run, from `with` to its end.

    ``prepared``: Inside of ``with``: the scenario with foreign federates as what they publish.

    Raises `InputError` on entering: if the choice does not fit the scenario, the broker does not answer or its port is
    taken, or a federate does not join, has other names or is of another version."""

    def __init__(self, prepared: PreparedScenario, federates: Federates) -> None:
        self.prepared, self._choice = prepared, federates
        self._announce = federates.announce or (lambda text: None)
        names = federates.names or (() if federates.external else _all_but_the_grid(prepared))
        self.layout: Layout = make_layout(prepared, names, federates.external)
        self._parts = {part.name: part for part in self.layout.parts}
        self._plans = {name: prepared.system.components[name] for name in self._parts}
        self._processes: dict[str, subprocess.Popen[bytes]] = {}
        self._folder: Path | None = None
        self._ports: socket.socket | None = None
        self._hub: Frames | None = None
        self._foreign: set[str] = set()
        self._published: dict[str, list[str]] = {}
        self._values: dict[str, Sequence[float]] = {}
        self._ready: dict[str, Sequence[float]] = {}
        self._under_way: int | None = None
        self._asked = 0
        self._opened: list[FederatedComponent] = []

    def __enter__(self) -> Self:
        require(Option.ENGINE_HELICS, "helics")
        self._folder = temporary.own_folder("federation")
        try:
            self._start()
            self._join()
        except ComponentError as error:
            self.close()
            raise InputError(str(error)) from error
        except BaseException:
            self.close()
            raise
        return self

    def _start(self) -> None:
        choice, own = self._choice, None
        if choice.broker is None:
            port = self._port_of_own()
            own, broker = (
                {"port": port, "everywhere": choice.port is not None},
                f"tcp://127.0.0.1:{port}",
            )
        else:
            broker = choice.broker
            require_broker(broker)
        waited = [part.name for part in self.layout.parts if part.external]
        if waited:
            where = (
                f"port {choice.port} of this machine"
                if choice.port is not None
                else f"the broker {broker}"
            )
            self._announce(
                f"waiting {choice.to_join:g} s for the federates {', '.join(waited)} at {where}"
            )
        with Door() as door:
            request = {
                "port": door.port,
                "word": door.word,
                "broker": broker,
                "own_broker": own,
                "patience": choice.patience,
                "to_join": choice.to_join,
                **asdict(self.layout),
            }
            self._spawn(
                "the hub",
                "orchestrator.simulation.federation.hub",
                json.dumps(request).encode() + b"\n",
            )
            deadline = time.monotonic() + choice.to_join
            while self._hub is None:
                with suppress(TimeoutError):
                    self._hub = door.accept(_LOOK)
                self._look(deadline)
        for part in self.layout.parts:
            if not part.external:
                plan = self._plans[part.name]
                compile_adapters(plan.description)
                content = pickle.dumps((part.name, plan.description, broker, choice.to_join))
                self._spawn(
                    part.name,
                    "orchestrator.simulation.federation.federate",
                    f"{len(content)}\n".encode() + content,
                )

    def _port_of_own(self) -> int:
        if self._choice.port is not None:
            require_free(self._choice.port)
            return self._choice.port
        port, self._ports = claim_ports()
        return port

    def _spawn(self, name: str, module: str, request: bytes) -> None:
        assert self._folder is not None
        with self._output(name).open("wb") as output:
            process = subprocess.Popen(
                [sys.executable, "-P", "-m", module],
                stdin=subprocess.PIPE,
                stdout=output,
                stderr=output,
                start_new_session=True,
            )
        self._processes[name] = process
        assert process.stdin is not None
        with suppress(BrokenPipeError):  # that it has ended is seen when it is waited for
            process.stdin.write(request)
            process.stdin.flush()

    def _output(self, name: str) -> Path:
        assert self._folder is not None
        return (
            self._folder / f"{list(self._parts).index(name) if name in self._parts else 'hub'}.txt"
        )

    def _look(self, deadline: float) -> None:
        """Raise if a process has ended, or time is up."""
        for name, process in sorted(
            self._processes.items(), key=lambda entry: entry[0] == "the hub"
        ):
            code = process.poll()
            if code is not None:
                fault, how = fault_of_exit(code, Limits())
                raise ComponentError(
                    name, "its federate", fault, last_line(self._output(name)) or how
                )
        if time.monotonic() > deadline:
            patience = self._choice.patience
            raise ComponentError(
                "the hub", "HELICS", "no answer", f"within {patience:g} s; its processes were ended"
            )

    def _receive(self, kind: bytes, seconds: float) -> bytes:
        assert self._hub is not None
        deadline, asked = time.monotonic() + seconds, None
        interrupted = c_int.from_address(calls.asked_address)
        while True:
            try:
                answer, content = self._hub.receive(_LOOK)
            except TimeoutError:
                self._look_patiently(deadline)
                asked = asked or (time.monotonic() if interrupted.value else None)
                if asked is not None and time.monotonic() > asked + AFTER_CTRL_C:
                    raise KeyboardInterrupt from None
                continue
            except EOFError:
                self._look(time.monotonic() + _LOOK)
                raise ComponentError(
                    "the hub", "HELICS", "an end", "the hub has closed its connection"
                ) from None
            if answer == frames.FAULT:
                fault = json.loads(content)
                self._look_for_the_dead(fault["component"])
                raise ComponentError(
                    fault["component"] or "federation",
                    "its federate",
                    fault["status"],
                    fault["text"],
                )
            assert answer == kind
            return content

    def _look_patiently(self, deadline: float) -> None:
        """Look at the processes; one that has just ended may have left its reason at the hub."""
        try:
            self._look(deadline)
        except ComponentError:
            assert self._hub is not None
            with suppress(TimeoutError, EOFError):
                answer, content = self._hub.receive(_LOOK)
                fault = json.loads(content) if answer == frames.FAULT else {"status": "no value"}
                if fault["status"] == "a fault":
                    raise ComponentError(
                        fault["component"], "its federate", fault["status"], fault["text"]
                    ) from None
            raise

    def _look_for_the_dead(self, name: str) -> None:
        """Raise if a federate has died: that is the reason of what the hub tells, and may come to light after it."""
        process = self._processes.get(name)
        if process:
            with suppress(subprocess.TimeoutExpired):
                process.wait(_LOOK)
                self._look(time.monotonic() + _LOOK)

    def command(self, name: str, command: str, *arguments: Any) -> Any:
        assert self._hub is not None
        self._asked += 1
        text = json.dumps({"number": self._asked, "command": command, "arguments": arguments})
        self._hub.send(frames.COMMAND, json.dumps({"component": name, "text": text}).encode())
        reply = json.loads(self._receive(frames.COMMAND, self._choice.patience + HUB_GRACE))
        if "error" in reply:
            raise ComponentError(name, f"the command {command!r}", "an error", reply["error"])
        return reply["result"]

    def begin_step(self, name: str, time: float, inputs: Sequence[float]) -> None:
        if self._under_way is not None:
            self._finish_step()
        slot = self._parts[name].slot
        self._ready[name] = inputs
        members = [part.name for part in self.layout.parts if part.slot == slot]
        if all(member in self._ready for member in members):
            index = round(time / self.prepared.step_size)
            numbers = [value for member in members for value in self._ready[member]]
            self._ready = {}
            assert self._hub is not None
            self._hub.send(frames.STEP, struct.pack(f"<qq{len(numbers)}d", index, slot, *numbers))
            self._under_way = slot

    def outputs(self, name: str) -> Sequence[float]:
        if self._under_way is not None:
            self._finish_step()
        return self._values[name]

    def _finish_step(self) -> None:
        slot = self._under_way
        content = self._receive(frames.STEP, self._choice.patience + HUB_GRACE)
        self._under_way = None
        numbers, begin = struct.unpack(f"<{len(content) // 8}d", content), 0
        for part in self.layout.parts:
            if part.slot == slot:
                end = begin + len(self._published[part.name])
                self._values[part.name], begin = numbers[begin:end], end

    def _join(self) -> None:
        assert self._hub is not None
        self._hub.send(frames.JOIN)
        joined = json.loads(self._receive(frames.JOIN, 2 * self._choice.to_join + HUB_GRACE))
        for name, found in joined.items():
            self._published[name] = found["outputs"]
            if found["ours"]:
                self._configure(name)
            else:
                self._foreign.add(name)
        self._refuse_events()
        self._hub.send(frames.FIRST, json.dumps(sorted(self._foreign)).encode())
        self._values |= json.loads(self._receive(frames.FIRST, self._choice.patience + HUB_GRACE))
        if self._foreign:
            self.prepared = self._with_foreign_federates()

    def _configure(self, name: str) -> None:
        part, found = self._parts[name], self.command(name, "hello")
        here = {"protocol": PROTOCOL, "guid": self._plans[name].description.guid}
        if any(found.get(key) != value for key, value in here.items()):
            raise InputError(
                f"component {name!r}: its federate is gfor-cosim {found.get('version')} with protocol "
                f"{found.get('protocol')} and an FMU of guid {found.get('guid')}; here are protocol {PROTOCOL} and "
                f"guid {here['guid']}; install the same version on both machines, and give both the same case"
            )
        setting = {
            "period": self.layout.period,
            "offset": self.layout.slots[part.slot].compute,
            "step_size": self.prepared.step_size,
            "inputs": list(part.inputs),
        }
        self.command(name, "configure", setting)
        self.command(name, "begin")

    def _refuse_events(self) -> None:
        for event in self.prepared.events:
            for name in event.changes():
                if name in self._foreign:
                    raise InputError(
                        f"event at {event}: {name!r} is a foreign federate, in which gfor can change nothing; remove "
                        "the event from the scenario, and let the federate do it by itself"
                    )

    def _with_foreign_federates(self) -> PreparedScenario:
        system = System()
        for name, plan in self.prepared.system.components.items():
            if name in self._foreign:
                description = _as_published(plan, self._parts[name], self._published[name])
                plan = ComponentPlan(description, plan.parameters, plan.inputs, plan.isolated)  # noqa: PLW2901
            system.components[name] = plan
        system.connections = self.prepared.system.connections
        record = tuple(
            signal
            for signal in self.prepared.record
            if signal.partition(".")[2]
            in system.components[signal.partition(".")[0]].description.variables
        )
        return replace(self.prepared, system=system, record=record)

    def open(self, name: str, plan: ComponentPlan, directory: Path) -> Component:
        if name in self._foreign:
            own: FederatedComponent = FederatedComponent(
                self._parts[name], plan.description, None, self, self._published[name]
            )
        else:
            component = open_component(name, plan.description, directory, isolated=plan.isolated)
            if name not in self._parts:
                return component
            own = FederatedComponent(
                self._parts[name], plan.description, component, self, self._published[name]
            )
        self._opened.append(own)
        return own

    def observers(self) -> list[Pace]:
        """Tell the expected time, if somebody takes sentences."""
        return [] if self._choice.announce is None else [Pace(self._choice.announce)]

    def obstacle(self, component: Component) -> str | None:
        """Return why a federate keeps the system from being linearised; None where it does not."""
        return obstacle_of(component)

    def begin(self, master: Master) -> None:
        """Hand the initialised components over to their federates."""
        steps = round(self.prepared.stop_time / self.prepared.step_size)
        self._announce(
            f"{steps} steps over HELICS; the expected time follows after the first second"
        )
        for name in self._parts:
            component = master.components[name]
            assert isinstance(component, FederatedComponent)
            component.hand_over()

    def close(self) -> None:
        """End all processes and remove what was written for them; calling it again does nothing."""
        hub, self._hub = self._hub, None
        if hub is not None:
            with suppress(OSError):
                hub.send(frames.END)
        deadline = time.monotonic() + TO_END
        if hub is None or self._under_way is not None:  # it is busy, and hears nothing
            deadline = time.monotonic()
        for process in reversed(
            self._processes.values()
        ):  # the hub, which lets the others go, last
            with suppress(subprocess.TimeoutExpired):
                process.wait(max(0.0, deadline - time.monotonic()))
            assert process.stdin is not None
            with suppress(OSError):
                process.stdin.close()
        for process in self._processes.values():
            with suppress(subprocess.TimeoutExpired):
                process.wait(max(0.0, deadline + TO_END - time.monotonic()))
            if process.poll() is None:
                process.kill()
            process.wait()
        self._processes = {}
        if hub is not None:
            hub.close()
        if self._ports is not None:
            self._ports.close()
        if self._folder is not None:
            temporary.remove(self._folder)


def _all_but_the_grid(prepared: PreparedScenario) -> tuple[str, ...]:
    flow = prepared.case.table.power_flow
    return tuple(name for name in prepared.system.components if flow is None or name != flow.grid)


def _as_published(plan: ComponentPlan, part: Part, published: Sequence[str]) -> FmuDescription:
    kept = {*part.inputs, *published}
    variables = {
        n: v
        for n, v in plan.description.variables.items()
        if n in kept or v.causality == "parameter"
    }
    return replace(
        plan.description,
        variables=variables,
        states=(),
        rates=(),
        states_are_settable=False,
        can_save_state=False,
        can_serialize_state=False,
        gives_directional_derivatives=False,
        generation_tool="a federate at HELICS",
    )
