"""The process that speaks HELICS for gfor: its federate, and the broker where gfor starts one; see `federation`.

A hang or a fault inside of HELICS stays in this process, which gfor can end at any time. It ends by itself when gfor is
gone, and ends the federation with it."""

import json
import os
import struct
import sys
import threading
import time
from contextlib import suppress
from difflib import get_close_matches
from types import ModuleType
from typing import Any, NoReturn

from orchestrator.simulation.federation import frames, helics_calls
from orchestrator.simulation.federation.choice import FIRST_NS, OVER, OWN_NAME

_END = json.dumps({"number": 0, "command": "end", "arguments": []})
_END_OF_OTHERS = "end"
_TO_LEAVE = 8000  # for the others, once they are told [ms]
_LOOK = 0.02  # between two looks at who has joined [s]


class _FederationError(Exception):
    """Ends the federation; ``fault`` is told to gfor."""

    def __init__(self, status: str, text: str, component: str = "") -> None:
        super().__init__(text)
        self.fault = {"component": component, "status": status, "text": text}


class Hub:
    def __init__(self, request: dict[str, Any]) -> None:
        self._request, self._parts = request, request["parts"]
        self._gfor = frames.call(request["port"], request["word"])
        self._waiting: tuple[float, str] | None = None
        self._sending = threading.Lock()
        self._federate: Any = None
        self._broker: Any = None
        self._now = 0
        self._joined: dict[str, dict[str, Any]] = {}
        self.ended = False

    def serve(self) -> None:
        threading.Thread(target=self._watch, daemon=True).start()
        try:
            self._begin()
            while not self.ended:
                kind, content = self._gfor.receive()
                self._answer(kind, content)
        except EOFError:
            self.leave("gfor ended")
        except _FederationError as error:
            self._fail(error.fault)
        except helics_calls.library().HelicsException as error:
            self._fail(
                {
                    "component": "",
                    "status": "an error of HELICS",
                    "text": helics_calls.text_of(error),
                }
            )

    def _answer(self, kind: bytes, content: bytes) -> None:
        match kind:
            case frames.JOIN:
                answer = json.dumps(self._all_join()).encode()
            case frames.COMMAND:
                answer = self._command(**json.loads(content)).encode()
            case frames.FIRST:
                answer = self._first(json.loads(content))
            case frames.STEP:
                answer = self._step(content)
            case _:
                self.leave("" if self._broker is not None else OVER)
                self.ended = True
                answer = b""
        with self._sending:
            self._gfor.send(kind, answer)

    def _begin(self) -> None:
        helics, own = helics_calls.library(), self._request["own_broker"]
        if own is not None:
            others = "--ipv4" if own["everywhere"] else "--local_interface=tcp://127.0.0.1"
            self._broker = helics.helicsCreateBroker(
                helics_calls.CORE,
                "",
                f"-f {len(self._parts) + 1} --port={own['port']} {others} --loglevel=error",
            )
            if not helics.helicsBrokerIsConnected(self._broker):
                raise _FederationError(
                    "no broker", f"a broker cannot be started at port {own['port']}"
                )
        broker, seconds = self._request["broker"], self._request["to_join"]
        try:
            self._federate = helics_calls.join(OWN_NAME, broker, seconds)
        except helics.HelicsException as error:
            raise _FederationError(
                "no broker",
                f"the broker {broker} does not take the federate {OWN_NAME!r}: {helics_calls.text_of(error)}",
            ) from error
        self._register(helics)

    def _register(self, helics: ModuleType) -> None:
        federate = self._federate
        self._inputs, self._outputs, self._faults, self._start = {}, {}, {}, []
        self._optional = set()
        for part in self._parts:
            name, units = part["name"], part["units"]
            self._inputs[name] = [
                helics_calls.publication(federate, f"{name}.{v}", units[v]) for v in part["inputs"]
            ]
            self._outputs[name] = {
                v: helics_calls.optional_subscription(federate, f"{name}.{v}", units[v])
                for v in part["outputs"]
            }
            self._faults[name] = helics_calls.optional_subscription(
                federate, f"{name}/{helics_calls.FAULT_MARK}", ""
            )
            self._optional |= {f"{name}.{v}" for v in part["outputs"]} | {
                f"{name}/{helics_calls.FAULT_MARK}"
            }
            slot = self._request["slots"][part["slot"]]
            for variable, value in part["start"].items():
                if variable not in part["inputs"]:
                    self._start.append(
                        (
                            helics_calls.publication(
                                federate, f"{name}.{variable}", units[variable]
                            ),
                            value,
                        )
                    )
            for mark, value in (("period", self._request["period"]), ("offset", slot["compute"])):
                self._start.append(
                    (helics_calls.publication(federate, f"{name}/{mark}", "s"), value * 1e-9)
                )

    def _all_join(self) -> dict[str, Any]:
        helics, names = helics_calls.library(), [part["name"] for part in self._parts]
        deadline = time.monotonic() + self._request["to_join"]
        while missing := [
            name
            for name in names
            if name not in set(helics_calls.ask(self._federate, "root", "federates") or ())
        ]:
            if time.monotonic() > deadline:
                raise _FederationError(
                    "nobody",
                    f"no federate named {' or '.join(map(repr, missing))} joined the federation at "
                    f"{self._request['broker']} within {self._request['to_join']:g} s; its name at HELICS must be the "
                    "component's",
                    missing[0],
                )
            time.sleep(_LOOK)
        self._waiting = (
            time.monotonic() + self._request["to_join"],
            "all federates to enter the initialisation",
        )
        helics.helicsFederateEnterInitializingMode(self._federate)
        joined = {part["name"]: self._published(part) for part in self._parts}
        self._joined = joined
        self._refuse_unknown_names()
        for handle, value in self._start:
            helics.helicsPublicationPublishDouble(handle, value)
        helics.helicsFederateEnterExecutingMode(self._federate)
        self._waiting = None
        return joined

    def _published(self, part: dict[str, Any]) -> dict[str, Any]:
        name = part["name"]
        published = list(helics_calls.ask(self._federate, name, "publications") or ())
        for variable in part["needed"]:
            wanted = f"{name}.{variable}"
            if wanted not in published:
                near = get_close_matches(wanted, published, 1)
                hint = (
                    f"; it publishes {near[0]!r}, is that meant?"
                    if near
                    else f"; it publishes {published}"
                )
                raise _FederationError(
                    "no such name",
                    f"federate {name!r} has no global publication {wanted!r}, which other components "
                    f"take{hint}",
                    name,
                )
        outputs = [v for v in part["outputs"] if f"{name}.{v}" in published]
        self._outputs[name] = {v: self._outputs[name][v] for v in outputs}
        return {"ours": f"{name}/{helics_calls.OURS_MARK}" in published, "outputs": outputs}

    def _refuse_unknown_names(self) -> None:
        """A subscription that nobody feeds stays at 0 for ever."""
        found = helics_calls.ask(self._federate, "root", "unconnected_interfaces")
        unknown = set(found.get("unknown_publications", ())) if isinstance(found, dict) else set()
        known = [
            f"{part['name']}.{v}" for part in self._parts for v in (*part["inputs"], *part["start"])
        ]
        for name in sorted(unknown - self._optional):
            near = get_close_matches(name, known, 1)
            if near or name.partition(".")[0] in self._inputs:
                hint = f"did you mean {near[0]!r}?" if near else f"there are {', '.join(known)}"
                raise _FederationError(
                    "no such name",
                    f"somebody subscribes to {name!r}, which nobody publishes; {hint}",
                )

    def _command(self, component: str, text: str) -> str:
        helics = helics_calls.library()
        number = json.loads(text)["number"]
        helics.helicsFederateSendCommand(self._federate, component, text)
        deadline, pause = time.monotonic() + self._request["patience"], 1e-4
        while time.monotonic() < deadline:
            answer: str = helics.helicsFederateGetCommand(self._federate)
            if answer and json.loads(answer).get("number") == number:
                return answer
            time.sleep(pause)
            pause = min(2 * pause, 5e-3)
        raise _FederationError(
            "no answer",
            f"within {self._request['patience']:g} s; it hangs, or the way to it is broken",
            component,
        )

    def _first(self, foreign: list[str]) -> bytes:
        self._request_time(FIRST_NS, None)
        return json.dumps(
            {p["name"]: self._values(p) for p in self._parts if p["name"] in foreign}
        ).encode()

    def _values(self, part: dict[str, Any]) -> list[float]:
        helics, name = helics_calls.library(), part["name"]
        if helics.helicsInputIsUpdated(self._faults[name]) and (
            text := helics.helicsInputGetString(self._faults[name])
        ):
            raise _FederationError("a fault", text, name)
        silent = [
            v
            for v, handle in self._outputs[name].items()
            if not helics.helicsInputIsUpdated(handle)
        ]
        if silent:
            there = name in set(
                helics_calls.ask(self._federate, "root", "federates") or ()
            ) and helics_calls.ask(self._federate, name, "state") not in (
                "disconnected",
                "error",
                "finished",
                "finalize",
            )
            why = (
                "each output must be published at each of its times, changed or not; look at its period, its offset "
                "and only_transmit_on_change"
                if there
                else "it has left the federation"
            )
            raise _FederationError(
                "no value", f"of {', '.join(f'{name}.{v}' for v in silent)}: {why}", name
            )
        return [helics.helicsInputGetDouble(handle) for handle in self._outputs[name].values()]

    def _step(self, content: bytes) -> bytes:
        """Publish the inputs of one slot's federates, let them compute, and return their outputs."""
        helics = helics_calls.library()
        index, number = struct.unpack_from("<qq", content)
        slot = self._request["slots"][number]
        parts = [part for part in self._parts if part["slot"] == number]
        begin = index * self._request["period"]
        if self._now < begin + slot["publish"]:
            self._request_time(begin + slot["publish"], None)
        offset = 16
        for part in parts:
            handles = self._inputs[part["name"]]
            for handle, value in zip(
                handles, struct.unpack_from(f"<{len(handles)}d", content, offset), strict=True
            ):
                helics.helicsPublicationPublishDouble(handle, value)
            offset += 8 * len(handles)
        self._request_time(begin + slot["read"], number)
        values = [value for part in parts for value in self._values(part)]
        return struct.pack(f"<{len(values)}d", *values)

    def _request_time(self, nanoseconds: int, slot: int | None) -> None:
        names = [p["name"] for p in self._parts if slot is None or p["slot"] == slot]
        self._waiting = (time.monotonic() + self._request["patience"], " ".join(names))
        granted = helics_calls.library().helicsFederateRequestTime(
            self._federate, nanoseconds * 1e-9
        )
        self._waiting = None
        if round(granted * 1e9) != nanoseconds:
            raise _FederationError(
                "an end", "the broker or a federate ended the federation", names[0]
            )
        self._now = nanoseconds

    def _watch(self) -> None:
        """Look whether HELICS lets this process wait for too long: a call of HELICS cannot be interrupted."""
        while True:
            time.sleep(0.2)
            waiting = self._waiting
            if waiting is not None and time.monotonic() > waiting[0]:
                self._fail(self._who_hangs(waiting[1]))

    def _who_hangs(self, waited: str) -> dict[str, str]:
        """Among those that are waited for, the one whose granted time is behind."""
        names = [part["name"] for part in self._parts]
        among = [name for name in waited.split() if name in names] or names
        late = []
        for name in among:
            times = helics_calls.ask(self._federate, name, "current_time")
            if (
                not isinstance(times, dict)
                or times.get("requested_time", 0.0) * 1e9 <= self._now + 1
            ):
                late.append(name)
        who = late or among
        patience = self._request["patience"]
        return {
            "component": who[0],
            "status": "no answer",
            "text": f"{', '.join(who)} did not ask for its next time within {patience:g} s; it hangs, or the way to it "
            "is broken",
        }

    def _fail(self, fault: dict[str, str]) -> NoReturn:
        with self._sending, suppress(OSError):
            self._gfor.send(frames.FAULT, json.dumps(fault).encode())
        self.leave(fault["text"])
        os._exit(3)

    def leave(self, reason: str) -> None:
        """Leave the federation; with a reason it ends for all."""
        helics = helics_calls.library()
        worker = threading.Thread(target=self._leave, args=(helics, reason), daemon=True)
        worker.start()
        # a call of HELICS may wait for somebody who is gone
        worker.join(3.0 if reason else 1.0 + 1e-3 * _TO_LEAVE)

    def _leave(self, helics: ModuleType, reason: str) -> None:
        with suppress(helics.HelicsException):
            # A broker that ends before they leave may not reach them, or lets them wait for ever.
            for name, found in {} if reason else self._joined.items():
                helics.helicsFederateSendCommand(
                    self._federate, name, _END if found["ours"] else _END_OF_OTHERS
                )
            if self._federate is not None and reason:
                helics.helicsFederateGlobalError(self._federate, 1, reason)
                time.sleep(0.1)
            if self._federate is not None:
                helics.helicsFederateDisconnect(self._federate)
            if self._broker is not None:
                helics.helicsBrokerWaitForDisconnect(self._broker, 1000 if reason else _TO_LEAVE)
                helics.helicsBrokerDisconnect(self._broker)


def _end_with_parent(hub: Hub) -> None:
    """Leave once standard input ends, which is when the process that started this one is gone."""
    while sys.stdin.buffer.read(4096):
        pass
    hub.leave("gfor ended")
    os._exit(1)


def main() -> None:
    hub = Hub(json.loads(sys.stdin.buffer.readline()))
    threading.Thread(target=_end_with_parent, args=(hub,), daemon=True).start()
    hub.serve()
    os._exit(0)


if __name__ == "__main__":
    main()
