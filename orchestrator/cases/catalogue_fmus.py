"""FMUs of the catalogue's models: described first, so that a whole case can be checked, and built when nothing is
wrong.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any

from fmus.grid.network import Network
from fmus.toolchain.catalogue import build_model
from fmus.toolchain.extras import require
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
    from fmus.toolchain.cache import intact  # noqa: PLC0415 - needs the extra `build`
    from fmus.toolchain.exporter import kept_at  # noqa: PLC0415 - as above
    from fmus.toolchain.native_fmu import NativeFmu  # noqa: PLC0415 - as above
    from fmus.toolchain.python_fmu import PythonFmu  # noqa: PLC0415 - as above

    arguments = dict(parts) | ({"network": network} if network is not None else {})
    recipe = (NativeFmu if native else PythonFmu)(build_model(model, **arguments))
    path = kept_at(recipe)
    if intact(path):
        return PlannedFmu(None, read_description(path))
    return PlannedFmu(recipe, parse_description(path, recipe.description()))


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
