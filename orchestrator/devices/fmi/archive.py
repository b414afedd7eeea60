"""The zip archive around an FMU or SSP, opened as if a stranger had packed it.

An archive may name files outside its folder, unpack to more than a disk holds, or hide a document whose entities grow
without end. Nothing here trusts what it declares: names are checked before the first byte is written, bytes are counted
while they are written, and a model description may not define a document type."""

import lzma
import os
import stat
import struct
import unicodedata
import zipfile
import zlib
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from io import BufferedWriter
from pathlib import Path, PurePosixPath
from xml.etree import ElementTree
from xml.parsers import expat

from fmus.toolchain.removal import remove_tree
from fmus.toolchain.temporary import own_folder
from orchestrator.core.errors import FmuFileError, HostileFmuError

MODEL_DESCRIPTION = "modelDescription.xml"

MOST_FILES = 20_000
MOST_BYTES = 2 * 1024**3  # size of everything in an archive, unpacked
MOST_XML_BYTES = 64 * 1024**2
KEPT_XML_BYTES = 1_000_000
"""Of a document that is remembered once it was read; that of a large network takes much memory."""
MOST_XML_DEPTH = 64
MOST_XML_ELEMENTS = 600_000
"""Of one document: an FMU of about 200,000 variables, three elements each. A network of 9,241 buses has 484,788."""

FREE_BYTES = 64 * 1024**2
# most unpacked over packed size beyond the first `FREE_BYTES`; binaries reach 10, zip bombs 1000
MOST_RATIO = 100

_OUTSIDE = (
    "an absolute path, or one with a drive",
    "a path out of the archive's own folder",
    "a link or a device and not a file",
)
"""Entries that lead out of the folder into which they are unpacked."""

BACKSLASHES = "its archive has backslashes between folders, as old exporters on Windows wrote them"
PACK_AGAIN = "ZIP and FMI ask for '/': unpack it with a tool of Windows and pack it again, or ask for a newer export"

_CHUNK = 1 << 20
_METHODS = {zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED}
DAMAGE = (
    zipfile.BadZipFile,
    zlib.error,
    lzma.LZMAError,
    struct.error,
    EOFError,
    NotImplementedError,
    RuntimeError,
    ValueError,
    OverflowError,
)
_DEVICES = {
    "CON",
    "PRN",
    "AUX",
    "NUL",
    *(f"{port}{n}" for port in ("COM", "LPT") for n in range(1, 10)),
}
_ON_WINDOWS = os.name == "nt"


def read_model_description_text(path: Path) -> bytes:
    """The bytes of an FMU's modelDescription.xml, well-formed and without a document type."""
    return names_and_description(path)[1]


def names_and_description(path: Path) -> tuple[tuple[str, ...], bytes]:
    """The names of an FMU's files, and that text: the archive is opened and judged once for both."""
    with _opened(path, with_backslashes=True) as archive:
        names = _names(archive)
        try:
            entry = archive.getinfo(MODEL_DESCRIPTION)
        except KeyError:
            raise FmuFileError(
                f"{path}: the archive has no {MODEL_DESCRIPTION} at its top; an FMU must, so export it again"
            ) from None
        if entry.file_size > MOST_XML_BYTES:
            raise HostileFmuError(
                f"{path}: {MODEL_DESCRIPTION} has {entry.file_size} bytes; at most {MOST_XML_BYTES} are read, "
                "ask for an export with fewer variables"
            )
        with archive.open(entry) as document:
            text = document.read(MOST_XML_BYTES + 1)
    check = _checked_before if len(text) <= KEPT_XML_BYTES else check_xml
    check(path, MODEL_DESCRIPTION, text)
    return names, text


def read_member(path: Path, name: str, kind: str = "FMU") -> bytes | None:
    """The bytes of another file in an archive; None where there is no such file."""
    with _opened(path, kind, with_backslashes=True) as archive:
        if name not in archive.namelist():
            return None
        with archive.open(name) as content:
            return content.read(MOST_BYTES)


def names_in(path: Path, kind: str = "FMU", *, with_backslashes: bool = False) -> tuple[str, ...]:
    """The names of an archive's files; those with backslashes between folders are an error unless asked for."""
    with _opened(path, kind, with_backslashes=with_backslashes) as archive:
        return _names(archive)


def _names(archive: zipfile.ZipFile) -> tuple[str, ...]:
    return tuple(entry.orig_filename for entry in archive.infolist())


def listed_twice(path: Path) -> tuple[str, ...]:
    """Names of files that an archive lists more than once, with the same bytes."""
    names = [name for name in names_in(path) if not name.endswith("/")]
    return tuple(name for name, count in Counter(names).items() if count > 1)


