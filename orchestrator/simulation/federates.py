"""Choices of a user for a run on an engine; its other processes need no more of it."""

from collections.abc import Callable
from dataclasses import dataclass, field

from orchestrator.core.errors import InputError
from orchestrator.core.options import Option
from orchestrator.simulation.waiting_times import PATIENCE, TO_JOIN

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
