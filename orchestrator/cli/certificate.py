"""``gfor certify --code``: one converter under one code."""

import argparse
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape

from orchestrator.cases.devices import Device
from orchestrator.certification.acceptance import read_checks, run_checks
from orchestrator.certification.certificate import Certificate, Judged
from orchestrator.certification.codes import frequency_domain
from orchestrator.certification.codes.certificate import CodeCertificate
from orchestrator.certification.codes.row import checked
from orchestrator.certification.details import Details, read_details
from orchestrator.certification.files import JSON, save
from orchestrator.certification.inside import check_target, put_inside
from orchestrator.certification.issue import NTS631, WITH_VERDICT, bench_request, issue_of
from orchestrator.certification.request import REACTANCES, STUDY, rated_frequency
from orchestrator.certification.verdict import exit_code
from orchestrator.cli.certificate_screen import show
from orchestrator.cli.certify_sensitivities import find_needs
from orchestrator.cli.executors import choose_executor
from orchestrator.cli.interrupted import saying_how_it_goes_on
from orchestrator.cli.points import Progressing
from orchestrator.cli.terminal import make_console, make_errors, print_json, said_stages
from orchestrator.errors import InputError
from orchestrator.results.lock import held
from orchestrator.safe_files import made_folder

GB, ALL = "gb", "all"
CODE_NAMES = (*WITH_VERDICT, GB, ALL)  # what ``--code`` takes


def codes_of(asked: str) -> tuple[str, ...]:
    return WITH_VERDICT if asked == ALL else (asked,)


def run_one(options: argparse.Namespace, device: Device) -> int:
    key = options.code
    if key != NTS631:
        check_code_options(options, [device])
    folder = options.out or Path("results") / f"certify_{device.name}{'' if key == NTS631 else f'_{key}'}"
    console = make_console(stderr=options.json)
    if options.into:
        check_target(device.file, options.into)
    found, files = certified(options, device, key, folder, console)
    if options.into:
        files.append(put_inside(folder, device.file, options.into))
    if not options.json:
        show(found, files, folder, console)
    beside: dict[str, Any] = {}
    if options.sensitivities and isinstance(found, CodeCertificate):
        beside = {"sensitivities": find_needs(options, found, folder, console)}
    if options.json:
        content = json.loads((folder / JSON).read_text(encoding="utf-8"))
        print_json(content | beside)
    return exit_code(found.verdict, refused=found.refused)


def check_code_options(options: argparse.Namespace, devices: Sequence[Device]) -> None:
    reactances = options.reactances != REACTANCES
    asked = {"--pod": options.pod, "--black-box": options.black_box, "--reactances": reactances}
    if other := [name for name, value in asked.items() if value]:
        raise InputError(
            f"{', '.join(other)}: only --code {NTS631} has it; leave it out, and set a damping controller by --set"
        )
    if study := [name for device in devices for name in device.values if name.split(".")[0] in STUDY]:
        raise InputError(f"--set {study[0]}: the test bench has no such component; give values of the converter only")


def certified(
    options: argparse.Namespace, device: Device, key: str, folder: Path, console: Console
) -> tuple[Certificate[Judged], list[Path]]:
    """Compute a certificate with its acceptance tests, and write its files; points are kept as they come."""
    issue = issue_of(
        key, device.file, device.binding, device.values, declared=dict(options.declare), pod=options.pod,
        reactances=options.reactances, black_box=options.black_box,
    )  # fmt: skip
    request = issue.request
    details = read_details(options.details) if options.details else Details()
    acceptance = read_checks(options.check, request.fmu, request.binding) if options.check else None
    made_folder(folder, "--out")
    progress = Progressing(folder)
    with saying_how_it_goes_on(progress.how_it_goes_on), held(folder):
        executor = choose_executor(options, [issue.worker])
        told = (f"{device.name}, {key}: computing", issue.rows)
        found = progress.compute(lambda report: issue.compute(executor, folder, report), executor, console, told)
        if acceptance is not None:
            acceptance.keep(folder)
        elif not options.no_check:
            if not console.is_terminal:
                make_errors().print("acceptance tests of the FMU: about a minute; --no-check leaves them out")
            with console.status("Acceptance tests of the FMU"):
                acceptance = run_checks(request.fmu, request.binding, folder)
        found.details, found.acceptance = details, acceptance
        return found, save(found, folder, pdf=options.pdf)


def run_stiffness(options: argparse.Namespace, device: Device) -> int:
    asked = {"--pdf": options.pdf, "--details": options.details, "--check": options.check}
    if other := [name for name, value in asked.items() if value]:
        raise InputError(f"{', '.join(other)}: --code {GB} gives figures and no certificate; leave it out")
    checked((), dict(options.declare), GB)
    check_code_options(options, [device])
    folder = options.out or Path("results") / f"certify_{device.name}_{GB}"
    console = make_console(stderr=options.json)
    with held(folder):
        figures, files = measured_figures(device, folder)
    if options.json:
        print_json(figures)
        return 0
    for line in frequency_domain.stiffness_in_words(figures):
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
        found = frequency_domain.measure_stiffness(request, f_n, report)
    files = frequency_domain.save_stiffness(found, request.fmu.stem, f_n, folder)
    return frequency_domain.figures_of_stiffness(found, request.fmu.stem, f_n), files
