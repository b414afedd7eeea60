"""Engines: where the components of a run step if not in this process, and what a user chooses about it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Protocol, Self

from fmus.toolchain.plugins import PlugIns
from orchestrator.core.errors import InputError
from orchestrator.core.options import Option
from orchestrator.simulation.waiting_times import PATIENCE, TO_JOIN

if TYPE_CHECKING:  # an engine's other processes need the choices alone
    from orchestrator.cases.scenario.prepare import PreparedScenario
    from orchestrator.devices.fmi.component import Component
    from orchestrator.systems.coupling.master import Master
    from orchestrator.systems.coupling.observers import Observer
    from orchestrator.systems.coupling.system import ComponentPlan

DEFAULT_PORT = 23405  # of a HELICS broker whose address names none


@dataclass(frozen=True, slots=True)
class Federates:
    """Choices of a user for a run on an engine: which components are federates, who starts them, and where."""

    # components that gfor starts as federates on this machine, each in a process of its own
    names: tuple[str, ...] = ()
    # components that somebody else starts as federates: `gfor master federate`, or a HELICS program of their own
    external: tuple[str, ...] = ()
    # address of a broker that runs already, such as ``tcp://host:23405``; None has gfor start one
    broker: str | None = None
    # where a broker that gfor starts listens on all network interfaces; None takes a free port of this machine alone
    port: int | None = None
    # patience, to_join: time for one step or answer, and for all to join [s]
    patience: float = PATIENCE
    to_join: float = TO_JOIN
    # takes sentences that the user should read meanwhile: who is waited for, and how long the run will take
    announce: Callable[[str], None] | None = field(default=None, compare=False)
    # name of the engine: one of `ENGINES`
    engine: str = "helics"

    def __post_init__(self) -> None:
        if self.broker is not None and self.port is not None:
            raise InputError(
                Option.BROKER
                + " names a broker that runs, "
                + Option.BROKER_PORT
                + " has gfor start one; give only one of them"
            )
        both = sorted(set(self.names) & set(self.external))
        if both:
            raise InputError(
                f"{', '.join(both)}: a federate is either started by gfor or external; name it only once"
            )
        if self.broker is not None:
            address_of(self.broker)


def address_of(broker: str) -> tuple[str, int]:
    host, colon, port = broker.removeprefix("tcp://").partition(":")
    if not host or "/" in host or (colon and not (port.isdigit() and 0 < int(port) < 65536)):
        raise InputError(
            f"broker {broker!r}: an address has the form tcp://host:port, such as tcp://10.0.0.5:23405"
        )
    return host, int(port) if colon else DEFAULT_PORT


class Engine(Protocol):
    """The components of one run elsewhere, from ``with`` to its end, which ends all that the engine has started."""

    # inside of ``with``: the scenario as the engine runs it
    prepared: PreparedScenario

    def __enter__(self) -> Self: ...

    def __exit__(self, *error: object) -> None: ...

    def open(self, name: str, plan: ComponentPlan, directory: Path) -> Component:
        """Open a component: of this process until `begin`, so that it is initialised and linearised as any other."""

    def begin(self, master: Master) -> None:
        """Take the initialised components over, before the run's first step."""

    def observers(self) -> Sequence[Observer]:
        """Observers of the run, such as one that tells the expected time."""

    def obstacle(self, component: Component) -> str | None:
        """Return why a component keeps the system from being linearised; None where it does not."""


ENGINES: PlugIns[Callable[[PreparedScenario, Federates], Engine]] = PlugIns(
    "gfor_cosim.engines", lambda: (type,)
)
"""Classes of engines by the name that ``--engine`` takes; the local one is none of them."""
