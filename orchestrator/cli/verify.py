"""``gfor verify``: whether a certificate still holds."""

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape

from orchestrator.certification.codes.all_codes import NTS631
from orchestrator.certification.compared import THIS, TOLERANCE, TOLERANCE_IDENTIFIED, issued_by
from orchestrator.certification.inside import laid_out
from orchestrator.certification.kinds import POINTS
from orchestrator.certification.request import read_reactances
from orchestrator.certification.verdict import DOES_NOT_HOLD, PASSES, exit_code
from orchestrator.certification.verification import Verified, verified
from orchestrator.cli.arguments import add_executor_arguments, add_options, choose_executor
from orchestrator.cli.terminal import make_console, print_json
from orchestrator.errors import INTERRUPTED
from orchestrator.report.progress import progress_bar


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_options(parser, "verify", INTERRUPTED=INTERRUPTED, DOES_NOT_HOLD=DOES_NOT_HOLD)
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
    with laid_out(options.certificate) as places:
        found = [_verified(options, place) for place in places]
    if options.json:
        said = [one for one, _ in found]
        print_json(
            said[0] if options.certificate.suffix.lower() != ".fmu" else {"certificates": said}
        )
    codes = [code for _, code in found]
    return DOES_NOT_HOLD if DOES_NOT_HOLD in codes else next(filter(None, codes), 0)


def _verified(options: argparse.Namespace, place: Path) -> tuple[dict[str, Any], int]:
    console = make_console(stderr=options.json)
    with progress_bar(console) as bar:
        task = bar.add_task("Points", total=None)
        found = verified(
            place,
            () if options.files_only else options.points or options.rows,
            lambda imports: choose_executor(options, imports),
            lambda done, total: bar.update(task, completed=done, total=total),
            every=options.all,
        )
    content, norm = found.content, found.parts is POINTS
    said = {
        "holds": found.holds,
        "verdict": content["verdict"],
        **({"points": content["judged"]} if norm else {}),
        "passes": found.holds and found.verdict == PASSES,
        "faults": found.faults,
        "agreed": found.agreed,
        "computed": found.computed,
        "later_rows": list(found.later),
    }
    if not options.json:
        if place != options.certificate:
            console.print(escape(f"{content['title']}:"), highlight=False)
        _show(found, console, norm=norm)
    code = exit_code(found.verdict, refused=_refused(content)) if found.holds else DOES_NOT_HOLD
    return said | (
        {"code": content.get("code", NTS631)} if place != options.certificate else {}
    ), code


def _show(found: Verified, console: Console, *, norm: bool) -> None:
    for text in found.agreed:
        console.print(f"[green]agrees[/]        {escape(text)}")
    for text in found.faults:
        console.print(f"[bold red]does not agree[/] {escape(text)}")
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
        console.print(
            "The certificate holds. That is no proof of who made it: hashes guard against accidents only."
        )
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
