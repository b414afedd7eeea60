"""FMUs of the catalogue's models."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from fmus.toolchain.catalogue import build_model, model_names, needs_arguments
from fmus.toolchain.extras import require
from fmus.toolchain.model import FmiVersion, Model
from orchestrator.errors import InputError


def catalogue_model(name: str) -> Model:
    """A model of the catalogue that needs no further data.

    Raises
    ------
    InputError
        If there is none of that name, or it needs a network.
    """
    if name not in model_names():
        raise InputError(f"there is no model {name!r}; there are: {', '.join(model_names())}")
    if needs_arguments(name):
        raise InputError(
            f"model {name!r} is built from the [network] table of a case file, by `gfor run` or `gfor modes`"
        )
    return build_model(name)


def build(
    model: str | Model,
    folder: str | Path = ".",
    *,
    native: bool = False,
    fmi: FmiVersion = "2.0",
    platforms: Sequence[str] | None = None,
    extra: Mapping[str, bytes] | None = None,
) -> Path:
    """Build the FMU of a model; returns its path.

    Parameters
    ----------
    model
        Name of a model of the catalogue, or a model of your own.
    folder
        Where the FMU is written.
    native
        Compiled, with no Python in it.
    fmi
        ``"2.0"``, or ``"3.0"`` for native ones.
    platforms
        Compile for these; by default for this machine's, native ones for all.
    extra
        Members for the FMU's ``extra/`` folder, by path.

    Raises
    ------
    InputError
        If there is no such model, or it cannot be built like that.
    MissingLibraryError
        If the extra that builds FMUs is not installed.

    Examples
    --------
    >>> import orchestrator as gfor
    >>> gfor.build("infinite_bus").name
    'infinite_bus.fmu'
    """
    if fmi not in ("2.0", "3.0"):
        raise InputError(f"fmi = {fmi!r}; choose from '2.0' and '3.0'")
    if fmi != "2.0" and not native:
        raise InputError("FMI 3.0 is for native FMUs: pythonfmu's wrapper speaks FMI 2.0; build a native one")
    require("building FMUs", "casadi", "pythonfmu", "ziglang")
    from fmus.toolchain.exporter import export  # noqa: PLC0415 - needs the extra `build`
    from fmus.toolchain.native_fmu import NativeFmu  # noqa: PLC0415 - as above
    from fmus.toolchain.python_fmu import PythonFmu  # noqa: PLC0415 - as above

    made = catalogue_model(model) if isinstance(model, str) else model
    recipe = NativeFmu(made, fmi) if native else PythonFmu(made)
    return export(recipe, Path(folder), tuple(platforms) if platforms else None, extra)
