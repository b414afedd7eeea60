"""FMUs of the catalogue's models: described first, so that a whole case can be checked, and built when nothing is
wrong."""

import re
from dataclasses import dataclass, replace
from functools import cache, partial
from importlib.util import find_spec
from typing import Any

from fmus.grid.network import Network
from fmus.toolchain.catalogue import build_model, entry_of
from fmus.toolchain.notes import known, noted
from orchestrator.devices.fmi.description import (
    FmuDescription,
    parse_description,
    platforms_of,
    read_description,
)

_TO_COME = "not-built"  # identity of an FMU that is not there
_IDENTITY, _START = re.compile(r'(guid|generationTool)="([^"]*)"'), "<InitialUnknowns"
"""All that the description of a large network, which takes seconds to read, differs by once it is built."""
_described: dict[str, tuple[Any, str]] = {}
"""The newest models whose description was asked for, and that text, by what was asked; most of them are built next."""


@dataclass(frozen=True, eq=False)
class PlannedFmu:
    model: str
    network: Network | None
    native: bool
    parts: tuple[tuple[str, str], ...]
    # its description; of one that is not there, as it will be, but for its identity and the dependencies of its
    # outputs, which need its equations
    description: FmuDescription
    is_there: bool  # whether it is built already


_plans: dict[str, PlannedFmu] = {}
"""Plans of the FMUs that this process built or found built, by their paths."""


@cache
def plan_fmu(
    model: str,
    network: Network | None = None,
    native: bool = False,
    parts: tuple[tuple[str, str], ...] = (),
) -> PlannedFmu:
    """FMU of a catalogue's model, described and not yet built."""
    from fmus.toolchain.cache import cache_directory, intact  # noqa: PLC0415 - needs the extra `build`

    place = known(entry_of(model), _cache_key(model, network, native, parts))
    if place is not None and intact(path := cache_directory("fmus").joinpath(*place)):
        return PlannedFmu(model, network, native, parts, read_description(path), is_there=True)
    name, text = noted(
        entry_of(model),
        f"sketch of {_cache_key(model, network, native, parts)}",
        partial(_sketch, model, network, native, parts),
    )
    path = cache_directory("fmus") / _TO_COME / f"{name}.fmu"
    return PlannedFmu(
        model, network, native, parts, parse_description(path, text.encode()), is_there=False
    )


def _sketch(
    model: str, network: Network | None, native: bool, parts: tuple[tuple[str, str], ...]
) -> tuple[str, str]:
    """Name of an FMU that is not there, and its description without dependencies, which take long."""
    from fmus.toolchain.description import model_description  # noqa: PLC0415 - imports what writes equations

    sketch = build_model(model, **_arguments(network, parts))
    while len(_described) >= 8:  # of cases that failed
        _described.pop(next(iter(_described)))
    text = model_description(
        sketch, _TO_COME, sketch.name, "", native=native, listed=False
    ).decode()
    _described[_cache_key(model, network, native, parts)] = sketch, text
    return sketch.name, text


def _cache_key(
    model: str, network: Network | None, native: bool, parts: tuple[tuple[str, str], ...]
) -> str:
    return f"fmu {model} {native} {parts!r} {network!r}"


def _arguments(network: Network | None, parts: tuple[tuple[str, str], ...]) -> dict[str, Any]:
    return dict(parts) | ({"network": network} if network is not None else {})


def _recipe(planned: PlannedFmu) -> Any:
    """Return what an FMU is built by; for its hash the model is built, which takes up to minutes."""
    from fmus.toolchain.native_fmu import NativeFmu  # noqa: PLC0415 - needs the extra `build`
    from fmus.toolchain.python_fmu import PythonFmu  # noqa: PLC0415 - as above

    kept = _described.get(_cache_key(planned.model, planned.network, planned.native, planned.parts))
    made = (
        kept[0]
        if kept
        else build_model(planned.model, **_arguments(planned.network, planned.parts))
    )
    return (NativeFmu if planned.native else PythonFmu)(made)


def _place(recipe: Any) -> list[str]:
    """Folder and file at which an FMU is kept, below the folder of all kept FMUs."""
    from fmus.toolchain.exporter import kept_at  # noqa: PLC0415 - needs the extra `build`

    path = kept_at(recipe)
    return [path.parent.name, path.name]


@cache
def build_fmu(planned: PlannedFmu) -> FmuDescription:
    description = _built(planned)
    _plans[str(description.path)] = planned
    return description


def _built(planned: PlannedFmu) -> FmuDescription:
    if planned.is_there:
        return planned.description
    from fmus.toolchain.exporter import cached  # noqa: PLC0415 - needs the extra `build`

    recipes: list[Any] = []

    def find() -> list[str]:
        recipes.append(_recipe(planned))
        return _place(recipes[0])

    asked = _cache_key(planned.model, planned.network, planned.native, planned.parts)
    noted(entry_of(planned.model), asked, find)
    recipe = recipes[0] if recipes else _recipe(planned)
    path, told, (_, text) = (
        cached(recipe),
        recipe.description().decode(),
        _described.pop(asked, (None, "")),
    )
    if (
        _IDENTITY.sub("", told, 2).partition(_START)[0]
        != _IDENTITY.sub("", text, 2).partition(_START)[0]
    ):
        return read_description(path)
    (_, guid), (_, tool) = _IDENTITY.findall(told, 0, 4096)
    return replace(
        planned.description,
        path=path,
        guid=guid,
        generation_tool=tool,
        platforms=platforms_of(path),
    )


def catalogue_fmu(
    model: str, network: Network | None = None, native: bool = False
) -> FmuDescription:
    """FMU of a catalogue's model, built once on each machine."""
    return build_fmu(plan_fmu(model, network, native))


def quickest_fmu(model: str) -> FmuDescription:
    """FMU of a model for many runs by itself: without Python in it where this machine compiles.

    Both kinds compute the same to the last bit; that with Python reads its outputs in Python after every step."""
    return catalogue_fmu(model, native=_compiles())


def quickest_twin(description: FmuDescription) -> FmuDescription:
    """FMU of the same model and parts, as `quickest_fmu`; itself where it is not of the catalogue, or of a network."""
    planned = _plans.get(str(description.path))
    if planned is None or planned.network is not None or planned.native or not _compiles():
        return description
    return build_fmu(plan_fmu(planned.model, None, native=True, parts=planned.parts))


def _compiles() -> bool:
    return find_spec("ziglang") is not None
