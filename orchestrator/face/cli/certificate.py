"""``gfor certify --code``: one converter under one code."""

import argparse
import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.text import Text

from orchestrator.cases.form.devices import Device
from orchestrator.core.errors import InputError
from orchestrator.core.safe_files import made_folder
from orchestrator.devices.fmi.port_mapping import BoundDescription
from orchestrator.face.cli.arguments import asked_by, choose_executor
from orchestrator.face.cli.certify_sensitivities import find_needs
from orchestrator.face.cli.interrupted import saying_how_it_goes_on
from orchestrator.face.cli.study import Progressing
from orchestrator.face.cli.terminal import (
    make_console,
    make_errors,
    print_json,
    print_parts,
    said_stages,
)
from orchestrator.linear.spectra.modes import damping_ratio
from orchestrator.output.report.short_texts import short
from orchestrator.output.report.terminal_tables import PlainTable, make_table
from orchestrator.output.results.lock import hold_folder
from orchestrator.output.signatures.signing import check_key
from orchestrator.simulation.watch.finding import MISFIT
from orchestrator.studies.certification.acceptance import read_checks, run_checks
from orchestrator.studies.certification.certificate import Certificate, DampingCertificate
from orchestrator.studies.certification.codes import perturbation_plot
from orchestrator.studies.certification.codes.nts631 import NTS631
from orchestrator.studies.certification.codes.row import checked, in_words, like
from orchestrator.studies.certification.codes.row_verdict import NO_VERDICT, NOT_JUDGED, RowVerdict
from orchestrator.studies.certification.details import Details, read_details
from orchestrator.studies.certification.files import (
    JSON,
    read_record,
    save,
    signatures_of,
    spare_another,
)
from orchestrator.studies.certification.inside import check_target, put_inside
from orchestrator.studies.certification.judgement import PointVerdict
from orchestrator.studies.certification.kinds import (
    WITH_VERDICT,
    CertifyRequest,
    bench_request,
    usual_folder,
)
from orchestrator.studies.certification.margins import margin_of, narrowest
from orchestrator.studies.certification.matrix import BEHAVIOUR
from orchestrator.studies.certification.report_criteria import remarks_on
from orchestrator.studies.certification.request import STUDY, rated_frequency
from orchestrator.studies.certification.signed import sign_folder
from orchestrator.studies.certification.verdict import FAILS, INCOMPLETE, exit_code

_LONGEST = 100  # of a remark in the first table [characters]


def show(found: Certificate, files: Sequence[Path], folder: Path, console: Console) -> None:
    colour = {INCOMPLETE: "yellow"}.get(
        found.verdict, "green" if found.passed and not found.refused else "red"
    )
    said = found.sentence()
    open_rows = [v.name for v in found.verdicts if v.not_judged] if found.is_by_rows else []
    if open_rows:
        said += f" Not judged: {', '.join(open_rows)}."
    if found.is_by_rows and found.departures:
        said += f" Not as the code has it: {', '.join(found.departures)}."
    console.print(f"[bold {colour}]{escape(said)}[/]", soft_wrap=True)
    if isinstance(found, DampingCertificate):
        for remark, where in remarks_on(found):
            console.print(escape(f"{remark}; {where}."), soft_wrap=True, highlight=False)
        _show_damping_test(found, console)
    else:
        console.print(_verdicts(found), "")
        print_parts(console, map(escape, _remarks(found)))
        console.print(_criteria(found), "")
    console.print(escape(f"Report in {folder}: {', '.join(f.name for f in files)}"), soft_wrap=True)


def _verdicts(found: Certificate) -> PlainTable:
    table = make_table(
        f"{found.code.title}: {found.description.model_name}",
        "Row",
        "Verdict",
        "Criteria met",
        "Least margin",
        "Remark",
        left=99,
    )
    judged = [v for v in found.verdicts if v.is_judged]
    bad, unknown = (
        [v for v in judged if not v.accepted],
        [v for v in found.verdicts if v.not_judged],
    )
    counted = [
        f"{len(judged)} judged",
        f"{len(bad)} failed",
        f"{len(found.verdicts) - len(judged)} not judged",
    ]
    colour = {FAILS: "red", INCOMPLETE: "yellow"}.get(found.verdict, "green")
    table.add_row("all", Text(found.verdict, style=f"bold {colour}"), "", "", ", ".join(counted))
    for v in found.verdicts:
        known = [f for f in v.findings if f.accepted is not None]
        least = narrowest(known)
        word = "fails" if v in bad else "accepted"
        word = word if v.is_judged else NO_VERDICT
        word = NOT_JUDGED if v in unknown else word
        failed = "; ".join(f"{f.criterion}: {f.text}" for f in v.failed)
        remark = v.not_judged or failed or (f"nearest: {least.criterion}" if least else "")
        margin = "–" if least is None else margin_of(least)
        table.add_row(v.row.name, word, _met(v), margin, short(remark, _LONGEST))
    return table


