"""``gfor verify``: whether a certificate still holds."""

import argparse
import json
from pathlib import Path
from typing import Any

from rich.markup import escape

from orchestrator.certification.codes.recheck import read_code_certificate, verify_code
from orchestrator.certification.codes.rows_anew import chosen_rows, verify_rows
from orchestrator.certification.verdict import DOES_NOT_HOLD, PASSES, exit_code
from orchestrator.certification.verification import (
    TOLERANCE,
    TOLERANCE_IDENTIFIED,
    Verification,
    chosen_points,
    least_damped,
    read_certificate,
    verify_files,
    verify_points,
)
from orchestrator.cli.arguments import reactances
from orchestrator.cli.executors import add_executor_arguments, choose_executor
from orchestrator.cli.terminal import make_console
from orchestrator.errors import INTERRUPTED, InputError
from orchestrator.report.progress import progress_bar


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.epilog = (
        f"Exit codes: {DOES_NOT_HOLD} the certificate does not hold; 2 it cannot be read. Where it holds, that of its "
        "verdict as with gfor certify: 0 the converter passes; 1 it fails; 3 the test is incomplete; 4 it passes, and "
        f"an acceptance test of the FMU failed; {INTERRUPTED} interrupted."
    )
    parser.add_argument("certificate", type=Path, metavar="CERTIFICATE", help="its folder, or its certificate.json")
    which = parser.add_mutually_exclusive_group()
    which.add_argument("--points", type=reactances, metavar="X,X,…",
                       help="line reactances that are computed anew [pu] (default: the least damped one)")  # fmt: skip
    which.add_argument("--rows", type=lambda text: tuple(text.split(",")), metavar="ROW,ROW,…",
                       help="of a code's certificate: rows that are computed anew (default: the one with the narrowest "
                       "margin, and one that chance draws)")  # fmt: skip
    which.add_argument("--all", action="store_true", help="compute every point or row anew")
    which.add_argument("--files-only", action="store_true", help="compute nothing: compare hashes, and judge again")
    add_executor_arguments(parser)
    parser.add_argument("--json", action="store_true", help="print JSON")


def run(options: argparse.Namespace) -> int:
    """Verify and print.

    Returns
    -------
    The exit code of the certificate's verdict where it holds, else 5.
    """
    if (code := read_code_certificate(options.certificate)) is not None:
        return _run_code(options, *code)
    folder, content = read_certificate(options.certificate)
    if options.rows:
        raise InputError(f"--rows: {folder} is the certificate of a damping test, which has points; give --points, "
                         "with line reactances")  # fmt: skip
    console = make_console(stderr=options.json)
    wanted = [p["X_L"] for p in content["points"]] if options.all else options.points or (least_damped(content),)
    points = chosen_points(content, () if options.files_only else wanted)
    found = verify_files(folder, content)
    computed = bool(points) and found.holds
    if computed:
        with progress_bar(console) as bar:
            task = bar.add_task("Points", total=2 * len(points))
            executor = choose_executor(options, ["orchestrator.certification.point"])
            try:
                again = verify_points(
                    folder, content, points, executor, lambda done, _: bar.update(task, completed=done)
                )
            finally:
                executor.close()
        found = Verification(found.faults + again.faults, found.agreed + again.agreed)
    if options.json:
        said = {"holds": found.holds, "verdict": content["verdict"], "points": content["judged"],
                "passes": found.holds and content["verdict"] == PASSES, "faults": found.faults,
                "agreed": found.agreed, "computed": [p["X_L"] for p in points] if computed else []}  # fmt: skip
        print(json.dumps(said, indent=1, ensure_ascii=False))
        return _exit_code(found, content)
    for text in found.agreed:
        console.print(f"[green]agrees[/]        {escape(text)}")
    for text in found.faults:
        console.print(f"[bold red]does not agree[/] {escape(text)}")
    console.print("")
    if points and not computed:
        console.print("No point was computed anew: with other files that would say nothing of this certificate.")
    if computed:
        console.print(f"Allowed are differences of {TOLERANCE:g} of an eigenvalue and of a signal's range "
                      f"({TOLERANCE_IDENTIFIED:g} of an eigenvalue with an identified converter).")  # fmt: skip
    if found.holds:
        console.print("The certificate holds. That is no proof of who made it: hashes guard against accidents only.")
        console.print(_verdict(content), soft_wrap=True, highlight=False)
    else:
        count = f"{len(found.faults)} disagreement{'' if len(found.faults) == 1 else 's'}"
        console.print(f"[bold red]The certificate does not hold: {count}.[/]")
    return _exit_code(found, content)


def _run_code(options: argparse.Namespace, folder: Path, content: dict[str, Any]) -> int:
    """The certificate of a code on the test bench: its hashes, its rows judged again, and some computed anew."""
    if options.points:
        raise InputError(f"--points: {folder} is the certificate of a grid code, which has rows; give --rows, with "
                         "their names")  # fmt: skip
    console = make_console(stderr=options.json)
    found = verify_code(folder, content)
    rows = [] if options.files_only else chosen_rows(content, options.rows or (), every=options.all)
    computed = bool(rows) and found.holds
    if computed:
        with progress_bar(console) as bar:
            task = bar.add_task("Rows", total=len(rows))
            executor = choose_executor(options, ["orchestrator.certification.codes.bench_point"])
            try:
                again = verify_rows(folder, content, rows, executor, lambda done, _: bar.update(task, completed=done))
            finally:
                executor.close()
        found = Verification(found.faults + again.faults, found.agreed + again.agreed)
    if options.json:
        print(json.dumps({"holds": found.holds, "verdict": content["verdict"], "faults": found.faults,
                          "agreed": found.agreed, "computed": rows if computed else []},
                         indent=1, ensure_ascii=False))  # fmt: skip
        return _exit_code(found, content)
    for text in found.agreed:
        console.print(f"[green]agrees[/]        {escape(text)}")
    for text in found.faults:
        console.print(f"[bold red]does not agree[/] {escape(text)}")
    if rows and not computed:
        console.print("No row was computed anew: with other files that would say nothing of this certificate.")
    if computed and len(rows) < len(content["rows"]):
        console.print(f"{len(rows)} of {len(content['rows'])} rows were computed anew; --all takes every one.")
    holds = "The certificate holds" if found.holds else "[bold red]The certificate does not hold[/]"
    console.print(f"{holds}; its verdict: {escape(content['verdict'])}.")
    return _exit_code(found, content)


def _exit_code(found: Verification, content: dict[str, Any]) -> int:
    return exit_code(content["verdict"], refused=_refused(content)) if found.holds else DOES_NOT_HOLD


def _refused(content: dict[str, Any]) -> bool:
    """Whether an acceptance test of the FMU failed."""
    return content["acceptance"] is not None and not content["acceptance"]["trusted"]


def _verdict(content: dict[str, Any]) -> str:
    colour = "green" if content["verdict"] == PASSES and not _refused(content) else "red"
    tail = "; acceptance tests of the FMU failed" if _refused(content) else ""
    line = f"Its verdict: [bold {colour}]{escape(content['verdict'])}[/], "
    return f"{line}{escape(content['judged'])} line reactances of the norm judged{tail}."
