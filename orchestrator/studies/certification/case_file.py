"""The study's case file with a converter in it. It holds everything that a point depends on, except its reactance."""

import shutil
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import tomli_w

from orchestrator.cases.case import BUILT_IN, Case, load_case
from orchestrator.core.safe_files import write_text
from orchestrator.studies.certification.point import CONVERTER
from orchestrator.studies.certification.request import CertificationRequest

# with our converter, from which a certificate's case is made
BASE = BUILT_IN / "norm631" / "case.toml"

# scenarios: the controller off and on
WITHOUT = "without"
WITH = "with"

# names of files in a certificate's folder
FMU = "converter.fmu"
BINDING = "vendor.toml"
CASE = "case.toml"

_HEAD = """\
# Damping test of {fmu}{binding}, written by `gfor certify`.
# Every value that was set is in the scenarios; only the reactance of the line is given by --set grid.X_L=…

"""


def write_case(request: CertificationRequest, switches: Mapping[str, bool], folder: Path) -> Case:
    """Write ``case.toml`` into a folder, and copy the FMU and its binding beside it. The folder then needs no other
    files. ``switches`` are what ``--pod`` sets in the converter."""
    request.check()
    lay_files(request, folder)
    tables = _tables(request)
    path = folder / CASE
    behind = f" behind {_in_comment(request.binding)}" if request.binding else ""
    head = _HEAD.format(fmu=_in_comment(request.fmu), binding=behind)
    write_text(path, head + tomli_w.dumps(tables))
    own = {f"{CONVERTER}.{name}": value for name, value in {**request.values, **switches}.items()}
    case = load_case(path)
    for name, values in ((WITH, {**request.study_values, **own}), (WITHOUT, request.study_values)):
        case.components_of(name, values)  # here an error can name the option that gave a value
        scenario = tables["scenarios"][name]
        if values:
            scenario["set"] = {**scenario.get("set", {}), **values}
    write_text(path, head + tomli_w.dumps(tables))
    return load_case(path)


def _in_comment(file: Path) -> str:
    """A file's name for a comment in TOML: quoted and escaped if it has characters that a comment must not contain."""
    return file.name if file.name.isprintable() else ascii(file.name)


def lay_files(request: CertificationRequest, folder: Path) -> None:
    for file, name in ((request.fmu, FMU), (request.binding, BINDING)):
        target = folder / name
        if file is not None and not (target.exists() and target.samefile(file)):
            shutil.copyfile(file, target)


def _tables(request: CertificationRequest) -> dict[str, Any]:
    tables = tomllib.loads(BASE.read_text(encoding="utf-8"))
    converter = tables["components"][CONVERTER]
    del converter["model"]
    converter["fmu"] = FMU
    if request.binding:
        converter["binding"] = BINDING
    return tables
