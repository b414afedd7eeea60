"""``gfor certify``: the grid code's damping test on any converter FMU."""

import argparse
import sys
from pathlib import Path

import numpy as np
from rich.markup import escape
from rich.table import Table
from rich.text import Text

from orchestrator.analysis.modes import damping_ratio
from orchestrator.certification.acceptance import Acceptance, read_checks, run_checks
from orchestrator.certification.codes.all_codes import BY_DECLARATION
from orchestrator.certification.details import TEMPLATE, Details, read_details
from orchestrator.certification.files import JSON, save
from orchestrator.certification.request import PODS, REACTANCES, STUDY, CertificationRequest
from orchestrator.certification.study import Certification, certify
from orchestrator.certification.verdict import EXIT_CODES, INCOMPLETE, exit_code
from orchestrator.cli.arguments import reactances, setting
from orchestrator.cli.certify_codes import ALL, CODE_NAMES, NTS631, run_code
from orchestrator.cli.executors import add_executor_arguments, choose_executor
from orchestrator.cli.interrupted import saying_how_it_goes_on
from orchestrator.cli.points import Progressing
from orchestrator.cli.terminal import make_console
from orchestrator.errors import INTERRUPTED, InputError
from orchestrator.fmi.devices import as_device
from orchestrator.report.tables import PlainTable
from orchestrator.results.lock import held
from orchestrator.safe_files import made_folder


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``gfor certify``."""
    parser.epilog = (
        "Exit codes: 0 the converter passes; 1 it fails; 2 an input cannot be used; 3 the test is incomplete, as with "
        f"fewer than 13 reactances; 4 it passes, and an acceptance test of the FMU failed; {INTERRUPTED} interrupted."
    )
    parser.add_argument("fmu", type=Path, nargs="?", metavar="FILE.fmu", help="the converter")
    parser.add_argument("--code", choices=CODE_NAMES, default=NTS631,
                        help="whose test (default: nts631, the damping test)")  # fmt: skip
    parser.add_argument("--binding", type=Path, metavar="vendor.toml", help="maps the FMU's variables to our port")
    parser.add_argument(
        "--pod", choices=PODS,
        help="damping controllers that are to be active: set in the FMU where it has pod_p.enabled and pod_q.enabled, "
        "else declared by the applicant (default: as the FMU shows them)",
    )  # fmt: skip
    parser.add_argument(
        "--set", action="append", default=[], type=setting, metavar="VARIABLE=VALUE",
        help="a value of the converter, such as pod_p.K=150, or of the study, such as "
        "sg1.governor.enabled=true, which makes it another test than the norm's (repeatable)",
    )  # fmt: skip
    parser.add_argument(
        "--declare", action="append", default=[], type=setting, metavar="NAME=VALUE",
        help="what is declared of the converter, for the codes that compare it with that: X_eff, D and H for rte "
        "(repeatable)",
    )  # fmt: skip
    parser.add_argument(
        "--reactances", type=reactances, default=REACTANCES, metavar="X,X,…",
        help="line reactances X_L [pu] (default: the norm's 13, 0.01 and 0.05 to 0.60; less is incomplete)",
    )  # fmt: skip
    parser.add_argument("--black-box", action="store_true",
                        help="do not use the converter's states for the modes, even if it shows them")  # fmt: skip
    add_executor_arguments(parser)
    parser.add_argument(
        "--out",
        type=Path,
        metavar="DIR",
        help="folder for results (default: results/certify_<file>); points that are there are not computed again",
    )
    _add_document_arguments(parser)
    parser.add_argument("--json", action="store_true", help="print all figures as JSON")


def _add_document_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--details", type=Path, metavar="FILE.toml",
                        help="number, applicant, operator, tester, place, date")  # fmt: skip
    parser.add_argument("--details-template", action="store_true", help="print such a file to be filled in, and end")
    checks = parser.add_mutually_exclusive_group()
    checks.add_argument("--check", type=Path, metavar="report.json",
                        help="the FMU's acceptance tests by `gfor check --json` (default: they are run)")  # fmt: skip
    checks.add_argument("--no-check", action="store_true", help="leave out the acceptance tests; the report says so")
    parser.add_argument(
        "--pdf", action="store_true", help="print the report to certificate.pdf with an installed browser"
    )


def run(options: argparse.Namespace) -> int:
    """Run the test, write its report and print the verdict.

    Returns
    -------
    0 where the converter passes, 1 where it fails, 3 where the test is incomplete, 4 where it passes and an acceptance
    test of the FMU failed.
    """
    if options.details_template:
        print(TEMPLATE, end="")
        return 0
    if options.fmu is None:
        raise InputError("the converter is missing: gfor certify FILE.fmu")
    if options.code == ALL:
        return _run_all(options)
    return _run_nts631(options) if options.code == NTS631 else run_code(options, options.code)


def _run_all(options: argparse.Namespace) -> int:
    """Every code in a folder of its own; the worst of their exit codes."""
    folder = options.out or Path("results") / f"certify_{options.fmu.stem}"
    found = []
    for key in CODE_NAMES:
        if key in BY_DECLARATION and not options.declare:
            print(f"--code {key} is left out: it needs --declare", file=sys.stderr)
            found.append(EXIT_CODES[INCOMPLETE])
        elif key != ALL:
            declare = options.declare if key in BY_DECLARATION else []
            own = argparse.Namespace(**{**vars(options), "code": key, "out": folder / key, "declare": declare})
            found.append(_run_nts631(own) if key == NTS631 else run_code(own, key))
    return next((code for code in (1, 3, 4) if code in found), 0)


def _run_nts631(options: argparse.Namespace) -> int:
    """The damping test."""
    request = _request(options)
    details = read_details(options.details) if options.details else Details()
    acceptance = read_checks(options.check, request.fmu, request.binding) if options.check else None
    folder = made_folder(options.out or Path("results") / f"certify_{options.fmu.stem}", "--out")
    progress = Progressing(folder)
    with saying_how_it_goes_on(progress.how_it_goes_on), held(folder):
        return _certified(request, details, acceptance, folder, progress, options)


def _certified(
    request: CertificationRequest,
    details: Details,
    acceptance: Acceptance | None,
    folder: Path,
    progress: Progressing,
    options: argparse.Namespace,
) -> int:
    """See `run`.

    Parameters
    ----------
    request
        What is tested.
    details
        For the report.
    acceptance
        Acceptance tests of the FMU, where they are there already.
    folder
        For the results, which no other command works in.
    progress
        How far the points are.
    options
        Of the command.
    """
    console = make_console(stderr=options.json)
    executor = choose_executor(options, ["orchestrator.certification.point"])
    result = progress.compute(lambda report: certify(request, executor, folder, report), executor, console)
    if acceptance is not None:
        acceptance.keep(folder)
    elif not options.no_check:
        with console.status("Acceptance tests of the FMU"):
            acceptance = run_checks(request.fmu, request.binding, folder)
    result.details, result.acceptance = details, acceptance
    files = save(result, folder, pdf=options.pdf)
    if options.json:
        print((folder / JSON).read_text(encoding="utf-8"), end="")
    else:
        console.print(_table(result), "")
        for v in result.verdicts:
            if said := v.of_base_critical():
                console.print(f"X_L = {v.X_L:g} pu: {escape(said)}", soft_wrap=True, highlight=False)
        console.print("")
        good = result.passed and not result.refused
        console.print(f"[bold {'green' if good else 'red'}]{escape(result.sentence())}[/]", soft_wrap=True)
        if result.stored:
            console.print(f"{result.stored} of {len(result.points)} points were there already")
        console.print(escape(f"Report in {folder}: {', '.join(f.name for f in files)}"), soft_wrap=True)
    return exit_code(result.verdict, refused=result.refused)


def _request(options: argparse.Namespace) -> CertificationRequest:
    if options.declare:
        raise InputError(f"--declare {options.declare[0][0]}: the damping test takes no declared value; leave it out, "
                         f"or choose --code {', '.join(BY_DECLARATION)}")  # fmt: skip
    study = {name: value for name, value in options.set if name.split(".")[0] in STUDY}
    own = {name: value for name, value in options.set if name not in study}
    request = CertificationRequest(
        as_device(options.fmu, options.binding),
        options.binding,
        own,
        options.pod,
        options.reactances,
        study,
        options.black_box,
    )
    request.check()
    return request


def _table(result: Certification) -> Table:
    table = PlainTable(
        title=escape(f"Damping test, {result.signal} watched"), title_justify="left", header_style="bold"
    )
    for column in (
        "X_L [pu]",
        "least damped [Hz]",
        "ξ [%]",
        "the same without",
        "ΔP5M5/ΔP1M1",
        "in the signal: ξ [%]",
        "",
    ):
        table.add_column(escape(column), justify="right")
    for v in result.verdicts:
        worst = v.modes[0] if v.modes else None
        ratio = v.time.swings.ratio if v.time else None
        seen = min((m.damping_percent for m in v.time.modal.modes), default=None) if v.time else None
        before = worst.before if worst else None
        table.add_row(
            f"{v.X_L:g}",
            f"{worst.frequency_hz:.3f}" if worst else "–",
            f"{worst.damping_percent:.2f}" if worst else "–",
            "–" if before is None else f"{before.imag / (2 * np.pi):.3f} Hz, {100 * damping_ratio(before):.2f} %",
            "–" if ratio is None else f"{ratio:.3f}",
            "–" if seen is None else f"{seen:.2f}",
            "accepted" if v.accepted else Text("not accepted" if v.judged else "not judged", "red"),
        )
    return table
