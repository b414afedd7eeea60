"""``gfor verify``: whether a certificate still holds."""

import argparse
import json
from pathlib import Path

from rich.markup import escape

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
from orchestrator.cli.terminal import make_console, progress_bar


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``gfor verify``."""
    parser.add_argument("certificate", type=Path, metavar="CERTIFICATE", help="its folder, or its certificate.json")
    which = parser.add_mutually_exclusive_group()
    which.add_argument("--points", type=reactances, metavar="X,X,…",
                       help="line reactances that are computed anew [pu] (default: the least damped one)")  # fmt: skip
    which.add_argument("--all", action="store_true", help="compute every point anew")
    which.add_argument("--files-only", action="store_true", help="compute nothing: compare hashes, and judge again")
    add_executor_arguments(parser)
    parser.add_argument("--json", action="store_true", help="print JSON")


def run(options: argparse.Namespace) -> int:
    """Verify and print; 1 if something does not agree."""
    folder, content = read_certificate(options.certificate)
    console = make_console(stderr=options.json)
    wanted = [p["X_L"] for p in content["points"]] if options.all else options.points or (least_damped(content),)
    points = chosen_points(content, () if options.files_only else wanted)
    found = verify_files(folder, content)
    computed = bool(points) and found.holds
    if computed:
        with progress_bar(console) as bar:
            task = bar.add_task("Points", total=2 * len(points))
            executor = choose_executor(options.workers, options.scheduler, ["orchestrator.certification.point"])
            try:
                again = verify_points(
                    folder, content, points, executor, lambda done, _: bar.update(task, completed=done)
                )
            finally:
                executor.close()
        found = Verification(found.faults + again.faults, found.agreed + again.agreed)
    if options.json:
        print(json.dumps({"holds": found.holds, "faults": found.faults, "agreed": found.agreed,
                          "computed": [p["X_L"] for p in points] if computed else []}, indent=1,
                         ensure_ascii=False))  # fmt: skip
        return 0 if found.holds else 1
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
    else:
        count = f"{len(found.faults)} disagreement{'' if len(found.faults) == 1 else 's'}"
        console.print(f"[bold red]The certificate does not hold: {count}.[/]")
    return 0 if found.holds else 1
