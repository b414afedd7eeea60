"""FMUs of the catalogue's models: described first, so that a whole case can be checked, and built when nothing is
wrong.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any

from fmus.grid.network import Network
from fmus.toolchain.catalogue import build_model, entry_of
from fmus.toolchain.extras import require
from fmus.toolchain.notes import noted
from orchestrator.fmi.description import FmuDescription, parse_description, read_description


@dataclass(frozen=True, eq=False)
class PlannedFmu:
    """An FMU of the catalogue that may have to be built.

    Attributes
    ----------
    recipe
        What it is built by; None if it is there.
    description
        Its description; of one that is not there, as it will be.
    """

    recipe: Any
    description: FmuDescription


@cache
def plan_fmu(
    model: str, network: Network | None = None, native: bool = False, parts: tuple[tuple[str, str], ...] = ()
) -> PlannedFmu:
    """FMU of a catalogue's model, described and not yet built.

    Parameters
    ----------
    model
        Its name.
    network
        That a grid is built for.
    native
        Whether it is compiled, with no Python in it.
    parts
        What a model with parts is made of, as pairs of a key and a part's name.

    Raises
    ------
    KeyError
        If no model has that name.
    MissingLibraryError
        If the extra that builds FMUs is not installed.
    """
    require(f"building the FMU {model!r} of the catalogue", "casadi", "pythonfmu", "ziglang")
    from fmus.toolchain.cache import cache_directory, intact  # noqa: PLC0415 - needs the extra `build`

    recipes: list[Any] = []

    def find() -> list[str]:
        recipes.append(_recipe(model, network, native, parts))
        return _place(recipes[0])

    asked = f"fmu {model} {native} {parts!r} {network!r}"
    folder = cache_directory("fmus")
    path = folder.joinpath(*noted(entry_of(model), asked, find))
    if intact(path):
        return PlannedFmu(None, read_description(path))
    recipe = recipes[0] if recipes else _recipe(model, network, native, parts)
    return PlannedFmu(
        recipe, parse_description(cache_directory("fmus").joinpath(*_place(recipe)), recipe.description())
    )


def _recipe(model: str, network: Network | None, native: bool, parts: tuple[tuple[str, str], ...]) -> Any:
    """What an FMU is built by; for its hash the model is built, which takes up to seconds."""
    from fmus.toolchain.native_fmu import NativeFmu  # noqa: PLC0415 - needs the extra `build`
    from fmus.toolchain.python_fmu import PythonFmu  # noqa: PLC0415 - as above

    arguments = dict(parts) | ({"network": network} if network is not None else {})
    return (NativeFmu if native else PythonFmu)(build_model(model, **arguments))


def _place(recipe: Any) -> list[str]:
    """Folder and file at which an FMU is kept, below the folder of all kept FMUs."""
    from fmus.toolchain.exporter import kept_at  # noqa: PLC0415 - needs the extra `build`

    path = kept_at(recipe)
    return [path.parent.name, path.name]


@cache
def build_fmu(planned: PlannedFmu) -> FmuDescription:
    """Build the FMU if it is not there."""
    if planned.recipe is None:
        return planned.description
    from fmus.toolchain.exporter import cached  # noqa: PLC0415 - needs the extra `build`

    return read_description(cached(planned.recipe))


def catalogue_fmu(model: str, network: Network | None = None, native: bool = False) -> FmuDescription:
    """FMU of a catalogue's model, built once on each machine.

    Raises
    ------
    KeyError, MissingLibraryError
        As `plan_fmu`.
    """
    return build_fmu(plan_fmu(model, network, native))
