"""``gfor verify``: whether a certificate still holds."""

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape

from orchestrator.core.errors import INTERRUPTED
from orchestrator.face.cli.arguments import add_executor_arguments, add_options, choose_executor
from orchestrator.face.cli.terminal import make_console, print_json
from orchestrator.output.report.progress import progress_bar
from orchestrator.output.signatures.allowed_signers import read_time
from orchestrator.output.signatures.checking import State
from orchestrator.studies.certification.codes.nts631 import NTS631
from orchestrator.studies.certification.compared import (
    THIS,
    TOLERANCE,
    TOLERANCE_IDENTIFIED,
    issued_by,
)
from orchestrator.studies.certification.inside import laid_out
from orchestrator.studies.certification.kinds import POINTS
from orchestrator.studies.certification.request import read_reactances
from orchestrator.studies.certification.signed import Asked
from orchestrator.studies.certification.signed_file import is_signed_alone, look_at_file
from orchestrator.studies.certification.verdict import DOES_NOT_HOLD, PASSES, exit_code
from orchestrator.studies.certification.verification import Verified, verified


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_options(
        parser,
        "verify",
        signing_time=read_time,
        INTERRUPTED=INTERRUPTED,
        DOES_NOT_HOLD=DOES_NOT_HOLD,
    )
    add_options(
        parser.add_mutually_exclusive_group(),
        "verify which",
        reactances=read_reactances,
        rows=lambda text: tuple(text.split(",")),
    )
    add_executor_arguments(parser)
    parser.add_argument("--json", action="store_true", help="print JSON")


def run(options: argparse.Namespace) -> int:
    """Verify and print; returns the exit code of the certificate's verdict where it holds, else 5."""
    asked = Asked.of_files(options.signers, options.revoked, options.at)
    if is_signed_alone(options.certificate):
        return _verify_file(options, asked)
    with laid_out(options.certificate) as places:
        found = [_verified(options, place, asked) for place in places]
    if options.json:
        said = [one for one, _ in found]
        print_json(
            said[0] if options.certificate.suffix.lower() != ".fmu" else {"certificates": said}
        )
    codes = [code for _, code in found]
    return DOES_NOT_HOLD if DOES_NOT_HOLD in codes else next(filter(None, codes), 0)


def _verify_file(options: argparse.Namespace, asked: Asked) -> int:
    """Verify the signature of a file that has no figures to compute anew; returns 0 if it is good, else 5."""
    found = look_at_file(options.certificate, asked)
    holds = found.state is State.GOOD
    if options.json:
        print_json({"holds": holds, "signature": found.as_json()})
    else:
        console = make_console()
        console.print(
            f"signature     {found.state}: {escape(found.sentence)}",
            soft_wrap=True,
            highlight=False,
        )
        console.print(
            "It is the file that was signed; what it says was not computed anew."
            if holds
            else "[bold red]Nothing says that it is a known signer's file.[/]"
        )
    return 0 if holds else DOES_NOT_HOLD


def _verified(options: argparse.Namespace, place: Path, asked: Asked) -> tuple[dict[str, Any], int]:
    console = make_console(stderr=options.json)
    computed_anew = () if options.files_only else options.points or options.rows
    with progress_bar(console) as bar:
        task = bar.add_task("Points", total=None)
        found = verified(
            place,
            computed_anew,
            lambda imports: choose_executor(options, imports),
            lambda done, total: bar.update(task, completed=done, total=total),
            every=options.all,
            asked=asked,
        )
    content, norm = found.content, found.parts is POINTS
    said = {
        "holds": found.holds,
        "verdict": content["verdict"],
        "passes": found.holds and found.verdict == PASSES,
        "faults": found.faults,
        "agreed": found.agreed,
        "computed": found.computed,
        "later_rows": list(found.later),
        "signature": found.signature.as_json(),
        "unproved": found.unproved,
    }
    if norm:
        said["points"] = content["judged"]
    if not options.json:
        if place != options.certificate:
            console.print(escape(f"{content.get('title', content.get('norm'))}:"), highlight=False)
        _show(found, console, norm=norm)
    code = exit_code(found.verdict, refused=_refused(content)) if found.holds else DOES_NOT_HOLD
    if place != options.certificate:
        said["code"] = content.get("code", NTS631)
    return said, code


_UNPROVED = "That is no proof of who made it: hashes guard against accidents only."
_WHO = {
    State.GOOD: "Its figures, verdicts and files are those that were signed.",
    State.UNKNOWN: _UNPROVED,
    State.UNSIGNED: _UNPROVED,
}


def _show(found: Verified, console: Console, *, norm: bool) -> None:
    for text in found.agreed:
        console.print(f"[green]agrees[/]        {escape(text)}")
    for text in found.faults:
        console.print(f"[bold red]does not agree[/] {escape(text)}")
    if found.signature.state is not State.CHANGED:
        console.print(
            f"signature     {found.signature.state}: {escape(found.signature.sentence)}",
            soft_wrap=True,
        )
    for text in found.unproved:
        console.print(f"not proved    {escape(text)}", soft_wrap=True)
    console.print("")
    one, every = found.parts.one, found.content["points" if norm else "rows"]
    if found.chosen and not found.computed:
        console.print(
            f"No {one} was computed anew: with other files that would say nothing of this certificate."
        )
    if found.computed and norm:
        console.print(
            f"Allowed are differences of {TOLERANCE:g} of an eigenvalue and of a signal's range "
            f"({TOLERANCE_IDENTIFIED:g} of an eigenvalue with an identified converter)."
        )
    if 0 < len(found.computed) < len(every):
        console.print(
            f"{len(found.computed)} of {len(every)} {one}s were computed anew; --all takes every one."
        )
    if found.holds:
        console.print(f"The certificate holds. {_WHO[found.signature.state]}")
        console.print(_verdict(found, norm=norm), soft_wrap=True, highlight=False)
    else:
        count = f"{len(found.faults)} disagreement{'' if len(found.faults) == 1 else 's'}"
        console.print(f"[bold red]The certificate does not hold: {count}.[/]")
        issued = issued_by(found.content)
        if issued not in ("", THIS):
            console.print(
                f"gfor-cosim {issued} issued it, and this is {THIS}, whose tables may ask for something "
                "else."
            )


def _refused(content: Mapping[str, Any]) -> bool:
    return content["acceptance"] is not None and not content["acceptance"]["trusted"]


def _verdict(found: Verified, *, norm: bool) -> str:
    content = found.content
    colour = "green" if found.verdict == PASSES and not _refused(content) else "red"
    judged = f", {escape(content['judged'])} line reactances of the norm judged" if norm else ""
    tail = "; acceptance tests of the FMU failed" if _refused(content) else ""
    tail += f"; {', '.join(found.later)} was not in its table" if found.later else ""
    return f"Its verdict: [bold {colour}]{escape(found.verdict)}[/]{judged}{tail}."
