"""Which values a federation exchanges, and when; times of HELICS are whole nanoseconds."""

import random
import socket
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from itertools import pairwise

from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.core.errors import InputError
from orchestrator.core.options import Option
from orchestrator.simulation.federation.choice import address_of


@dataclass(frozen=True, slots=True)
class Slot:
    """One exchange within each communication step, for the federates of one group; times from its beginning [ns]."""

    # publish, compute, read: when gfor publishes inputs, when the federates compute, and when gfor reads their outputs
    publish: int
    compute: int
    read: int


@dataclass(frozen=True, slots=True)
class Part:
    name: str
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    needed: tuple[str, ...]
    start: dict[str, float]
    units: dict[str, str]
    slot: int
    external: bool


@dataclass(frozen=True, slots=True)
class Layout:
    """All exchanges of a federation; ``period`` is the communication step [ns]."""

    period: int
    slots: tuple[Slot, ...]
    parts: tuple[Part, ...]


def make_layout(
    prepared: PreparedScenario, names: Sequence[str], external: Sequence[str]
) -> Layout:
    system, known = prepared.system, prepared.system.components
    for option, given in ((Option.FEDERATE, names), (Option.EXTERNAL, external)):
        wrong = [name for name in given if name not in known]
        if wrong:
            raise InputError(
                option + f" {wrong[0]}: scenario {prepared.name!r} has no component {wrong[0]!r}; "
                f"components: {', '.join(known)}"
            )
    if not prepared.schedule.is_plain:
        raise InputError(
            Option.ENGINE_HELICS
            + " needs a schedule with held inputs and a plain clock, gauss-seidel or "
            "jacobi; leave " + Option.LIKE + " and " + Option.TOLERANCE + " out"
        )
    period = round(prepared.step_size * 1e9)
    wanted = {*names, *external}
    groups = [[n for n in group if n in wanted] for group in prepared.schedule.groups]
    groups = [group for group in groups if group]
    if abs(prepared.step_size * 1e9 - period) > 1e-6 or period < 2 * len(groups):
        raise InputError(
            f"communication step {prepared.step_size:g} s: HELICS counts time in whole "
            "nanoseconds, and each group with federates needs two of them in a step; "
            "give another step with " + Option.STEP
        )
    edges = [period * i // len(groups) for i in range(len(groups) + 1)]
    slots = tuple(Slot(a, (a + b) // 2, b) for a, b in pairwise(edges))
    parts = []
    for slot, group in enumerate(groups):
        for name in group:
            plan = known[name]
            variables = plan.description.variables
            inputs = [c.target.variable for c in system.connections if c.target.component == name]
            outputs = [v for v in plan.description.outputs if variables[v].type == "Real"]
            start = {
                v: float(x)
                for v, x in (plan.parameters | plan.inputs).items()
                if not isinstance(x, str)
            }
            needed = dict.fromkeys(
                c.source.variable for c in system.connections if c.source.component == name
            )
            units = {v: variables[v].unit for v in (*inputs, *outputs, *start)}
            parts.append(
                Part(
                    name,
                    tuple(inputs),
                    outputs=tuple(outputs),
                    needed=tuple(needed),
                    start=start,
                    units=units,
                    slot=slot,
                    external=name in set(external),
                )
            )
    return Layout(period, slots, tuple(parts))


_TO_CONNECT = 5.0  # how long a broker's address is tried [s]
_LOCAL = "127.0.0.1"
_BLOCK = (
    128  # ports for one federation: its broker's first two, and from the sixth on one a federate
)
_BLOCKS = range(20_480, 32_768, _BLOCK)
"""The ports of brokers: below those that Linux (from 32768), macOS and Windows (from 49152) give to whoever connects
to somewhere. HELICS tells a federate its port without a look at it, and a federate whose port is taken gives up."""
_HELD = 2  # a port of each block that HELICS leaves free


def claim_ports() -> tuple[int, socket.socket]:
    """The port of a broker that is about to be started, and what keeps its block from our other federations."""
    for port in random.sample(_BLOCKS, len(_BLOCKS)):
        with ExitStack() as stack:
            try:
                held = stack.enter_context(socket.create_server((_LOCAL, port + _HELD)))
            except OSError:
                continue
            others = (port + i for i in range(_BLOCK) if i != _HELD)
            if all(_is_free(number, _LOCAL) for number in others):
                stack.pop_all()
                return port, held
    raise InputError(
        f"this machine has no {_BLOCK} free ports one after the other between {_BLOCKS.start} and "
        f"{_BLOCKS.stop - 1} for a federation; give a port with " + Option.BROKER_PORT
    )


def require_free(port: int) -> None:
    """Refuse the port of a broker that is about to be started if it, or the one after it, is in use."""
    for number in (port, port + 1):
        if not _is_free(number, ""):
            raise InputError(
                Option.BROKER_PORT
                + f" {port}: port {number} is in use (a broker takes two ports, {port} and "
                f"{port + 1}); give another port, or use the broker that runs there with "
                + Option.BROKER
            )


def _is_free(port: int, host: str) -> bool:
    try:
        socket.create_server((host, port)).close()
    except (OSError, OverflowError):
        return False
    return True


def require_broker(broker: str) -> None:
    host, port = address_of(broker)
    try:
        socket.create_connection((host, port), timeout=_TO_CONNECT).close()
    except OSError as error:
        raise InputError(
            Option.BROKER
            + f" {broker}: nothing answers there ({error}); start one with `helics_broker -f N --ipv4 "
            f"--port={port}`, N being the number of federates and one more for gfor, and look at the firewall"
        ) from error
