"""FMUs of the catalogue's models."""

import os
import zipfile
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

from fmus.toolchain.catalogue import build_model, model_names, needs_arguments, parts_of
from fmus.toolchain.model import FmiVersion, Model
from orchestrator.core.asked import flag, names
from orchestrator.core.asked import path as path_of
from orchestrator.core.errors import InputError
from orchestrator.face.api.methods import by_known_keywords


def catalogue_model(name: str, parts: Mapping[str, str] | None = None) -> Model:
    """A model of the catalogue that needs no further data.

    Parameters
    ----------
    name
        Of the model.
    parts
        What a model with parts is made of, such as ``{"machine": "genrou", "exciter": "sexs"}``.

    Raises
    ------
    InputError
        If there is none of that name, it needs a network, has no such part, or its equations break a rule of the model
        builder.
    """
    chosen = known_parts(name, parts)
    with building(name):
        return build_model(name, **chosen)


def known_parts(name: str, parts: Mapping[str, str] | None = None) -> dict[str, str]:
    """The parts that are chosen of a model, checked by the catalogue's notes: the model is not built for it.

    Parameters
    ----------
    name
        Of the model.
    parts
        As in `catalogue_model`.

    Raises
    ------
    InputError
        If there is none of that name, it needs a network, or has no such part.
    """
    if name not in model_names():
        raise InputError(f"there is no model {name!r}; there are: {', '.join(model_names())}")
    if needs_arguments(name):
        raise InputError(
            f"model {name!r} is built from the [network] table of a case file, by `gfor run` or `gfor modes`"
        )
    if not isinstance(parts, Mapping | None):
        raise InputError(
            f"parts = {parts!r}; give models by part, such as {{'machine': 'genrou', 'exciter': 'sexs'}}"
        )
    chosen, known = dict(parts or {}), parts_of(name)
    unknown = [part for part in chosen if part not in known]
    if unknown:
        has = f"it is made of {', '.join(known)}" if known else "'synchronous_generator' has some"
        raise InputError(f"model {name!r} has no part {unknown[0]!r} to choose; {has}")
    return chosen


@contextmanager
def building(name: str) -> Iterator[None]:
    """Say with an `InputError` of which model the equations break a rule of the model builder, inside ``with``.

    Parameters
    ----------
    name
        Of the model that is built inside.

    Raises
    ------
    InputError
        If the model builder refuses it.
    """
    try:
        yield
    except ValueError as error:
        raise InputError(f"model {name!r} cannot be built: {error}") from error


@by_known_keywords
def build(
    model: str | Model,
    folder: str | Path = ".",
    *,
    native: bool = False,
    fmi: FmiVersion = "2.0",
    platforms: Sequence[str] | None = None,
    extra: Mapping[str, bytes] | None = None,
    parts: Mapping[str, str] | None = None,
    reference: bool = False,
    sources: bool = False,
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
        Compile for these; by default for this machine's, native ones for all. ``"wasm32-wasip2"``, of native FMUs of
        FMI 3.0, adds a WebAssembly component by the draft of FMI-LS-WASM; it needs the program wasm-tools.
    extra
        Members for the FMU's ``extra/`` folder, by path, such as ``{"extra/notes.txt": b"..."}``.
    parts
        What a generator is made of, such as ``{"machine": "genrou", "exciter": "sexs"}``.
    reference
        Whether the FMU gets a smoke test with reference results and its state at the start, by FMI's layered standard
        LS-REF. For that it is run here.
    sources
        Whether a native FMU gets its C source as well, for tools that compile.

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
    if not isinstance(model, str | Model):
        raise InputError(
            f"model = {model!r}; give the name of a model of the catalogue, or a model of your own"
        )
    flag(native, "native")
    if fmi not in ("2.0", "3.0"):
        raise InputError(f"fmi = {fmi!r}; choose from '2.0' and '3.0'")
    if fmi != "2.0" and not native:
        raise InputError(
            "FMI 3.0 is for native FMUs: pythonfmu's wrapper speaks FMI 2.0; build a native one"
        )
    flag(reference, "reference")
    flag(sources, "sources")
    if sources and not native:
        raise InputError(
            "only native FMUs are made of C source that a tool can compile; build a native one"
        )
    from fmus.toolchain.component import PLATFORM  # noqa: PLC0415 - as above
    from fmus.toolchain.exporter import export  # noqa: PLC0415 - needs the extra `build`
    from fmus.toolchain.native_fmu import PLATFORMS, NativeFmu  # noqa: PLC0415 - as above
    from fmus.toolchain.python_fmu import PythonFmu  # noqa: PLC0415 - as above

    made = catalogue_model(model, parts) if isinstance(model, str) else model
    chosen = None if platforms is None else _platforms(platforms, PLATFORMS)
    if PLATFORM in (chosen or ()) and fmi != "3.0":
        raise InputError(
            f"platforms: {PLATFORM!r} is for native FMUs of FMI 3.0; build it with native=True, fmi='3.0'"
        )
    members, place = _members(extra), _folder(folder)
    recipe = NativeFmu(made, fmi, sources=sources) if native else PythonFmu(made)
    path = export(recipe, place, chosen or None, members)
    return with_reference(path) if reference else path


def with_reference(path: Path) -> Path:
    """Add the smoke test of LS-REF to an FMU for this machine, and return its path.

    Raises
    ------
    ComponentError
        If the FMU does not run here.
    """
    from fmus.toolchain.archive import write_archive  # noqa: PLC0415 - with what builds FMUs
    from orchestrator.systems.ssp.reference_experiment import reference_members  # noqa: PLC0415 - needs a model to run

    added = reference_members(path)
    with zipfile.ZipFile(path) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    return write_archive(path, members | added)


def _platforms(given: Sequence[str], known: Collection[str]) -> tuple[str, ...]:
    listed = names(given, "platforms")
    wrong = [name for name in listed if name not in known]
    if wrong:
        raise InputError(
            f"platforms: there is no platform {wrong[0]!r}; choose from {', '.join(sorted(known))}"
        )
    return listed


def _members(extra: Mapping[str, bytes] | None) -> dict[str, bytes]:
    """Members of the archive, none of which leads out of the folder or replaces a part of the FMU."""
    if extra is not None and not isinstance(extra, Mapping):
        raise InputError(
            f"extra = {extra!r}; give bytes by path, such as {{'extra/notes.txt': b'...'}}"
        )
    for name, content in (extra or {}).items():
        parts = name.split("/") if isinstance(name, str) else []
        outside = (
            len(parts) < 2 or parts[0] != "extra" or any(part in ("", ".", "..") for part in parts)
        )
        if outside or any(letter in name for letter in "\\:\0"):
            raise InputError(
                f"extra: {name!r} is not a path in the FMU's folder extra/; write it with /, such as 'extra/notes.txt'"
            )
        if not isinstance(content, bytes):
            raise InputError(
                f"extra: the content of {name!r} is of type {type(content).__name__}; give bytes"
            )
    return dict(extra or {})


def _folder(given: str | Path) -> Path:
    """The folder for the FMU, which can be written to."""
    place = path_of(given, "folder", "folder")
    try:
        place.mkdir(parents=True, exist_ok=True)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(
            f"folder = {str(place)!r}: an FMU cannot be written there: {reason}"
        ) from error
    if not os.access(place, os.W_OK):
        raise InputError(
            f"folder = {str(place)!r}: an FMU cannot be written there: it is closed to you"
        )
    return place