def extract(path: Path, folder: Path | None = None) -> Path:
    """Unpack an FMU into a folder of its own.

    ``folder``: where to; by default a new temporary folder.
    Raises a `FmuFileError` if the archive is damaged, would write outside of the folder, or is larger than
    `MOST_BYTES`. Nothing is left behind then."""
    with _opened(path) as archive:
        target = own_folder("fmu") if folder is None else folder
        target.mkdir(parents=True, exist_ok=True)
        try:
            left = MOST_BYTES
            # listed twice, with the same bytes: once
            entries = {entry.filename: entry for entry in archive.infolist()}
            for entry in entries.values():
                left = _write(archive, entry, target, left, path)
        except BaseException:
            remove_tree(target)
            raise
    return target


def check_xml(path: Path, name: str, text: bytes) -> None:
    """Raise unless a document is well-formed, neither too deep nor too long, and defines no document type."""
    parser = expat.ParserCreate()
    depth = elements = 0

    def refuse_doctype(*_: object) -> None:
        raise HostileFmuError(
            f"{path}: {name} defines a document type, with which a small file can grow without end; FMI has no use for "
            "one, so do not trust this file, or ask for an export without <!DOCTYPE>",
            "entity expansion",
        )

    def enter(*_: object) -> None:
        nonlocal depth, elements
        depth, elements = depth + 1, elements + 1
        if depth > MOST_XML_DEPTH:
            raise HostileFmuError(
                f"{path}: {name} nests more than {MOST_XML_DEPTH} elements; FMI's nest 6"
            )
        if elements > MOST_XML_ELEMENTS:
            raise HostileFmuError(
                f"{path}: {name} has more than {MOST_XML_ELEMENTS} elements, which would fill the memory; ask for an "
                "export with fewer variables",
                "too many variables",
            )

    def leave(_: str) -> None:
        nonlocal depth
        depth -= 1

    parser.StartDoctypeDeclHandler = refuse_doctype
    parser.StartElementHandler, parser.EndElementHandler = enter, leave
    try:
        parser.Parse(text, True)
    except (expat.ExpatError, ValueError, LookupError) as error:  # the latter two: encodings
        raise FmuFileError(
            f"{path}: {name} is not XML: {error_text(error)}; export it again"
        ) from error


def _checked_before(path: Path, name: str, text: bytes) -> None:
    """The same of a document that may have been in order before, there or as a copy elsewhere."""
    try:
        _of_content(text)
    except FmuFileError:
        check_xml(path, name, text)  # whose error names the file


@lru_cache(maxsize=32)
def _of_content(text: bytes) -> None:
    """For the newest documents that were in order: a study reads its device's file for every point."""
    check_xml(Path(), "", text)


@contextmanager
def _opened(
    path: Path, kind: str = "FMU", *, with_backslashes: bool = False
) -> Iterator[zipfile.ZipFile]:
    """The archive, with harmless names and sizes; whatever zipfile raises becomes one error."""
    ending = f".{kind.lower()}"
    try:
        if path.is_dir():
            raise FmuFileError(f"{path}: it is a folder; give the path of an {ending}")
        if not path.is_file():
            raise FmuFileError(f"{path}: there is no such file; give the path of an {ending}")
        if not zipfile.is_zipfile(path):
            raise FmuFileError(
                f"{path}: it is not an {kind}: an {ending} is a zip archive and this file is not; export it again"
            )
        with zipfile.ZipFile(path) as archive:
            _check_entries(path, archive)
            if not with_backslashes and any("\\" in e.orig_filename for e in archive.infolist()):
                raise FmuFileError(f"{path}: {BACKSLASHES}; {PACK_AGAIN}")
            yield archive
    except DAMAGE as error:
        raise FmuFileError(
            f"{path}: the archive is damaged ({error_text(error)}); export it again, or get the file anew"
        ) from error
    except OSError as error:
        raise FmuFileError(f"{path}: the file cannot be read: {error.strerror or error}") from error


def _check_entries(path: Path, archive: zipfile.ZipFile) -> None:
    entries = archive.infolist()
    if len(entries) > MOST_FILES:
        raise HostileFmuError(
            f"{path}: the archive has {len(entries)} files; at most {MOST_FILES} are unpacked"
        )
    _check_sizes(path, sum(e.file_size for e in entries), sum(e.compress_size for e in entries))
    seen: dict[str, zipfile.ZipInfo] = {}
    for entry in entries:
        fault = _fault_of(entry)
        key = unicodedata.normalize("NFC", entry.filename.rstrip("/")).casefold()
        if fault is None and key in seen and not _harmless_twin(archive, seen[key], entry):
            differs = (
                ", with other bytes" if seen[key].filename == entry.filename else " on some systems"
            )
            fault = f"the same file as {seen[key].filename!r}{differs}"
        if fault is not None:
            raise HostileFmuError(
                f"{path}: the archive has an entry {_quote(entry.orig_filename)}, which is {fault}; do not trust this "
                "file, or ask for it to be packed again",
                "path traversal" if fault in _OUTSIDE else "hostile archive",
            )
        seen[key] = entry
    for entry in entries:
        for parent in PurePosixPath(entry.filename).parents:
            above = seen.get(unicodedata.normalize("NFC", str(parent)).casefold())
            if above is not None and not above.is_dir():
                raise HostileFmuError(
                    f"{path}: the archive has {_quote(above.filename)} as a file and as a folder; pack it again"
                )


