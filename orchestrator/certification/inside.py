"""Certificates inside the FMU that they are of.

An FMU with certificates is the FMU that was tested, byte for byte, with members behind its own: `taken_out` gives the
tested file back, so that its hash, and with it the certificate, can be verified."""

import hashlib
import io
import json
import zipfile
from base64 import b64decode, b64encode
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from orchestrator.certification.case_file import FMU
from orchestrator.certification.experiments import experiments_of
from orchestrator.certification.files import JSON, read_record
from orchestrator.certification.issue import NTS631
from orchestrator.errors import InputError
from orchestrator.safe_files import write_bytes
from orchestrator.ssp.reference_experiment import FOLDER as LS_REF
from orchestrator.ssp.reference_experiment import manifest

FOLDER = "extra/org.gfor-cosim.certificates"
_TESTED, _MANIFEST = f"{FOLDER}/tested.json", f"{LS_REF}/fmi-ls-manifest.xml"
_PURPOSES = {
    "json": ("application/json", "result", "Figures and verdict of the certificate, with hashes of all its files"),
    "html": ("text/html", "report", "The certificate to read"),
    "nc": ("application/x-netcdf", "result", "Responses that were judged"),
    "toml": ("application/toml", "testcase", "System in which the FMU was tested"),
    "pdf": ("application/pdf", "report", "The certificate to print"),
    "csv": ("text/csv", "result", "Stimuli or reference results of an experiment"),
    "ssv": ("application/x-ssp-parameter-set", "parameter", "Parameters of an experiment"),
    "exp": ("application/x-ma-hs-experiments", "experiment/validation", "A row of the certificate up to its event"),
}
_SIGNATURE = ("application/json", "signature", "SHA-256 of the FMU that was tested")


def put_inside(folder: Path, fmu: Path, target: Path) -> Path:
    """Write an FMU with a certificate in it; where ``target`` holds others of the same FMU, this one joins them.

    ``folder``: The certificate's.
    ``fmu``: The FMU that was tested."""
    tested, members = check_target(fmu, target)
    content = read_record(folder / JSON)
    own = f"{FOLDER}/{content.get('code', NTS631)}"
    members = {name: data for name, data in members.items() if not name.startswith(f"{own}/")}
    names = [JSON, *(name for name in content["files"] if name != FMU)]
    members |= {f"{own}/{name}": (folder / name).read_bytes() for name in names}
    members |= {f"{own}/{name}": data for name, data in experiments_of(folder, content).items()}
    members[_TESTED] = _signature(tested)
    members[_MANIFEST] = manifest({f"../{name.removeprefix('extra/')}": (*_purpose(name), data)
                                   for name, data in members.items() if name != _MANIFEST})  # fmt: skip
    buffer = io.BytesIO(tested)
    with zipfile.ZipFile(buffer, "a", zipfile.ZIP_DEFLATED) as archive:
        for name, data in members.items():
            archive.writestr(zipfile.ZipInfo(name, (2020, 1, 1, 0, 0, 0)), data, zipfile.ZIP_DEFLATED)
    write_bytes(target, buffer.getvalue())
    return target


def check_target(fmu: Path, target: Path) -> tuple[bytes, Mapping[str, bytes]]:
    """Refuse an FMU or a file that a certificate cannot go into; gives the FMU and the members that others left."""
    tested = fmu.read_bytes()
    _check_names(tested, fmu)
    return tested, _others(target, tested) if target.exists() else {}


@contextmanager
def laid_out(certificate: Path) -> Iterator[list[Path]]:
    """Folders of certificates: those of an FMU, as long as the context lasts, or the one that is given."""
    if certificate.suffix.lower() != ".fmu":
        yield [certificate]
        return
    with TemporaryDirectory() as folder:
        yield taken_out(certificate, Path(folder))


def taken_out(fmu: Path, into: Path) -> list[Path]:
    """Lay each certificate of an FMU into a folder of its own, beside the FMU that was tested."""
    content = fmu.read_bytes()
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            members = {name: archive.read(name) for name in archive.namelist() if name.startswith(f"{FOLDER}/")}
    except (OSError, zipfile.BadZipFile, RuntimeError, ValueError) as error:
        raise InputError(f"{fmu}: it is no FMU: {error}") from error
    tested = _tested(content, members)
    if tested is None:
        raise InputError(f"{fmu}: there is no certificate in it; `gfor certify --into` writes one, and a certificate "
                         "beside an FMU is verified by its folder")  # fmt: skip
    codes = sorted({name.split("/")[2] for name in members if name.count("/") > 2})
    for name, data in [*members.items(), *((f"{FOLDER}/{code}/{FMU}", tested) for code in codes)]:
        parts = name.split("/")[2:]
        if any(part in ("", ".", "..") or "\\" in part or ":" in part for part in parts):
            raise InputError(f"{fmu}: the member {name!r} leads out of its folder")
        write_bytes(into.joinpath(*parts), data)
    return [into / code for code in codes]


def _check_names(tested: bytes, fmu: Path) -> None:
    try:
        with zipfile.ZipFile(io.BytesIO(tested)) as archive:
            names = archive.namelist()
    except zipfile.BadZipFile as error:
        raise InputError(f"--into: {fmu} is no FMU, which alone takes a certificate: {error}") from error
    if taken := [name for name in names if name.startswith(f"{FOLDER}/")]:
        raise InputError(f"--into: {fmu} holds {taken[0]}; certify the FMU without certificates, and name this file "
                         "as --into: the new certificate joins those in it")  # fmt: skip
    if _MANIFEST in names:
        raise InputError(f"--into: {fmu} has a manifest of LS-REF already ({_MANIFEST}), which a certificate cannot "
                         "join; build it without reference results, or take them away")  # fmt: skip


def _others(target: Path, tested: bytes) -> Mapping[str, bytes]:
    """The certificates that a file holds, of the FMU that was tested."""
    content = target.read_bytes()
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            found = {name: archive.read(name) for name in archive.namelist() if name.startswith(f"{FOLDER}/")}
    except zipfile.BadZipFile as error:
        raise InputError(f"--into: {target} exists and is no FMU: {error}; name another file") from error
    if _tested(content, found) != tested:
        raise InputError(f"--into: {target} exists and is not the FMU that was tested, with certificates; name another "
                         "file")  # fmt: skip
    return {name: data for name, data in found.items() if name != _TESTED}


def _signature(tested: bytes) -> bytes:
    with zipfile.ZipFile(io.BytesIO(tested)) as archive:
        directory = archive.start_dir
    said = {"sha256": hashlib.sha256(tested).hexdigest(), "members_end": directory,
            "directory": b64encode(tested[directory:]).decode()}  # fmt: skip
    return (json.dumps(said, indent=1) + "\n").encode()


def _tested(content: bytes, members: Mapping[str, bytes]) -> bytes | None:
    """The file that was tested, from the one that holds certificates; its hash is compared with theirs later."""
    try:
        said: dict[str, Any] = json.loads(members[_TESTED])
        return content[: said["members_end"]] + b64decode(said["directory"], validate=True)
    except (KeyError, ValueError, TypeError):
        return None


def _purpose(name: str) -> tuple[str, str, str]:
    if name == _TESTED:
        return _SIGNATURE
    return _PURPOSES.get(name.rpartition(".")[2], ("application/octet-stream", "other", "File of the certificate"))
