"""Certificates inside the FMU that they are of.

An FMU with certificates is the FMU that was tested, byte for byte, with members behind its own: `taken_out` gives the
tested file back, so that its hash, and with it the certificate, can be verified."""

import hashlib
import io
import json
import zipfile
from base64 import b64decode, b64encode
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from orchestrator.cases.case import load_case
from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.core.arrays import Numbers
from orchestrator.core.errors import CosimError, FmuFileError, InputError, few
from orchestrator.core.options import Option, command
from orchestrator.core.safe_files import write_bytes
from orchestrator.devices.fmi.archive import DAMAGE, extract, names_in
from orchestrator.devices.fmi.bound_component import BoundComponent
from orchestrator.devices.fmi.component import Component
from orchestrator.output.signatures.signing import Made
from orchestrator.studies.certification.case_file import CASE, FMU, WITH
from orchestrator.studies.certification.codes.bench_point import case_name
from orchestrator.studies.certification.codes.nts631 import NTS631
from orchestrator.studies.certification.files import JSON, read_record, signatures_of
from orchestrator.studies.certification.form import NORM
from orchestrator.studies.certification.point import CONVERTER
from orchestrator.studies.certification.points_again import choose
from orchestrator.studies.certification.signed import sign_folder
from orchestrator.studies.certification.texts import TEXTS
from orchestrator.studies.modes.modes import running
from orchestrator.systems.coupling.master import Master
from orchestrator.systems.coupling.recorder import Recorder
from orchestrator.systems.ssp.reference_experiment import FOLDER as LS_REF
from orchestrator.systems.ssp.reference_experiment import (
    as_csv,
    experiment,
    manifest,
    parameter_set,
)

AFTER = 0.2  # an experiment ends so long after the first event of its row [s]
_THINNED = 10  # steps between two reference results
_REPEATED = 1e-9  # of its range, a coupled output may differ from that of the test


@dataclass
class _Replay:
    """An FMU stepped alone; names are its own."""

    parameters: dict[str, float | bool | str]
    stimuli: list[list[str]]
    references: list[list[str]]
    coupled: Numbers  # the port's outputs after each step, shape (steps, outputs)


def experiments_of(folder: Path, content: dict[str, Any]) -> dict[str, bytes]:
    """Files of the experiments by name: one a row, or the least damped point of the damping test."""
    case, found = folder / CASE, dict[str, bytes]()
    if content["format"] == NORM:
        (X_L,) = choose(content)
        prepared = load_case(case).prepare([WITH], {"grid.X_L": X_L})
        return _files(f"X_L_{X_L:g}", prepared[0])
    for row in content["rows"]:
        if row["judged"]:
            found |= _files(row["row"], load_case(folder / case_name(row["row"])).prepare()[0])
    return found


def _files(row: str, prepared: PreparedScenario) -> dict[str, bytes]:
    step = prepared.step_size
    first = min((event.time for event in prepared.events), default=0.0)
    steps = round(min(first + AFTER, prepared.stop_time) / step)
    into = {
        str(c.target.variable): str(c.source)
        for c in prepared.system.connections
        if c.target.component == CONVERTER
    }
    outputs = list(
        dict.fromkeys(
            c.source.variable
            for c in prepared.system.connections
            if c.source.component == CONVERTER
        )
    )
    recorder = Recorder([*into.values(), *(f"{CONVERTER}.{name}" for name in outputs)], 1)
    with running(prepared) as master:
        master.run(
            steps * step,
            [event for event in prepared.events if event.time < steps * step],
            [recorder],
        )
    given, tested = recorder.values[:, : len(into)], recorder.values[1:, len(into) :]
    with running(prepared) as master:
        replay = _replay(master, list(into), given, outputs, step)
    size = np.ptp(tested, axis=0) + np.abs(tested).max(axis=0)
    if not np.all(np.abs(replay.coupled - tested) <= _REPEATED * size):
        worst = float(np.max(np.abs(replay.coupled - tested) / size))
        raise CosimError(
            Option.INTO
            + f": row {row}: with the same inputs the FMU alone answers otherwise than in "
            f"the test, by {worst:.2g} of an output's size, so that nobody could repeat "
            "it; look at `gfor fmu check`"
        )
    description = _own(master.components[CONVERTER]).description
    names = {
        "Parameters": f"{row}.parameters.ssv",
        "Stimuli": f"{row}.stimuli.csv",
        "References": f"{row}.references.csv",
    }
    return {
        f"{row}.exp": experiment(
            row, TEXTS["experiment"].format(row=row, after=AFTER), steps * step, step, names
        ),
        names["Parameters"]: parameter_set(row, replay.parameters, description),
        names["Stimuli"]: as_csv(replay.stimuli),
        names["References"]: as_csv(replay.references),
    }


