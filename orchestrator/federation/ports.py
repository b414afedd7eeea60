"""Ports and addresses of brokers, tried before HELICS waits for them."""

import socket
from contextlib import ExitStack

from orchestrator.errors import InputError
from orchestrator.federation.choice import address_of

_TRIES = 50
_TO_CONNECT = 5.0  # how long a broker's address is tried [s]


def broker_port(wanted: int | None) -> int:
    """The port of a broker that is about to be started; the one after it is free as well, which HELICS takes too."""
    if wanted is not None:
        taken = _taken(wanted, "")
        if taken is not None:
            raise InputError(
                f"--broker-port {wanted}: port {taken} is in use (a broker takes two ports, {wanted} and {wanted + 1})"
                "; give another port, or use the broker that runs there with --broker"
            )
        return wanted
    for _ in range(_TRIES):
        with socket.create_server(("127.0.0.1", 0)) as server:
            port: int = server.getsockname()[1]
        if port < 65000 and _taken(port, "127.0.0.1") is None:
            return port
    raise InputError("this machine has no two free ports one after the other for a broker; give one with --broker-port")


def _taken(port: int, host: str) -> int | None:
    """The first of a broker's two ports that is taken."""
    with ExitStack() as stack:
        for number in (port, port + 1):
            try:
                stack.enter_context(socket.create_server((host, number)))
            except (OSError, OverflowError):
                return number
    return None


def require_broker(broker: str) -> None:
    host, port = address_of(broker)
    try:
        socket.create_connection((host, port), timeout=_TO_CONNECT).close()
    except OSError as error:
        raise InputError(
            f"--broker {broker}: nothing answers there ({error}); start one with `helics_broker -f N --ipv4 "
            f"--port={port}`, N being the number of federates and one more for gfor, and look at the firewall"
        ) from error
