"""Export of a model as a native FMU, for co-simulation by FMI 2.0 or 3.0: compiled code, no Python anywhere.

It is made of the same kernel as the Python-backed FMU and gives the same answers. Beyond that it has exact
directional derivatives and may be stepped from many threads, one per instance at a time.
"""

from collections.abc import Mapping
from importlib.metadata import version as version_of
from pathlib import Path

from fmus.toolchain.archive import digest_of, guid_of, write_archive
from fmus.toolchain.cache import cache_directory
from fmus.toolchain.compiler import ENDINGS, TARGETS, compile_for, compile_library, host_platform, recipe
from fmus.toolchain.description import model_description
from fmus.toolchain.description3 import model_description_3
from fmus.toolchain.model import Model
from fmus.toolchain.native_source import FmiVersion, identity_source, native_source
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
    chosen = tuple(TARGETS) if platforms is None else platforms
    contents = _Sources(model, version).contents(chosen)
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
    sources = _Sources(model, "2.0")
    target = cache_directory("fmus") / f"native_{sources.digest[:32]}" / f"{model.name}.fmu"
    return target if target.exists() else write_archive(target, sources.contents((host,)))


class _Sources:
    """Everything an FMU is made from, with one hash over all of it."""

    def __init__(self, model: Model, version: FmiVersion) -> None:
        self._model, self._version = model, version
        self._code = native_source(model, version)
        self._icons = terminals_and_icons(model) if version == "3.0" and has_port(model) else None
        icons = [self._icons.decode()] if self._icons else []
        self.digest = digest_of(self._code, self._description("").decode(), *recipe(), *icons)

    def _description(self, guid: str) -> bytes:
        tool = f"gfor-cosim {version_of('gfor-cosim')}"
        if self._version == "3.0":
            return model_description_3(self._model, guid, self._model.name, tool)
        return model_description(self._model, guid, self._model.name, tool, native=True)

    def contents(self, platforms: tuple[str, ...]) -> dict[str, bytes]:
        """The archive's members, with a binary for each platform [FMI 2.0 names]."""
        guid = guid_of(self.digest)
        code = identity_source(guid, self.digest) + self._code
        members = {"modelDescription.xml": self._description(guid)}
        if self._icons:
            members["terminalsAndIcons/terminalsAndIcons.xml"] = self._icons
        for platform in platforms:
            ending = ENDINGS[platform]
            binaries = (
                {platform: compile_library(code, platform)}
                if self._version == "2.0"
                else {_FOLDERS_3[target]: compile_for(code, target, ending) for target in TARGETS[platform]}
            )
            for folder, library in binaries.items():
                members[f"binaries/{folder}/{self._model.name}{ending}"] = library.read_bytes()
        return members