def _own(component: Component) -> Component:
    return component.inner if isinstance(component, BoundComponent) else component


def _replay(
    master: Master, inputs: Sequence[str], given: Numbers, outputs: Sequence[str], step: float
) -> _Replay:
    component = master.components[CONVERTER]
    own = _own(component)
    variables = own.description.variables.values()
    fed = [v.name for v in variables if v.causality == "input"]
    seen = [v.name for v in variables if v.causality == "output" and v.type == "Real"]
    parameters = own.values([v.name for v in variables if v.causality == "parameter"])
    stimuli, references = [["time", *fed]], [["time", *seen]]
    coupled = np.empty((len(given) - 1, len(outputs)))
    for k in range(len(given) - 1):
        component.set(dict(zip(inputs, map(float, given[k]), strict=True)))
        component.step(k * step, step)
        values = own.values(fed)
        stimuli.append([repr(k * step), *(repr(float(values[name])) for name in fed)])
        coupled[k] = list(component.get(outputs).values())
        if (k + 1) % _THINNED == 0:
            found = own.values(seen)
            references.append([repr((k + 1) * step), *(repr(float(found[name])) for name in seen)])
    return _Replay(dict(parameters), stimuli, references, coupled)


FOLDER = "extra/org.gfor-cosim.certificates"
_TESTED, _MANIFEST = f"{FOLDER}/tested.json", f"{LS_REF}/fmi-ls-manifest.xml"
_PURPOSES = TEXTS["purposes"]
_SIGNATURE = ("application/json", "signature", "SHA-256 of the FMU that was tested")


def holds_certificates(fmu: Path) -> bool:
    return any(name.startswith(f"{FOLDER}/") for name in names_in(fmu, with_backslashes=True))


def put_inside(folder: Path, fmu: Path, target: Path) -> Path:
    """Write an FMU with a certificate in it; where ``target`` holds others of the same FMU, this one joins them."""
    tested, members = check_target(fmu, target)
    content = read_record(folder / JSON)
    own = f"{FOLDER}/{content.get('code', NTS631)}"
    members = {name: data for name, data in members.items() if not name.startswith(f"{own}/")}
    names = [
        JSON,
        *(name for name in content["files"] if name != FMU),
        *signatures_of(folder).names(),
    ]
    members |= {f"{own}/{name}": (folder / name).read_bytes() for name in names}
    members |= {f"{own}/{name}": data for name, data in experiments_of(folder, content).items()}
    _write(tested, members, target)
    return target


def sign_inside(fmu: Path, key: Path, check: Callable[[Path], None]) -> list[Made]:
    """Sign each certificate in an FMU; ``check`` refuses one that nobody should sign."""
    with TemporaryDirectory() as folder:
        places = taken_out(fmu, Path(folder))
        for place in places:
            check(place)
        made = [sign_folder(place, read_record(place / JSON), key) for place in places]
        tested = (places[0] / FMU).read_bytes()
        members = _others(fmu, tested)
        for place in places:
            own = f"{FOLDER}/{place.name}"
            members |= {
                f"{own}/{name}": (place / name).read_bytes()
                for name in signatures_of(place).names()
            }
        _write(tested, members, fmu)
    return made


def _write(tested: bytes, certificates: Mapping[str, bytes], target: Path) -> None:
    """Write the FMU that was tested, with certificates behind it."""
    members = dict(certificates)
    members[_TESTED] = _signature(tested)
    members[_MANIFEST] = manifest(
        {
            f"../{name.removeprefix('extra/')}": (*_purpose(name), data)
            for name, data in members.items()
            if name != _MANIFEST
        }
    )
    buffer = io.BytesIO(tested)
    with zipfile.ZipFile(buffer, "a", zipfile.ZIP_DEFLATED) as archive:
        for name, data in members.items():
            archive.writestr(
                zipfile.ZipInfo(name, (2020, 1, 1, 0, 0, 0)), data, zipfile.ZIP_DEFLATED
            )
    write_bytes(target, buffer.getvalue())


