"""What the command line says of itself in the manifests of results."""

from collections.abc import Callable
from typing import Any

said: list[Callable[[], dict[str, Any]]] = []
"""The ``command`` in force, with the hashes of the ``code`` and of the ``inputs``; from Python without a command."""


def as_typed() -> str:
    return str(said[-1]()["command"])
