"""The members of an SSP archive, and nothing outside it."""

import hashlib
import posixpath
import uuid
import zipfile
import zlib
from pathlib import Path
from urllib.parse import unquote, urlsplit
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from orchestrator.errors import InputError
from orchestrator.ssp.names import SYSTEM_FILE


class SspArchive:
    """An .ssp file on disk.

    Attributes
    ----------
    digest
        SHA-256 of the file.

    Raises
    ------
    InputError
        If there is no such file, or it is no SSP.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        if not path.is_file():
            raise InputError(f"{path}: there is no such file; give the path of an .ssp")
        if not zipfile.is_zipfile(path):
            raise InputError(
                f"{path}: it is not an SSP: an .ssp is a zip archive and this file is not; export it again"
            )
        self.digest = hashlib.sha256(path.read_bytes()).hexdigest()
        with zipfile.ZipFile(path) as archive:
            self._members = set(archive.namelist())
        if SYSTEM_FILE not in self._members:
            raise InputError(f"{path}: the archive has no {SYSTEM_FILE} at its top; an SSP must, so export it again")

    def member(self, source: str) -> str:
        """Name of the member that a relative URI means.

        Raises
        ------
        InputError
            If it leads out of the archive, or the archive does not have it.
        """
        uri = urlsplit(source)
        path = unquote(uri.path)
        if uri.scheme or uri.netloc or path.startswith("/") or "\\" in path or ".." in path.split("/"):
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
        """Contents of a member.

        Raises
        ------
        InputError
            If the archive is damaged.
        """
        try:
            with zipfile.ZipFile(self.path) as archive:
                return archive.read(member)
        except (zipfile.BadZipFile, zlib.error, NotImplementedError, RuntimeError, EOFError) as error:
            raise InputError(f"{self.path}: the archive is damaged ({error}); export it again") from error

    def xml(self, member: str) -> Element:
        """Root element of a member.

        Raises
        ------
        InputError
            If it is not XML.
        """
        try:
            return ElementTree.fromstring(self.read(member))
        except ElementTree.ParseError as error:
            raise InputError(f"{self.path}: {member} is not XML: {error}; export it again") from error

    def unpack(self, member: str, folder: Path) -> Path:
        """Copy a member into a folder, under its own path there; what is there already stays."""
        target = folder / member
        if not target.exists():
            target.parent.mkdir(parents=True, exist_ok=True)
            partial = target.with_name(f"{target.name}.{uuid.uuid4().hex}.part")
            partial.write_bytes(self.read(member))
            partial.replace(target)
        return target
