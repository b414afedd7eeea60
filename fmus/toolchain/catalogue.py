"""The catalogue of models: an entry-point group, so that another distribution can add its own."""

import inspect
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from typing import Any

from fmus.toolchain.extras import require
from fmus.toolchain.model import Model

GROUP = "gfor_cosim.models"


def model_names() -> tuple[str, ...]:
    """Names of all models, sorted."""
    return tuple(sorted(_entries()))


def needs_arguments(name: str) -> bool:
    """Whether a model can only be built for given data, such as a network."""
    parameters = inspect.signature(_factory(name)).parameters.values()
    return any(p.default is inspect.Parameter.empty for p in parameters)


def parts_of(name: str) -> dict[str, str]:
    """What a model can be made of, such as ``machine`` and ``exciter``, each with the part that it is made of if
    nothing is chosen; empty for a model without parts.
    """
    parameters = inspect.signature(_factory(name)).parameters.values()
    return {p.name: p.default for p in parameters if isinstance(p.default, str)}


def build_model(name: str, **arguments: Any) -> Model:
    """Build one model of the catalogue.

    Raises
    ------
    KeyError
        If no model has that name; the message lists all models.
    """
    model = _factory(name)(**arguments)
    if not isinstance(model, Model):
        raise TypeError(f"catalogue entry {name!r} returned {type(model).__name__}, not a Model")
    return model


def network_of(name: str) -> Any | None:
    """The network that a grid model is built for by default, or None for other models."""
    parameter = inspect.signature(_factory(name)).parameters.get("network")
    return None if parameter is None or parameter.default is inspect.Parameter.empty else parameter.default


@cache
def _entries() -> dict[str, EntryPoint]:
    """By name; looking through all installed distributions takes tens of milliseconds."""
    return {entry.name: entry for entry in entry_points(group=GROUP)}


@cache
def _factory(name: str) -> Any:
    found = _entries().get(name)
    if found is None:
        raise KeyError(f"there is no model {name!r}; there are: {', '.join(model_names())}")
    require(f"the model {name!r} of the catalogue", "casadi")
    return found.load()
