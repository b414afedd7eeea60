"""What the command line says of itself in the manifests of results."""

from collections.abc import Callable

said: list[Callable[[], dict[str, str]]] = []
"""The ``command`` in force, with the hash of the ``code``; empty in Python."""


def as_typed() -> str:
    """The command in force."""
    return said[-1]()["command"]
