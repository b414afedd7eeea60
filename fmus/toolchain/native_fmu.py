"""The recipe for a native FMU, for co-simulation by FMI 2.0 or 3.0: compiled code, no Python anywhere.

It is made of the same kernel as the Python-backed FMU and gives the same answers. Beyond that it has exact
directional derivatives and may be stepped from many threads, one per instance at a time."""

from importlib.metadata import version as version_of

from fmus.toolchain.archive import digest_of, guid_of
from fmus.toolchain.c_text import identity_source
from fmus.toolchain.compiler import ENDINGS, TARGETS, compile_for, compile_library, recipe
from fmus.toolchain.description import model_description, with_guid
from fmus.toolchain.description3 import build_description, has_port, model_description_3, terminals_and_icons
from fmus.toolchain.exporter import this_machine
from fmus.toolchain.model import FmiVersion, Model
from fmus.toolchain.native_source import native_source

_FOLDERS_3 = {
    # zig target -> platform tuple of FMI 3.0
    "x86_64-linux-gnu.2.17": "x86_64-linux",
    "x86_64-windows-gnu": "x86_64-windows",
    "x86_64-macos": "x86_64-darwin",
    "aarch64-macos": "aarch64-darwin",
}


class NativeFmu:
    cache_prefix = "native_"

    def __init__(self, model: Model, version: FmiVersion = "2.0", *, sources: bool = False) -> None:
        self.model, self._version = (model := model.written_out), version
        self._source_file = f"{model.name}.c" if sources else ""
        self._code = native_source(model, version)
        self._icons = terminals_and_icons(model) if version == "3.0" and has_port(model) else None
        icons = [self._icons.decode()] if self._icons else []
        self._text = self._description("").decode()
        self.digest = digest_of(self._code, self._text, *recipe(), *icons)

    def _description(self, guid: str) -> bytes:
        tool = f"gfor-cosim {version_of('gfor-cosim')}"
        if self._version == "3.0":
            return model_description_3(self.model, guid, self.model.name, tool)
        return model_description(self.model, guid, self.model.name, tool, native=True, source_file=self._source_file)

    def description(self) -> bytes:
        """The text of modelDescription.xml, for which nothing is compiled."""
        return with_guid(self._text, guid_of(self.digest), "guid" if self._version == "2.0" else "instantiationToken")

    def default_platforms(self) -> tuple[str, ...]:
        return tuple(TARGETS)

    def host_platforms(self) -> tuple[str, ...]:
        """That of this machine; without compiled code there is no native FMU."""
        if host := this_machine():
            return host
        raise RuntimeError("native FMUs cannot be compiled for this machine; use the Python-backed ones")

    def contents(self, platforms: tuple[str, ...]) -> dict[str, bytes]:
        """The archive's members, with a binary for each platform [FMI 2.0 names]."""
        guid = guid_of(self.digest)
        code = identity_source(guid, self.digest) + self._code
        members = {"modelDescription.xml": self.description()}
        if self._icons:
            members["terminalsAndIcons/terminalsAndIcons.xml"] = self._icons
        if self._source_file:
            members[f"sources/{self._source_file}"] = code.encode()
            if self._version == "3.0":
                members["sources/buildDescription.xml"] = build_description(self.model.name, self._source_file)
        for platform in platforms:
            ending = ENDINGS[platform]
            binaries = (
                {platform: compile_library(code, platform)}
                if self._version == "2.0"
                else {_FOLDERS_3[target]: compile_for(code, target, ending) for target in TARGETS[platform]}
            )
            for folder, library in binaries.items():
                members[f"binaries/{folder}/{self.model.name}{ending}"] = library.read_bytes()
        return members
