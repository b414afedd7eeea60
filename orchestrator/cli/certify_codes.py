"""``gfor certify --code``: the rows of one grid code, or of all, on a test bench."""

import argparse
import json
from pathlib import Path

from rich.markup import escape

from orchestrator.certification.acceptance import read_checks, run_checks
from orchestrator.certification.codes.all_codes import BY_DECLARATION, CODES, code_for
from orchestrator.certification.codes.bench_case import rated_frequency
from orchestrator.certification.codes.certificate import CodeCertificate, certify_code
from orchestrator.certification.codes.declared import checked
from orchestrator.certification.codes.frequency_domain import figures_of_stiffness, measure_stiffness, save_stiffness
from orchestrator.certification.codes.record import figures_of, save_certificate
from orchestrator.certification.details import Details, read_details
from orchestrator.certification.request import REACTANCES, STUDY, CertificationRequest
from orchestrator.certification.verdict import FAILS, INCOMPLETE, exit_code
from orchestrator.cli.executors import choose_executor
from orchestrator.cli.interrupted import saying_how_it_goes_on
from orchestrator.cli.points import Progressing
from orchestrator.cli.terminal import make_console, said_stages
from orchestrator.errors import InputError
from orchestrator.fmi.devices import as_device
from orchestrator.report.tables import PlainTable
from orchestrator.results.lock import held
from orchestrator.safe_files import made_folder

NTS631, GB, ALL = "nts631", "gb", "all"

CODE_NAMES = (NTS631, *CODES, *BY_DECLARATION, GB, ALL)
"""What ``--code`` takes."""


def run_code(options: argparse.Namespace, key: str) -> int:
    """Run one code's rows, write the certificate and print it.

    Parameters
    ----------
    options
        Of the command.
    key
        Which code.

    Returns
    -------
    As `gfor certify`.
    """
    if key == GB:
        return _run_gb(options)
    code = code_for(key, dict(options.declare))
    request = _request(options)
    details = read_details(options.details) if options.details else Details()
    acceptance = read_checks(options.check, request.fmu, request.binding) if options.check else None
    folder = made_folder(options.out or Path("results") / f"certify_{options.fmu.stem}_{key}", "--out")
    console = make_console(stderr=options.json)
    progress = Progressing(folder)
    with saying_how_it_goes_on(progress.how_it_goes_on), held(folder):
        executor = choose_executor(options, ["orchestrator.certification.codes.bench_point"])
        found = progress.compute(
            lambda report: certify_code(request, code, executor, folder, report=report), executor, console
        )
        if acceptance is not None:
            acceptance.keep(folder)
        elif not options.no_check:
            with console.status("Acceptance tests of the FMU"):
                acceptance = run_checks(request.fmu, request.binding, folder)
        found.details, found.acceptance = details, acceptance
        files = save_certificate(found, folder)
    if options.json:
        print(json.dumps(figures_of(found), indent=1, ensure_ascii=False))
    else:
        console.print(_table(found), "")
        colour = {FAILS: "red", INCOMPLETE: "yellow"}.get(found.verdict, "green")
        console.print(f"[bold {colour}]{escape(found.sentence())}[/]", soft_wrap=True)
        for text in found.missing:
            console.print(escape(f"Not tested: {text}"), soft_wrap=True, highlight=False)
        console.print(escape(f"Report in {folder}: {', '.join(f.name for f in files)}"), soft_wrap=True)
    return exit_code(found.verdict, refused=found.refused)


def _run_gb(options: argparse.Namespace) -> int:
    """Measure a converter in the frequency domain; there is no verdict, so that it neither passes nor fails."""
    checked((), dict(options.declare), GB)
    request = _request(options)
    folder = made_folder(options.out or Path("results") / f"certify_{options.fmu.stem}_{GB}", "--out")
    console = make_console(stderr=options.json)
    with held(folder), said_stages() as report:
        found = measure_stiffness(request, rated_frequency(request, 50.0), report)
        files = save_stiffness(found, request.fmu.stem, folder)
    figures = figures_of_stiffness(found, request.fmu.stem)
    if options.json:
        print(json.dumps(figures, indent=1, ensure_ascii=False))
        return 0
    for name, one in figures["least"].items():
        console.print(escape(f"least |{name}|: {one['value']:.4g} at {one['at_hz']:.4g} Hz"), highlight=False)
    slow = figures["slow"]
    console.print(
        escape(f"P/ω at {slow['at_hz']:g} Hz: {slow['real']:.4g} {slow['imag']:+.4g}j pu/pu"), highlight=False
    )
    console.print(escape(figures["sentence"][:1].upper() + figures["sentence"][1:]), soft_wrap=True)
    console.print(escape(f"Files in {folder}: {', '.join(f.name for f in files)}"), soft_wrap=True)
    return 0


def _request(options: argparse.Namespace) -> CertificationRequest:
    asked = {"--pod": options.pod, "--black-box": options.black_box, "--pdf": options.pdf,
             "--reactances": options.reactances != REACTANCES}  # fmt: skip
    if other := [name for name, value in asked.items() if value]:
        raise InputError(
            f"{', '.join(other)}: only --code {NTS631} has it; the other codes need no modes: leave it out, "
            "and set a damping controller by --set"
        )
    if study := [name for name, _ in options.set if name.split(".")[0] in STUDY]:
        raise InputError(f"--set {study[0]}: the test bench has no such component; give values of the converter only")
    request = CertificationRequest(as_device(options.fmu, options.binding), options.binding, dict(options.set))
    request.check()
    return request


def _table(found: CodeCertificate) -> PlainTable:
    table = PlainTable(title=escape(found.code.title), title_justify="left", header_style="bold")
    for column in ("Row", "Criterion", "Found", "Margin", ""):
        table.add_column(column)
    for v in found.verdicts:
        if v.unknown:
            table.add_row(escape(v.row.name), "", escape(v.unknown[:100]), "–", "not judged")
        for f in v.findings:
            margin = "–" if f.margin is None else f"{100 * f.margin:+.0f} %"
            word = "accepted" if f.accepted else "not accepted"
            word = f"{word}, shown only" if v.row.shown_only else word
            table.add_row(escape(v.row.name), escape(f.criterion), escape(f.text[:100]), margin, word)
    return table
