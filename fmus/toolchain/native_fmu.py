"""Export of a model as a native FMU, for co-simulation by FMI 2.0 or 3.0: compiled code, no Python anywhere.

It is made of the same kernel as the Python-backed FMU and gives the same answers. Beyond that it has exact
directional derivatives and may be stepped from many threads, one per instance at a time.
"""

import hashlib
from collections.abc import Mapping
from importlib.metadata import version as version_of
from pathlib import Path

from fmus.toolchain.archive import guid_of, write_archive
from fmus.toolchain.cache import cache_directory
from fmus.toolchain.compiler import ENDINGS, FLAGS, TARGETS, compile_for, compile_library, host_platform
from fmus.toolchain.description import model_description
from fmus.toolchain.description3 import model_description_3
from fmus.toolchain.model import Model
from fmus.toolchain.native_source import FmiVersion, native_source
from fmus.toolchain.terminals import has_port, terminals_and_icons

_FOLDERS_3 = {
    # zig target -> platform tuple of FMI 3.0
    "x86_64-linux-gnu.2.17": "x86_64-linux",
    "x86_64-windows-gnu": "x86_64-windows",
    "x86_64-macos": "x86_64-darwin",
    "aarch64-macos": "aarch64-darwin",
}


def export_native(
    model: Model,
    destination: Path,
    platforms: tuple[str, ...] | None = None,
    version: FmiVersion = "2.0",
    extra: Mapping[str, bytes] | None = None,
) -> Path:
    """Write ``<model name>.fmu`` into a folder.

    Parameters
    ----------
    model
        What to export.
    destination
        Folder; it is created where missing.
    platforms
        FMI 2.0 names of the platforms to compile for, by default all of them. ``darwin64`` holds code for both
        kinds of Mac.
    version
        Of FMI.
    extra
        Further members of the archive, by path.

    Returns
    -------
    pathlib.Path
        The FMU.

    Raises
    ------
    ValueError, RuntimeError
        As `compile_library`.
    """
    digest = _digest(model, version)
    chosen = tuple(TARGETS) if platforms is None else platforms
    contents = _contents_2(model, digest, chosen) if version == "2.0" else _contents_3(model, digest, chosen)
    return write_archive(destination / f"{model.name}.fmu", contents | dict(extra or {}))


def cached_native(model: Model) -> Path:
    """Return this machine's native FMU (FMI 2.0) of a model, building it only if it was not built before.

    Raises
    ------
    RuntimeError
        If there is no compiler target for this machine.
    """
    host = host_platform()
    if host is None:
        raise RuntimeError("native FMUs cannot be compiled for this machine; use the Python-backed ones")
    folder = cache_directory("fmus") / f"native_{_digest(model, '2.0')[:32]}"
    target = folder / f"{model.name}.fmu"
    return target if target.exists() else export_native(model, folder, (host,))


def _digest(model: Model, version: FmiVersion) -> str:
    """Hash over everything that the FMU is made from."""
    texts = [_source(model, version, ""), _description(model, version, "").decode(), *FLAGS]
    if version == "3.0" and has_port(model):
        texts.append(terminals_and_icons(model).decode())
    hasher = hashlib.sha256()
    for text in texts:
        hasher.update(text.encode() + b"\0")
    return hasher.hexdigest()


def _source(model: Model, version: FmiVersion, digest: str) -> str:
    return native_source(model, version, guid_of(digest), digest)


def _description(model: Model, version: FmiVersion, digest: str) -> bytes:
    tool = f"gfor-cosim {version_of('gfor-cosim')}"
    if version == "3.0":
        return model_description_3(model, guid_of(digest), model.name, tool)
    return model_description(model, guid_of(digest), model.name, tool, native=True)


def _contents_2(model: Model, digest: str, platforms: tuple[str, ...]) -> dict[str, bytes]:
    source = _source(model, "2.0", digest)
    contents = {"modelDescription.xml": _description(model, "2.0", digest)}
    for platform in platforms:
        library = compile_library(source, platform)
        contents[f"binaries/{platform}/{model.name}{ENDINGS[platform]}"] = library.read_bytes()
    return contents


def _contents_3(model: Model, digest: str, platforms: tuple[str, ...]) -> dict[str, bytes]:
    source = _source(model, "3.0", digest)
    contents = {"modelDescription.xml": _description(model, "3.0", digest)}
    if has_port(model):
        contents["terminalsAndIcons/terminalsAndIcons.xml"] = terminals_and_icons(model)
    for platform in platforms:
        for target in TARGETS[platform]:
            library = compile_for(source, target, ENDINGS[platform])
            contents[f"binaries/{_FOLDERS_3[target]}/{model.name}{ENDINGS[platform]}"] = library.read_bytes()
    return contents
