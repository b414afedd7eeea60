"""Access to the members of an SSP archive; paths that lead out of the archive are refused."""

import hashlib
import posixpath
from pathlib import Path
from urllib.parse import unquote, urlsplit
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from fmus.toolchain.cache import intact, keep
from orchestrator.core.errors import InputError
from orchestrator.core.foreign_files import one_line, read_bytes
from orchestrator.devices.fmi.archive import check_xml, names_in, read_member
from orchestrator.systems.ssp.names import SYSTEM_FILE

_KIND = "SSP"


class SspArchive:
    def __init__(self, path: Path) -> None:
        self.path = path
        self._members = set(names_in(path, _KIND))
        self.digest = hashlib.sha256(read_bytes(path)).hexdigest()
        if SYSTEM_FILE not in self._members:
            raise InputError(
                f"{path}: the archive has no {SYSTEM_FILE} at its top; an SSP must, so export it again"
            )

    def member(self, source: str) -> str:
        try:
            uri = urlsplit(source)
        except ValueError as error:
            raise InputError(
                f"the source {source!r} is not a URI: {error}; export it again"
            ) from error
        path = unquote(uri.path)
        if (
            uri.scheme
            or uri.netloc
            or path.startswith("/")
            or "\\" in path
            or ".." in path.split("/")
        ):
            raise InputError(
                f"the source {source!r} lies outside the archive; only what is packed into the .ssp is used: "
                "export it with its resources"
            )
        if uri.fragment or uri.query or not path:
            raise InputError(
                f"the source {source!r} is not the path of a file in the archive, which is what can be read"
            )
        name = posixpath.normpath(path)
        if name not in self._members:
            raise InputError(f"the archive has no {name!r}; export it again with all its resources")
        return name

    def read(self, member: str) -> bytes:
        content = read_member(self.path, member, _KIND)
        if content is None:
            raise InputError(
                f"{self.path}: the archive has no {member!r}; export it again with all its resources"
            )
        return content

    def xml(self, member: str) -> Element:
        text = self.read(member)
        check_xml(self.path, member, text)
        try:
            return _with_plain_names(ElementTree.fromstring(text))
        except (
            ElementTree.ParseError,
            LookupError,
            ValueError,
        ) as error:  # the last two of its encoding
            raise InputError(
                f"{self.path}: {member} is not XML: {error}; export it again"
            ) from error

    def unpack(self, member: str, folder: Path) -> Path:
        """Copy a member into the cache, under its own path in a folder there; an intact copy stays."""
        target = folder / member
        return target if intact(target) else keep(target, self.read(member))


_AS_WRITTEN = {"value", "source"}
"""Attributes that are no names: values of texts, and where files lie."""


def _with_plain_names(root: Element) -> Element:
    """The same elements, with characters that steer a terminal or end a line written out in names and texts."""
    for element in root.iter():
        for key, text in element.attrib.items():
            if key not in _AS_WRITTEN:
                element.set(key, one_line(text))
    return root
