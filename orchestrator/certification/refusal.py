"""Why a request is refused, with places in what the user gave: the case file that was made of it is deleted."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from orchestrator.cases.schema import Value
from orchestrator.certification.case_file import BINDING, FMU
from orchestrator.certification.point import CONVERTER
from orchestrator.certification.request import CertificationRequest
from orchestrator.errors import CaseError, Problem
from orchestrator.fmi.values import as_text

_OWN = re.compile(rf'^(?:components\.{CONVERTER}\.parameters\.|--set {CONVERTER}\.)"?(?P<name>[^"]*)"?$')
"""Place of a value of the converter, in a case file or among changes."""


@contextmanager
def refusing(request: CertificationRequest, folder: Path, where: str) -> Iterator[Path]:
    """A folder for a trial, so that a request that is refused leaves the files of a certificate as they are."""
    folder.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory(dir=folder, prefix=".request_") as trial:
        try:
            yield Path(trial)
        except CaseError as error:
            raise _refused(request, error, trial, where) from error


def _refused(request: CertificationRequest, error: CaseError, trial: str, where: str) -> CaseError:
    """The same problems, each at the option or in the file of the user that it comes from."""
    own = {f"{trial}/{FMU}": str(request.fmu), f"{trial}/{BINDING}": str(request.binding)}

    def said(text: str) -> str:
        for laid, given in own.items():
            text = text.replace(laid, given)
        return text

    problems = []
    for problem in error.problems:
        place = re.sub(r"^line \d+, ", "", problem.place)
        value = _OWN.match(place)
        if value and value["name"] in request.values:
            place = f"--set {value['name']}={_shown(request.values[value['name']])}"
        text = said(problem.text).replace(f"component {CONVERTER!r} has", "the FMU has")
        problems.append(Problem(place, text))
    if request.binding is None and any(p.place.startswith(f"components.{CONVERTER}") for p in problems):
        problems.append(
            Problem("", f"if its port has other names, give --binding; `gfor fmu bind {request.fmu}` drafts one")
        )
    return CaseError(f"{request.fmu}, {where}", tuple(dict.fromkeys(problems)))


def _shown(value: Value) -> str:
    return f"{value:.15g}" if isinstance(value, float) else as_text(value)
