"""A vendor's DLL, or a device's file around one, wherever an FMU can stand: its FMU is built once and kept."""

import hashlib
import json
import logging
import sys
from functools import cache
from pathlib import Path

from fmus.toolchain.cache import cache_directory, intact, keep
from fmus.toolchain.extras import require
from orchestrator.core.errors import InputError
from orchestrator.core.file_hashes import sha256_of
from orchestrator.core.foreign_files import check_regular
from orchestrator.devices.sandbox import wine
from orchestrator.devices.sandbox.compiled_programs import compile_programs

DLL_ENDINGS = (".so", ".dll", ".dylib")
DEVICE_ENDING = ".toml"  # of a file that lays a circuit around a DLL
# not the folder of our own FMUs, which are trusted: a vendor's code runs in a process of its own
_KEPT = "dlls"
# beside a kept FMU, one whose DLL could not be tried at that time; each process tries once
_FOR_NOW = "for-now"

_log = logging.getLogger("gfor")
# FMUs for now that this process made, by where they would be kept for good
_tried_now: dict[Path, Path] = {}
# module whose process, closed off, reads a DLL, also for Windows, under Wine
READER = "orchestrator.devices.sandbox.dll_reading_process"


def foreign_platforms(library: Path) -> tuple[str, ...]:
    try:
        with library.open("rb") as file:
            windows = file.read(2) == b"MZ" and sys.platform == "linux"
        if windows:
            wine.find_wine()
            compile_programs()  # once, for minutes: before the DLL's time is taken
    except OSError:
        return ()  # who reads it says why it cannot
    except wine.NoWineError as error:
        raise InputError(f"{library}: {error}; or ask its author for a build for Linux") from error
    return (wine.PLATFORM,) if windows else ()


def is_vendor_file(path: Path) -> bool:
    return path.suffix.lower() in (*DLL_ENDINGS, DEVICE_ENDING)


def controller_dll(path: Path) -> tuple[Path, dict[str, str]] | None:
    """The controller DLL that a file is or names, and values of its text parameters; None where it is another file."""
    if not is_vendor_file(path) or not path.exists():
        return None
    if path.suffix.lower() != DEVICE_ENDING:
        check_regular(path)
        return path, {}
    from fmus.vendor_dll.device import DeviceFileError, read_device_file  # noqa: PLC0415 - as in `as_fmu`

    try:
        library, table = read_device_file(path)
    except DeviceFileError as error:
        raise InputError(str(error)) from error
    check_regular(library)
    texts = table.get("texts")
    given = texts if isinstance(texts, dict) else {}
    return library, {str(name): str(text) for name, text in given.items()}


def as_fmu(path: Path) -> Path:
    """The FMU of a DLL or of a device's file; every other path stays as it is."""
    if not is_vendor_file(path):
        return path
    require("building the FMU of a vendor's DLL", "ziglang")
    from fmus.vendor_dll.device import DeviceFileError, device_of, read_device_file  # noqa: PLC0415 - needs `build`
    from fmus.vendor_dll.fmu import DllError, dll_members, read_dll  # noqa: PLC0415 - as above

    check_regular(path)
    table = None
    try:
        library = path
        if path.suffix.lower() == DEVICE_ENDING:
            library, table = read_device_file(path)
            check_regular(library)
        kept = cache_directory(_KEPT) / _digest(path, library) / f"{path.stem}.fmu"
        if intact(kept) and _unchanged(kept, path):
            return kept
        for_now = _tried_now.get(kept)
        if for_now is not None and intact(for_now):
            return for_now
        texts = (table or {}).get("texts")
        given = texts if isinstance(texts, dict) else {}
        dll = read_dll(library, READER, foreign_platforms(library), given, path.parent)
        device = None if table is None else device_of(path, table, dll.interface)
        content = _archive(dll_members(dll, device=device))
        if not dll.trial.passing:
            if dll.looked:
                noted = {str(place): _hash(place) for place in (path.parent.resolve(), *dll.looked)}
                keep(_noted(kept), json.dumps(noted).encode())
            return keep(kept, content)
        _log.warning(
            "%s: its state is not saved this time: %s; the next call tries it anew",
            path,
            dll.trial.why,
        )
        _tried_now[kept] = keep(kept.parent / _FOR_NOW / kept.name, content)
        return _tried_now[kept]
    except (DllError, DeviceFileError) as error:
        raise InputError(str(error)) from error


def _noted(kept: Path) -> Path:
    """Where the places of files are noted that the DLL's text parameters name."""
    return kept.with_suffix(".files.json")


def _unchanged(kept: Path, path: Path) -> bool:
    """Tell if it was made in the same folder, from the same files; what was not there then must not be there now."""
    if not _noted(kept).exists():
        return True
    noted: dict[str, str | None] = json.loads(_noted(kept).read_text(encoding="utf-8"))
    return str(path.parent.resolve()) in noted and all(
        _hash(Path(place)) == found for place, found in noted.items()
    )


def _hash(place: Path) -> str | None:
    return sha256_of(place) if place.is_file() else None


def _archive(members: dict[str, bytes]) -> bytes:
    from fmus.toolchain.archive import packed  # noqa: PLC0415 - needs the extra `build`

    return packed(members)


def _digest(path: Path, library: Path) -> str:
    found = hashlib.sha256(_own_code())
    for file in (path, library):
        try:
            content = file.read_bytes()
        except OSError as error:
            raise InputError(
                f"{file}: cannot be read: {error.strerror}; give the vendor's .so or .dll file"
            ) from error
        found.update(hashlib.sha256(content).digest())
        found.update(file.name.encode("utf-8", "surrogateescape"))
    return found.hexdigest()[:32]


@cache
def _own_code() -> bytes:
    import fmus  # noqa: PLC0415 - the place alone

    root = Path(fmus.__file__).parent
    files = sorted(
        file for part in ("vendor_dll", "toolchain") for file in (root / part).rglob("*.[pc]*")
    )
    found = hashlib.sha256()
    for file in files:
        if file.suffix in (".py", ".c"):
            found.update(file.name.encode() + file.read_bytes())
    return found.digest()
