"""The catalogue of models: an entry-point group, so that another distribution can add its own."""

import inspect
from functools import cache
from importlib.metadata import EntryPoint
from typing import Any

from fmus.toolchain import plugins
from fmus.toolchain.model import Model
from fmus.toolchain.notes import noted

GROUP = "gfor_cosim.models"


def model_names() -> tuple[str, ...]:
    return tuple(sorted(plugins.entries_of(GROUP)))


def needs_arguments(name: str) -> bool:
    """Return whether a model can only be built for given data, such as a network."""
    return bool(_signature(name)["needs_arguments"])


def parts_of(name: str) -> dict[str, str]:
    """The parts that a model lets choose, such as ``machine`` and ``exciter``, each with the one that it has if
    nothing is chosen; empty for a model without parts."""
    return dict(_signature(name)["parts"])


def entry_of(name: str) -> EntryPoint:
    """The catalogue's entry of a model, whose code need not be loaded."""
    if name not in plugins.entries_of(GROUP):
        raise KeyError(f"there is no model {name!r}; there are: {', '.join(model_names())}")
    return plugins.entry_of(GROUP, name)


def build_model(name: str, **arguments: Any) -> Model:
    model = _factory(name)(**arguments)
    if not isinstance(model, Model):
        raise TypeError(f"catalogue entry {name!r} returned {type(model).__name__}, not a Model")
    return model


def network_of(name: str) -> Any | None:
    """The network that a grid model is built for by default, or None for other models."""
    if not _signature(name)["has_network"]:
        return None
    return inspect.signature(_factory(name)).parameters["network"].default


@cache
def _signature(name: str) -> dict[str, Any]:
    """A model's arguments, without importing it where they are noted."""

    def find() -> dict[str, Any]:
        empty = inspect.Parameter.empty
        defaults = {
            p.name: p.default for p in inspect.signature(_factory(name)).parameters.values()
        }
        return {
            "needs_arguments": empty in defaults.values(),
            "parts": {key: value for key, value in defaults.items() if isinstance(value, str)},
            "has_network": defaults.get("network", empty) is not empty,
        }

    found: dict[str, Any] = noted(entry_of(name), "signature", find)
    return found


@cache
def _factory(name: str) -> Any:
    return entry_of(name).load()