def _harmless_twin(
    archive: zipfile.ZipFile, first: zipfile.ZipInfo, second: zipfile.ZipInfo
) -> bool:
    """Return whether two entries of one place are the same folder, or one file with the same bytes, listed twice."""
    if first.is_dir() or second.is_dir():
        return first.is_dir() and second.is_dir()
    if first.filename != second.filename or first.file_size != second.file_size:
        return False
    with archive.open(first) as one, archive.open(second) as other:
        while chunk := one.read(_CHUNK):
            if chunk != other.read(_CHUNK):
                return False
    return True


def _check_sizes(path: Path, unpacked: int, packed: int) -> None:
    if unpacked > MOST_BYTES:
        raise HostileFmuError(
            f"{path}: the archive unpacks to {unpacked} bytes; at most {MOST_BYTES} are unpacked",
            "zip bomb",
        )
    if unpacked > FREE_BYTES + MOST_RATIO * packed:
        raise HostileFmuError(
            f"{path}: the archive unpacks from {packed} to {unpacked} bytes, more than {MOST_RATIO} times as much, "
            "as zip bombs do; do not trust this file",
            "zip bomb",
        )


def _fault_of(entry: zipfile.ZipInfo) -> str | None:
    """Return what makes an entry one that is not unpacked."""
    name = entry.orig_filename.replace("\\", "/")  # by itself no harm, wherever it leads
    kind = stat.S_IFMT(entry.external_attr >> 16)
    parts = name.removesuffix("/").split("/")
    if not name or _has_control_characters(name):
        return "a name with control characters"
    if name.startswith("/") or ":" in name:
        return _OUTSIDE[0]
    if ".." in parts:
        return _OUTSIDE[1]
    if any(part in ("", ".") for part in parts):
        return "a path with an empty part"
    if _ON_WINDOWS and any(
        part.endswith((" ", ".")) or part.split(".")[0].upper() in _DEVICES for part in parts
    ):
        return "a name that Windows gives to something else"
    try:
        if any(len(part.encode()) > 255 for part in parts) or len(name.encode()) > 2000:
            return "a name too long for a file"
    except UnicodeEncodeError:
        return "a name that is not text"
    if kind not in (0, stat.S_IFREG, stat.S_IFDIR):
        return _OUTSIDE[2]
    if entry.flag_bits & 0x1:
        return "encrypted"
    if entry.compress_type not in _METHODS:
        return f"packed with method {entry.compress_type}, where FMI allows only 'deflate' and 'stored'"
    return None


def _has_control_characters(name: str) -> bool:
    """Also a zero, which is one; what can be printed has none, which is seen sooner."""
    return not name.isprintable() and any(unicodedata.category(c) == "Cc" for c in name)


def error_text(error: Exception) -> str:
    """An error's own text, cut where a file's contents made it long."""
    text = str(error) or type(error).__name__
    return text if len(text) <= 200 else text[:200] + "…"


def _quote(name: str) -> str:
    return repr(name if len(name) <= 80 else name[:77] + "...")


def _write(
    archive: zipfile.ZipFile, entry: zipfile.ZipInfo, folder: Path, left: int, path: Path
) -> int:
    """Unpack one entry; returns how many bytes may still be written."""
    target = folder.joinpath(*entry.filename.removesuffix("/").split("/"))
    if entry.is_dir():
        target.mkdir(parents=True, exist_ok=True)
        return left
    with archive.open(entry) as source, _new_file(target) as sink:
        while chunk := source.read(_CHUNK):
            left -= len(chunk)
            if left < 0:
                raise HostileFmuError(
                    f"{path}: the archive unpacks to more than {MOST_BYTES} bytes; do not trust it",
                    "zip bomb",
                )
            sink.write(chunk)
    return left


def _new_file(path: Path) -> BufferedWriter:
    try:
        return path.open("xb")
    except FileNotFoundError:  # the first of its folder
        path.parent.mkdir(parents=True, exist_ok=True)
        return path.open("xb")


_ORIGIN = {
    "author": "author",
    "version": "version",
    "description": "description",
    "generation_tool": "generationTool",
    "generated": "generationDateAndTime",
    "copyright": "copyright",
    "license": "license",
    "fmi_version": "fmiVersion",
}


def read_origin(path: Path) -> dict[str, str]:
    """Who made an FMU, when and with what; empty where its modelDescription does not say."""
    root = ElementTree.fromstring(read_model_description_text(path))
    return {name: root.get(attribute, "").strip() for name, attribute in _ORIGIN.items()}
