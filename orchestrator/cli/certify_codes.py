"""``gfor certify --code``: the rows of one grid code on a test bench."""

import argparse
import json
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from rich.console import Console
from rich.markup import escape
from rich.text import Text

from orchestrator.certification.codes.all_codes import BY_DECLARATION, CODES, code_for
from orchestrator.certification.codes.certificate import CodeCertificate, certify_code
from orchestrator.certification.codes.record import figures_of, save_certificate
from orchestrator.certification.codes.row_verdict import NO_VERDICT, NOT_JUDGED
from orchestrator.certification.devices import Device
from orchestrator.certification.margins import margin_of, narrowest
from orchestrator.certification.request import REACTANCES, STUDY, CertificationRequest
from orchestrator.certification.verdict import FAILS, INCOMPLETE, exit_code
from orchestrator.cli.certificate import certified
from orchestrator.cli.certify_sensitivities import find_needs
from orchestrator.cli.terminal import make_console
from orchestrator.errors import InputError
from orchestrator.fmi.devices import as_device
from orchestrator.fmi.port import BoundDescription
from orchestrator.report.tables import PlainTable, make_table
from orchestrator.watch.finding import MISFIT

_LONGEST = 100
"""Of a remark in the first table [characters]."""

NTS631, GB, ALL = "nts631", "gb", "all"

CODE_NAMES = (NTS631, *CODES, *BY_DECLARATION, GB, ALL)
"""What ``--code`` takes."""


def codes_of(asked: str) -> tuple[str, ...]:
    """The codes with a verdict that an option ``--code`` asks for."""
    return (NTS631, *CODES, *BY_DECLARATION) if asked == ALL else (asked,)


def run_code(options: argparse.Namespace, device: Device) -> int:
    """Run one code's rows, write the certificate and print it."""
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
    reactances = options.reactances != REACTANCES
    asked = {"--pod": options.pod, "--black-box": options.black_box, "--reactances": reactances}
    if other := [name for name, value in asked.items() if value]:
        raise InputError(
            f"{', '.join(other)}: only --code {NTS631} has it; leave it out, and set a damping controller by --set"
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
    code = code_for(key, dict(options.declare))
    request = bench_request(device)
    return certified(
        options, request, folder, "orchestrator.certification.codes.bench_point",
        lambda executor, report: certify_code(request, code, executor, folder, report=report),
        partial(save_certificate, pdf=options.pdf),
        console, (f"{device.name}, {key}: computing", "rows"),
    )  # fmt: skip


def show_code(found: CodeCertificate, files: Sequence[Path], folder: Path, console: Console) -> None:
    """Print a certificate: the answer row by row, then what its criteria found."""
    console.print(verdict_table(found), "")
    for text in remarks_on(found):
        console.print(escape(text), soft_wrap=True, highlight=False)
    console.print(_criteria(found), "")
    console.print(escape(f"Report in {folder}: {', '.join(f.name for f in files)}"), soft_wrap=True)


def verdict_table(found: CodeCertificate) -> PlainTable:
    """The verdict on the whole, and on each row with its narrowest margin."""
    table = make_table(f"{found.code.title}: {found.description.model_name}", "Row", "Verdict", "Criteria met",
                       "Least margin", "Remark", left=99)  # fmt: skip
    judged = [v for v in found.verdicts if v.judged]
    bad, unknown = [v for v in judged if not v.accepted], [v for v in found.verdicts if v.unknown]
    counted = [f"{len(judged)} judged", f"{len(bad)} failed", f"{len(found.verdicts) - len(judged)} not judged"]
    colour = {FAILS: "red", INCOMPLETE: "yellow"}.get(found.verdict, "green")
    table.add_row("all", Text(found.verdict, style=f"bold {colour}"), "", "", ", ".join(counted))
    for v in found.verdicts:
        known = [f for f in v.findings if f.accepted is not None]
        least = narrowest(known)
        word = NOT_JUDGED if v in unknown else NO_VERDICT if not v.judged else "fails" if v in bad else "accepted"
        remark = v.unknown or "; ".join(f.criterion for f in v.failed) or (least.criterion if least else "")
        margin = "–" if least is None else margin_of(least)
        met = f"{sum(f.accepted is True for f in known)} of {len(v.findings)}"
        table.add_row(v.row.name, word, met, margin, remark if len(remark) <= _LONGEST else f"{remark[:_LONGEST]} …")
    return table


def remarks_on(found: CodeCertificate) -> list[str]:
    """What else there is to know, once: of the device, of its acceptance tests, and of what was not tested."""
    results = found.results.values()
    said = [str(f["message"]) for r in results for f in r.findings if f["kind"] == MISFIT]
    if isinstance(found.description, BoundDescription):
        said += [f"the binding has {text}" for text in found.description.unlike_delivered().values()]
    if found.acceptance is not None and not found.acceptance.trusted:
        said.append(f"Acceptance tests failed: {', '.join(found.acceptance.faults)}; do not rely on the FMU as it is.")
    if found.missing:
        said.append(f"Not tested: {'; '.join(found.missing)}")
    return list(dict.fromkeys(said))


def _criteria(found: CodeCertificate) -> PlainTable:
    table = make_table("Criteria", "Row", "Criterion", "Found", "Margin", "", left=99)
    for v in found.verdicts:
        for f in v.findings:
            table.add_row(v.row.name, f.criterion, f.text[:160], margin_of(f), v.word(f))
    return table
