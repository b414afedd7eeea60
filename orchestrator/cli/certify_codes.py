"""``gfor certify --code``: the rows of one grid code on a test bench."""

import argparse
import json
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.markup import escape

from orchestrator.certification.codes.all_codes import BY_DECLARATION, CODES, code_for
from orchestrator.certification.codes.certificate import CodeCertificate, certify_code
from orchestrator.certification.codes.record import figures_of, save_certificate
from orchestrator.certification.codes.row_verdict import NOT_JUDGED
from orchestrator.certification.devices import Device
from orchestrator.certification.request import REACTANCES, STUDY, CertificationRequest
from orchestrator.certification.verdict import FAILS, INCOMPLETE, exit_code
from orchestrator.cli.certificate import certified
from orchestrator.cli.certify_sensitivities import find_needs
from orchestrator.cli.terminal import make_console
from orchestrator.errors import InputError
from orchestrator.fmi.devices import as_device
from orchestrator.report.tables import PlainTable

NTS631, GB, ALL = "nts631", "gb", "all"

CODE_NAMES = (NTS631, *CODES, *BY_DECLARATION, GB, ALL)
"""What ``--code`` takes."""


def codes_of(asked: str) -> tuple[str, ...]:
    """The codes with a verdict that an option ``--code`` asks for."""
    return (NTS631, *CODES, *BY_DECLARATION) if asked == ALL else (asked,)


def run_code(options: argparse.Namespace, device: Device) -> int:
    """Run one code's rows, write the certificate and print it.

    Returns
    -------
    As `gfor certify`.
    """
    check_code_options(options, [device])
    folder = options.out or Path("results") / f"certify_{device.name}_{options.code}"
    console = make_console(stderr=options.json)
    found, files = certified_code(options, device, options.code, folder, console)
    if not options.json:
        show_code(found, files, folder, console)
    needs = find_needs(options, found, folder, console) if options.sensitivities else None
    if options.json:
        beside = {"sensitivities": needs} if options.sensitivities else {}
        print(json.dumps(figures_of(found) | beside, indent=1, ensure_ascii=False))
    return exit_code(found.verdict, refused=found.refused)


def check_code_options(options: argparse.Namespace, devices: Sequence[Device]) -> None:
    """Refuse what only the norm's damping test has."""
    asked = {"--pod": options.pod, "--black-box": options.black_box, "--pdf": options.pdf,
             "--reactances": options.reactances != REACTANCES}  # fmt: skip
    if other := [name for name, value in asked.items() if value]:
        raise InputError(
            f"{', '.join(other)}: only --code {NTS631} has it; the other codes need no modes: leave it out, "
            "and set a damping controller by --set"
        )
    if study := [name for device in devices for name in device.values if name.split(".")[0] in STUDY]:
        raise InputError(f"--set {study[0]}: the test bench has no such component; give values of the converter only")


def bench_request(device: Device) -> CertificationRequest:
    """A checked request for a device on the test bench."""
    request = CertificationRequest(as_device(device.file, device.binding), device.binding, device.values)
    request.check()
    return request


def certified_code(
    options: argparse.Namespace, device: Device, key: str, folder: Path, console: Console
) -> tuple[CodeCertificate, list[Path]]:
    """The certificate, and its files."""
    code = code_for(key, dict(options.declare))
    request = bench_request(device)
    return certified(
        options, request, folder, "orchestrator.certification.codes.bench_point",
        lambda executor, report: certify_code(request, code, executor, folder, report=report), save_certificate,
        console, (f"{device.name}, {key}", "rows"),
    )  # fmt: skip


def show_code(found: CodeCertificate, files: Sequence[Path], folder: Path, console: Console) -> None:
    """Print a certificate."""
    console.print(_table(found), "")
    colour = {FAILS: "red", INCOMPLETE: "yellow"}.get(found.verdict, "green")
    console.print(f"[bold {colour}]{escape(found.sentence())}[/]", soft_wrap=True)
    for text in found.missing:
        console.print(escape(f"Not tested: {text}"), soft_wrap=True, highlight=False)
    console.print(escape(f"Report in {folder}: {', '.join(f.name for f in files)}"), soft_wrap=True)


def _table(found: CodeCertificate) -> PlainTable:
    table = PlainTable(title=escape(found.code.title), title_justify="left", header_style="bold")
    for column in ("Row", "Criterion", "Found", "Margin", ""):
        table.add_column(column)
    for v in found.verdicts:
        if v.unknown:
            table.add_row(escape(v.row.name), "", escape(v.unknown[:160]), "–", NOT_JUDGED)
        for f in v.findings:
            margin = "–" if f.margin is None else f"{100 * f.margin:+.0f} %"
            table.add_row(escape(v.row.name), escape(f.criterion), escape(f.text[:160]), margin, v.word(f))
    return table
