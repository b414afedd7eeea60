"""``gfor sign``: a signature on a certificate, or on a file, that is there."""

import argparse
from pathlib import Path
from typing import Any

from rich.markup import escape

from orchestrator.core.errors import INTERRUPTED, InputError
from orchestrator.core.foreign_files import check_regular
from orchestrator.face.cli.arguments import add_options
from orchestrator.face.cli.terminal import make_console, print_json
from orchestrator.output.signatures.signing import Made, check_key
from orchestrator.studies.certification.case_file import FMU
from orchestrator.studies.certification.files import JSON, signatures_of
from orchestrator.studies.certification.inside import holds_certificates, sign_inside
from orchestrator.studies.certification.signed import sign_folder
from orchestrator.studies.certification.signed_file import sign_file, signatures_of_file
from orchestrator.studies.certification.verification import read_certificate, verify_files


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_options(parser, "sign", INTERRUPTED=INTERRUPTED)


def run(options: argparse.Namespace) -> int:
    """Sign and say by which key; returns 0."""
    check_key(options.sign)
    what = options.what
    check_regular(what)
    if not what.exists():
        raise InputError(
            f"{what}: there is no such file or folder; give a certificate's folder, an FMU, or a report"
        )
    made, files = _sign(what, options.sign)
    said = {"signed": str(what), "key": made.key.fingerprint, "public": made.key.line}
    if options.json:
        print_json(said | {"files": [str(file) for file in files]})
    else:
        _show(said, files)
    return 0


def _sign(what: Path, key: Path) -> tuple[Made, list[Path]]:
    """Sign; gives the signature and the files that were written."""
    if what.is_dir() or what.name == JSON:
        folder, content = read_certificate(what)
        _check(folder)
        made = sign_folder(folder, content, key)
        return made, [folder / name for name in signatures_of(folder).names()]
    if what.suffix.lower() == ".fmu" and holds_certificates(what):
        first, *_ = sign_inside(what, key, _check)
        return first, [what]
    made = sign_file(what, key)
    beside = signatures_of_file(what)
    return made, [beside.folder / name for name in beside.names()]


def _check(folder: Path) -> None:
    """Refuse a certificate that does not hold."""
    _, content = read_certificate(folder)
    found = verify_files(folder, content)
    if not found.holds:
        raise InputError(
            f"{folder}: the certificate does not hold, so that nobody should sign it: {found.faults[0]}; `gfor verify` "
            f"lists all that is wrong, and `gfor certify` on {FMU} makes another"
        )


def _show(said: dict[str, Any], files: list[Path]) -> None:
    console = make_console()
    console.print(
        f"Signed {escape(said['signed'])} with the key {said['key']}: {escape(', '.join(map(str, files)))}",
        soft_wrap=True,
        highlight=False,
    )
    console.print(
        "Whoever verifies it enters the key into a file of allowed signers, behind your name:",
        f"    you@example.org {said['public']}",
        sep="\n",
        soft_wrap=True,
        highlight=False,
    )