def _met(v: RowVerdict) -> str:
    """Return how many criteria are met, of those that are judged, and how many are not."""
    judged = [f.accepted for f in v.findings if f.accepted is not None]
    left = len(v.findings) - len(judged)
    if not judged:
        return f"none of {left} judged" if left else "–"
    return f"{sum(judged)} of {len(judged)}{f', {left} not judged' if left else ''}"


def _remarks(found: Certificate) -> list[str]:
    """Remarks on the device, its acceptance tests and parts not tested, each once."""
    said = _misfits(r.findings for r in found.results.values())
    if isinstance(found.description, BoundDescription):
        said += [
            f"the binding has {text}" for text in found.description.unlike_delivered().values()
        ]
    left = [part for part in found.missing if part not in found.departures]
    if left:
        said.append(f"Not tested: {'; '.join(left)}")
    return list(dict.fromkeys(said))


def _misfits(findings: Iterable[Sequence[Mapping[str, Any]]]) -> list[str]:
    return list(
        dict.fromkeys(str(f["message"]) for found in findings for f in found if f["kind"] == MISFIT)
    )


def _criteria(found: Certificate) -> PlainTable:
    table = make_table("Criteria", "Row", "Criterion", "Found", "Margin", "Verdict", left=99)
    for v in found.verdicts:
        for f in v.findings:
            table.add_row(v.row.name, f.criterion, short(f.text, 160), margin_of(f), v.word(f))
    return table


def _show_damping_test(found: DampingCertificate, console: Console) -> None:
    print_parts(console, map(escape, _misfits(p.findings for p in found.results.values())))
    headings = (
        "X_L [pu]",
        "least damped [Hz]",
        "ξ [%]",
        "the same without",
        "ΔP5M5/ΔP1M1",
        "in the signal: ξ [%]",
        "",
    )
    table = make_table(f"Damping test, {found.signal} watched", *headings, left=0)
    for v in found.verdicts:
        refusal = Text("not accepted" if v.is_judged else NOT_JUDGED, "red")
        table.add_row(f"{v.X_L:g}", *_figures(v), "accepted" if v.accepted else refusal)
    console.print(table, "")
    for v in found.verdicts:
        said = v.of_base_critical()
        if said:
            console.print(f"X_L = {v.X_L:g} pu: {escape(said)}", soft_wrap=True, highlight=False)
    if found.stored:
        console.print(f"{found.stored} of {len(found.results)} points were there already")


def _figures(v: PointVerdict) -> Iterator[str]:
    worst = v.modes[0] if v.modes else None
    yield from (
        ("–", "–")
        if worst is None
        else (f"{worst.frequency_hz:.3f}", f"{worst.damping_percent:.2f}")
    )
    before = worst.before if worst else None
    yield (
        "–"
        if before is None
        else f"{before.imag / (2 * np.pi):.3f} Hz, {100 * damping_ratio(before):.2f} %"
    )
    ratio = v.time.swings.ratio if v.time else None
    seen = min((m.damping_percent for m in v.time.modal.modes), default=None) if v.time else None
    yield "–" if ratio is None else f"{ratio:.3f}"
    yield "–" if seen is None else f"{seen:.2f}"


GB = "gb"  # the code of Great Britain, which has figures and no verdict
ALL = "all"  # every code
FREQUENCY = BEHAVIOUR  # the name of voltage source behaviour in frequency, among the codes
CODES = (*WITH_VERDICT, GB, FREQUENCY)
LISTED = ", ".join(map(in_words, CODES))  # as the help of ``--code`` names them


def read_code(text: str) -> str:
    if text in (*CODES, ALL):
        return text
    near = " or ".join(like(text, CODES))
    raise ValueError(
        f"{text!r} is no code; {f'did you mean {near}?' if near else f'give one of {LISTED}, or {ALL}'}"
    )


def codes_of(asked: str) -> tuple[str, ...]:
    return WITH_VERDICT if asked == ALL else (asked,)


