"""What the certificates of the norm and of every code have in common on the command line."""

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from rich.console import Console

from orchestrator.certification.acceptance import read_checks, run_checks
from orchestrator.certification.codes.certificate import CodeCertificate
from orchestrator.certification.details import Details, read_details
from orchestrator.certification.request import CertificationRequest
from orchestrator.certification.study import Certification
from orchestrator.cli.executors import choose_executor
from orchestrator.cli.interrupted import saying_how_it_goes_on
from orchestrator.cli.points import Progressing
from orchestrator.cli.terminal import make_errors
from orchestrator.points.executor import Executor
from orchestrator.points.points import CountReport
from orchestrator.results.lock import held
from orchestrator.safe_files import made_folder

Found = TypeVar("Found", Certification, CodeCertificate)


def certified(
    options: argparse.Namespace,
    request: CertificationRequest,
    folder: Path,
    module: str,
    study: Callable[[Executor, CountReport], Found],
    save: Callable[[Found, Path], list[Path]],
    console: Console,
    told: tuple[str, str],
) -> tuple[Found, list[Path]]:
    """Compute a certificate with its acceptance tests, and write its files; points are kept as they come."""
    details = read_details(options.details) if options.details else Details()
    acceptance = read_checks(options.check, request.fmu, request.binding) if options.check else None
    made_folder(folder, "--out")
    progress = Progressing(folder)
    with saying_how_it_goes_on(progress.how_it_goes_on), held(folder):
        executor = choose_executor(options, [module])
        found = progress.compute(lambda report: study(executor, report), executor, console, told)
        if acceptance is not None:
            acceptance.keep(folder)
        elif not options.no_check:
            if not console.is_terminal:
                make_errors().print("acceptance tests of the FMU: about a minute; --no-check leaves them out")
            with console.status("Acceptance tests of the FMU"):
                acceptance = run_checks(request.fmu, request.binding, folder)
        found.details, found.acceptance = details, acceptance
        return found, save(found, folder)