def check_target(fmu: Path, target: Path) -> tuple[bytes, dict[str, bytes]]:
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
        raise InputError(
            f"{fmu}: there is no certificate in it; "
            + command("certify", Option.INTO)
            + " writes one, and a certificate beside an FMU is verified by its folder"
        )
    for folder in folders:
        write_bytes(folder / FMU, tested)
    return folders


def _unpacked(fmu: Path, into: Path) -> bytes | None:
    """Unpack an FMU, which anybody may have made; gives the file that was tested, None without certificates.

    The hash of what was tested is compared with the certificates' later."""
    extract(fmu, into)
    try:
        said: dict[str, Any] = json.loads((into / _TESTED).read_bytes())
        tested = fmu.read_bytes()[: said["members_end"]] + b64decode(
            said["directory"], validate=True
        )
    except (OSError, KeyError, ValueError, TypeError):
        return None
    _check_members(fmu, tested)
    return tested


def _check_members(fmu: Path, tested: bytes) -> None:
    """Refuse an FMU that a tool unpacks to something else than the FMU that was tested, though that lies in it too."""
    try:
        with zipfile.ZipFile(io.BytesIO(tested)) as archive:
            wanted = {name: archive.read(name) for name in archive.namelist()}
    except (zipfile.BadZipFile, *DAMAGE):
        return  # its hash is not that of the certificate, which is said later
    with zipfile.ZipFile(fmu) as archive:
        own = [n for n in archive.namelist() if n != _MANIFEST and not n.startswith(f"{FOLDER}/")]
        there = {name: archive.read(name) for name in own}
    others = [n for n in {**wanted, **there} if wanted.get(n) != there.get(n)]
    if others or len(own) != len(there):
        raise InputError(
            f"{fmu}: what a tool unpacks of it is not the FMU that was tested: {few(others or own, 3)}; its "
            "certificates are of another FMU, so do not use it as it is"
        )


def _check_names(fmu: Path) -> None:
    names = names_in(fmu)
    taken = [name for name in names if name.startswith(f"{FOLDER}/")]
    if taken:
        raise InputError(
            Option.INTO
            + f": {fmu} holds {taken[0]}; certify the FMU without certificates, and name "
            "this file as " + Option.INTO + ": the new certificate joins those in it"
        )
    if _MANIFEST in names:
        raise InputError(
            Option.INTO
            + f": {fmu} has a manifest of LS-REF already ({_MANIFEST}), which a certificate "
            "cannot join; build it without reference results, or take them away"
        )


def _others(target: Path, tested: bytes) -> dict[str, bytes]:
    """The certificates that a file holds, of the FMU that was tested."""
    with TemporaryDirectory() as folder:
        place = Path(folder)
        try:
            same = _unpacked(target, place) == tested
        except FmuFileError as error:
            raise InputError(
                Option.INTO + f": {target} exists and is no FMU: {error}; name another file"
            ) from error
        if not same:
            raise InputError(
                Option.INTO
                + f": {target} exists and is not the FMU that was tested, with certificates; "
                "name another file"
            )
        files = {
            file.relative_to(place).as_posix(): file for file in sorted((place / FOLDER).rglob("*"))
        }
        return {
            name: file.read_bytes()
            for name, file in files.items()
            if file.is_file() and name != _TESTED
        }


def _signature(tested: bytes) -> bytes:
    with zipfile.ZipFile(io.BytesIO(tested)) as archive:
        directory = archive.start_dir
    said = {
        "sha256": hashlib.sha256(tested).hexdigest(),
        "members_end": directory,
        "directory": b64encode(tested[directory:]).decode(),
    }
    return (json.dumps(said, indent=1) + "\n").encode()


def _purpose(name: str) -> tuple[str, str, str]:
    if name == _TESTED:
        return _SIGNATURE
    kind, purpose, words = _PURPOSES.get(name.rpartition(".")[2], _PURPOSES["other"])
    return kind, purpose, words