def run_one(options: argparse.Namespace, device: Device) -> int:
    key = options.code
    if key != NTS631:
        check_code_options(options, [device])
    folder = options.out or usual_folder(device.name, key)
    console = make_console(stderr=options.json)
    if options.into:
        check_target(device.file, options.into)
    found, files = certified(options, device, key, folder, console)
    if options.into:
        files.append(put_inside(folder, device.file, options.into))
    if not options.json:
        show(found, files, folder, console)
    beside: dict[str, Any] = {}
    if options.sensitivities and found.is_by_rows:
        beside = {"sensitivities": find_needs(options, found, folder, console)}
    if options.json:
        content = json.loads((folder / JSON).read_text(encoding="utf-8"))
        print_json(content | beside)
    return exit_code(found.verdict, refused=found.refused)


def check_code_options(options: argparse.Namespace, devices: Sequence[Device]) -> None:
    remedy = "leave it out, and set a damping controller by --set"
    why = f"only --code {NTS631} has it; {remedy}"
    _refuse_options(options, ("pod", "black-box", "reactances"), why)
    study = [name for device in devices for name in device.values if name.split(".")[0] in STUDY]
    if study:
        raise InputError(
            f"--set {study[0]}: the test bench has no such component; give values of the converter only"
        )


def refuse_certificate_options(options: argparse.Namespace, code: str) -> None:
    """Refuse the options of a certificate for a code that gives figures alone."""
    why = f"--code {code} gives figures and no certificate; leave it out"
    _refuse_options(options, ("pdf", "details", "check", "sign"), why)


def _refuse_options(options: argparse.Namespace, names: Iterable[str], why: str) -> None:
    """Refuse options by their names without dashes, all that are given in one error."""
    given = [f"--{name}" for name in names if getattr(options, name.replace("-", "_"))]
    if given:
        raise InputError(f"{', '.join(given)}: {why}")


def certified(
    options: argparse.Namespace, device: Device, key: str, folder: Path, console: Console
) -> tuple[Certificate, list[Path]]:
    """Compute a certificate with its acceptance tests, and write its files; points are kept as they come."""
    given = {
        "fmu": device.file,
        "code": key,
        "binding": device.binding,
        "values": device.values,
        "declared": dict(options.declare),
    }
    issue = CertifyRequest(**asked_by(options, CertifyRequest) | given).issue()
    request = issue.request
    details = read_details(options.details) if options.details else Details()
    acceptance = read_checks(options.check, request.fmu, request.binding) if options.check else None
    spare_another(folder, key, request.fmu, request.binding)
    if options.sign:
        check_key(options.sign)
    made_folder(folder, "--out")
    progress = Progressing(folder)
    with saying_how_it_goes_on(progress.how_it_goes_on), hold_folder(folder):
        executor = choose_executor(options, [issue.parts.task.__module__])
        told = (f"{device.name}, {key}: computing", f"{issue.parts.one}s")
        found = progress.compute(
            lambda report: issue.compute(executor, folder, report), executor, console, told
        )
        if acceptance is not None:
            acceptance.keep(folder)
        elif not options.no_check:
            if not console.is_terminal:
                make_errors().print(
                    "acceptance tests of the FMU: about a minute; --no-check leaves them out"
                )
            with console.status("Acceptance tests of the FMU"):
                acceptance = run_checks(request.fmu, request.binding, folder)
        found.details, found.acceptance = details, acceptance
        files = save(found, folder, pdf=options.pdf)
        if options.sign:
            sign_folder(folder, read_record(folder / JSON), options.sign)
            files.append(folder / signatures_of(folder).envelope)
        return found, files


def run_stiffness(options: argparse.Namespace, device: Device) -> int:
    refuse_certificate_options(options, GB)
    checked((), dict(options.declare), GB)
    check_code_options(options, [device])
    folder = options.out or Path("results") / f"certify_{device.name}_{GB}"
    console = make_console(stderr=options.json)
    with hold_folder(folder):
        figures, files = measured_figures(device, folder)
    if options.json:
        print_json(figures)
        return 0
    for line in perturbation_plot.stiffness_in_words(figures):
        console.print(escape(line), highlight=False)
    console.print(escape(figures["phase_jump"]["sentence"]), soft_wrap=True, highlight=False)
    console.print(escape(figures["sentence"][:1].upper() + figures["sentence"][1:]), soft_wrap=True)
    console.print(escape(f"Files in {folder}: {', '.join(f.name for f in files)}"), soft_wrap=True)
    return 0


def measured_figures(device: Device, folder: Path) -> tuple[dict[str, Any], list[Path]]:
    request = bench_request(device.file, device.binding, device.values)
    made_folder(folder, "--out")
    with said_stages() as report:
        f_n = rated_frequency(request, 50.0)
        found = perturbation_plot.measure_stiffness(request, f_n, report)
    files = perturbation_plot.save_stiffness(found, request.fmu.stem, f_n, folder)
    return perturbation_plot.figures_of_stiffness(found, request.fmu.stem, f_n), files
