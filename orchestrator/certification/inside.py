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
from orchestrator.errors import FmuFileError, InputError
from orchestrator.fmi.archive import extract, names_in
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
    """Write an FMU with a certificate in it; where ``target`` holds others of the same FMU, this one joins them."""
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
    _check_names(fmu)
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
    tested = _unpacked(fmu, into)
    folders = sorted(place for place in (into / FOLDER).glob("*") if place.is_dir())
    if tested is None or not folders:
        raise InputError(f"{fmu}: there is no certificate in it; `gfor certify --into` writes one, and a certificate "
                         "beside an FMU is verified by its folder")  # fmt: skip
    for folder in folders:
        write_bytes(folder / FMU, tested)
    return folders


def _unpacked(fmu: Path, into: Path) -> bytes | None:
    """Unpack an FMU, which anybody may have made; gives the file that was tested, None without certificates.

    The hash of what was tested is compared with the certificates' later."""
    extract(fmu, into)
    try:
        said: dict[str, Any] = json.loads((into / _TESTED).read_bytes())
        return fmu.read_bytes()[: said["members_end"]] + b64decode(said["directory"], validate=True)
    except (OSError, KeyError, ValueError, TypeError):
        return None


def _check_names(fmu: Path) -> None:
    names = names_in(fmu)
    if taken := [name for name in names if name.startswith(f"{FOLDER}/")]:
        raise InputError(f"--into: {fmu} holds {taken[0]}; certify the FMU without certificates, and name this file "
                         "as --into: the new certificate joins those in it")  # fmt: skip
    if _MANIFEST in names:
        raise InputError(f"--into: {fmu} has a manifest of LS-REF already ({_MANIFEST}), which a certificate cannot "
                         "join; build it without reference results, or take them away")  # fmt: skip


def _others(target: Path, tested: bytes) -> Mapping[str, bytes]:
    """The certificates that a file holds, of the FMU that was tested."""
    with TemporaryDirectory() as folder:
        place = Path(folder)
        try:
            same = _unpacked(target, place) == tested
        except FmuFileError as error:
            raise InputError(f"--into: {target} exists and is no FMU: {error}; name another file") from error
        if not same:
            raise InputError(f"--into: {target} exists and is not the FMU that was tested, with certificates; name "
                             "another file")  # fmt: skip
        files = {file.relative_to(place).as_posix(): file for file in sorted((place / FOLDER).rglob("*"))}
        return {name: file.read_bytes() for name, file in files.items() if file.is_file() and name != _TESTED}


def _signature(tested: bytes) -> bytes:
    with zipfile.ZipFile(io.BytesIO(tested)) as archive:
        directory = archive.start_dir
    said = {"sha256": hashlib.sha256(tested).hexdigest(), "members_end": directory,
            "directory": b64encode(tested[directory:]).decode()}  # fmt: skip
    return (json.dumps(said, indent=1) + "\n").encode()


def _purpose(name: str) -> tuple[str, str, str]:
    if name == _TESTED:
        return _SIGNATURE
    return _PURPOSES.get(name.rpartition(".")[2], ("application/octet-stream", "other", "File of the certificate"))
