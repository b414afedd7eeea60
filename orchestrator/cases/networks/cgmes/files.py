"""CGMES files, as pypowsybl reads them: a zip of profiles, a zip of such zips, or a folder of either."""

import io
import logging
import zipfile
from importlib import import_module
from pathlib import Path
from typing import Any

from fmus.toolchain.extras import require
from orchestrator.core.errors import InputError, few
from orchestrator.core.foreign_files import read_bytes

# of all profiles together, unpacked: twenty times a national grid of 10,000 buses
MOST_BYTES = 2_000_000_000
_NEEDED = {
    "EQ": "EquipmentCore",
    "SSH": "SteadyStateHypothesis",
    "TP": "Topology",
    "SV": "StateVariables",
}
"""Profile → word in the address of its version, in the file's head."""

_HEAD = 64 * 1024  # bytes of a file in which its profile is looked for


def load_cgmes(path: Path, profiles: dict[str, bytes] | None = None) -> Any:
    profiles = profiles_of(path) if profiles is None else profiles
    require(f"reading the CGMES model {path.name}", "pypowsybl")
    logging.getLogger("powsybl").setLevel(logging.CRITICAL)
    powsybl: Any = import_module("pypowsybl.network")  # seconds to import, and needed only here
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_STORED) as archive:
        for name, content in profiles.items():
            archive.writestr(name, content)
    packed.seek(0)
    try:
        return powsybl.load_from_binary_buffers([packed])
    except Exception as error:  # whatever comes through from Java
        said = str(error).strip().splitlines()[0] if str(error).strip() else type(error).__name__
        raise InputError.at(
            f"{path}", f"pypowsybl cannot read it as CGMES: {said}; check the export"
        ) from error


def profiles_of(path: Path) -> dict[str, bytes]:
    if not path.exists():
        raise InputError.at(
            f"{path}",
            "there is no such file; give a zip or a folder with the profiles EQ, SSH, TP and SV",
        )
    files = sorted(p for p in path.iterdir() if p.is_file()) if path.is_dir() else [path]
    found: dict[str, bytes] = {}
    try:
        for file in files:
            if file.suffix.lower() == ".zip":
                _unpack(path, read_bytes(file), found)
            elif file.suffix.lower() == ".xml":
                found[file.name] = read_bytes(file)
    except (zipfile.BadZipFile, EOFError, NotImplementedError, RuntimeError) as error:
        raise InputError.at(
            f"{file}", f"it is no zip archive that can be read: {error}; export the model once more"
        ) from error
    if not found:
        raise InputError.at(
            f"{path}",
            "it holds no .xml files; give a zip or a folder with the profiles EQ, SSH, TP and SV",
        )
    heads = [content[:_HEAD].decode("utf-8", errors="replace") for content in found.values()]

    def is_there(profile: str, word: str) -> bool:
        in_heads = any(word in head or f"/{profile}/" in head for head in heads)
        return in_heads or any(f"_{profile}" in name.upper() for name in found)

    missing = [profile for profile, word in _NEEDED.items() if not is_there(profile, word)]
    if missing:
        raise InputError.at(
            f"{path}",
            f"the {('profiles' if len(missing) > 1 else 'profile')} {', '.join(missing)} "
            f"{('are' if len(missing) > 1 else 'is')} missing among {few(found, 8)}; "
            "export the solved model with EQ, SSH, TP and SV",
        )
    return found


def _unpack(path: Path, content: bytes, found: dict[str, bytes], depth: int = 0) -> None:
    """Add the .xml files of a zip, and those of zips in it; what else lies in it is left."""
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        for entry in archive.infolist():
            suffix = Path(entry.filename).suffix.lower()
            if sum(map(len, found.values())) + entry.file_size > MOST_BYTES:
                raise InputError.at(
                    f"{path}",
                    f"its profiles have more than {MOST_BYTES} bytes; no larger model is read",
                )
            if suffix == ".xml":
                found[Path(entry.filename).name] = archive.read(entry)
            elif suffix == ".zip" and depth == 0:
                _unpack(path, archive.read(entry), found, 1)
