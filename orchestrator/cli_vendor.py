"""The subcommands ``gfor bind`` and ``gfor check``: FMUs of others."""

import argparse
import json
import math
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape

from orchestrator.errors import InputError
from orchestrator.fmi.description import read_description
from orchestrator.fmi.limits import Limits
from orchestrator.vendor.checks.base import Verdict
from orchestrator.vendor.draft import draft_binding
from orchestrator.vendor.junit import write_junit
from orchestrator.vendor.runner import Report, check_fmu
from orchestrator.vendor.tables import REQUIRED

_COLOURS = {Verdict.PASS: "green", Verdict.REMARK: "yellow", Verdict.FAIL: "bold red", Verdict.NOT_APPLICABLE: "dim"}


def add_commands(commands: Any) -> None:
    """Add the subcommands to those of ``gfor``."""
    bind = commands.add_parser("bind", help="draft a binding: what a foreign FMU's variables mean at our port")
    bind.add_argument("file", type=Path, metavar="FILE.fmu")
    bind.add_argument("--out", type=Path, metavar="FILE.toml", help="binding file (default: FILE.toml, here)")
    bind.add_argument("--force", action="store_true", help="write over a file that is there")
    bind.set_defaults(command=run_bind)

    check = commands.add_parser("check", help="acceptance tests of an FMU: can it be trusted in a co-simulation?")
    check.add_argument("file", type=Path, metavar="FILE.fmu")
    check.add_argument("--binding", type=Path, metavar="FILE.toml", help="what its variables mean (`gfor bind`)")
    check.add_argument("--only", action="append", default=[], metavar="CHECK", help="only this check (repeatable)")
    check.add_argument("--json", action="store_true", help="print JSON")
    check.add_argument("--junit", type=Path, metavar="FILE.xml", help="write the results for a CI server")
    check.add_argument("--time-limit", type=_positive, default=30.0, metavar="S", help="for one call [s] (default: 30)")
    check.add_argument(
        "--memory-limit", type=_positive, default=4096.0, metavar="MB", help="of the FMU's process [MB] (default: 4096)"
    )
    check.set_defaults(command=run_check)


def _positive(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not (value > 0 and math.isfinite(value)):
        raise argparse.ArgumentTypeError(f"{text!r} must be a number above 0")
    return value


def run_bind(options: argparse.Namespace) -> int:
    """Write a draft and say what is left to fill in."""
    description = read_description(options.file)
    out = options.out or Path(f"{options.file.stem}.toml")
    if out.exists() and not options.force:
        raise InputError(f"{out}: the file is there already, perhaps filled in; choose another with --out, or --force")
    text = draft_binding(description, out.parent)
    try:
        out.write_text(text, encoding="utf-8")
    except OSError as error:
        raise InputError(f"--out {out}: cannot be written: {error.strerror}; choose another file") from error
    marked = [line.strip() for line in text.splitlines() if REQUIRED in line and not line.startswith("#")]
    print(f"{out}: confirm what is marked GUESS")
    for line in marked:
        print(f"  to be filled in: {line}")
    return 0


def run_check(options: argparse.Namespace) -> int:
    """Check, print, and write what is asked for; 1 if a check failed."""
    limits = Limits(seconds=options.time_limit, memory=int(options.memory_limit * 1024**2))
    report = check_fmu(options.file, options.binding, limits, tuple(options.only))
    if options.junit:
        write_junit(report, options.junit)
    if options.json:
        print(json.dumps(report.as_dict(), indent=1, ensure_ascii=False))
    else:
        _print(report)
    return 0 if report.trusted else 1


def _print(report: Report) -> None:
    console = Console(soft_wrap=True, highlight=False, emoji=False)
    for result in report.results:
        mark = f"[{_COLOURS[result.verdict]}]{result.verdict:<14}[/]"
        fault = f"[bold]{result.fault}:[/] " if result.fault else ""
        console.print(f"{mark} {result.check:<22} {fault}{escape(result.evidence)}")
        if result.remedy:
            console.print(f"{'':<38}[dim]{escape(result.remedy)}[/]")
    console.print("")
    if report.unlimited:
        console.print(f"This system could not limit: {', '.join(report.unlimited)}.")
    if report.trusted:
        console.print(f"{report.fmu.name}: no check failed.")
    else:
        console.print(f"[bold red]{report.fmu.name}: do not use it as it is: {', '.join(report.faults)}[/]")
