"""``gfor certify --code nts631``: the norm's damping test."""

import argparse
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.table import Table
from rich.text import Text

from orchestrator.analysis.modes import damping_ratio
from orchestrator.certification.codes.all_codes import BY_DECLARATION
from orchestrator.certification.devices import Device
from orchestrator.certification.files import JSON, save
from orchestrator.certification.request import STUDY, CertificationRequest
from orchestrator.certification.study import Certification, certify
from orchestrator.certification.verdict import exit_code
from orchestrator.cli.certificate import certified
from orchestrator.cli.terminal import make_console
from orchestrator.errors import InputError
from orchestrator.fmi.devices import as_device
from orchestrator.report.tables import PlainTable
from orchestrator.watch.finding import MISFIT


def run_norm(options: argparse.Namespace, device: Device) -> int:
    """Run the test for one device, write its report and print the verdict."""
    if options.declare:
        raise InputError(f"--declare {options.declare[0][0]}: the damping test takes no declared value; leave it out, "
                         f"or choose --code {', '.join(BY_DECLARATION)}")  # fmt: skip
    console = make_console(stderr=options.json)
    folder = options.out or Path("results") / f"certify_{device.name}"
    result, files = certified_norm(options, device, folder, console)
    if options.json:
        print((folder / JSON).read_text(encoding="utf-8"), end="")
    else:
        show_norm(result, files, folder, console)
    return exit_code(result.verdict, refused=result.refused)


def certified_norm(
    options: argparse.Namespace, device: Device, folder: Path, console: Console
) -> tuple[Certification, list[Path]]:
    request = _request(options, device)
    return certified(
        options, request, folder, "orchestrator.certification.point",
        lambda executor, report: certify(request, executor, folder, report), partial(save, pdf=options.pdf), console,
        (f"{device.name}, nts631: computing", "points"),
    )  # fmt: skip


def show_norm(result: Certification, files: Sequence[Path], folder: Path, console: Console) -> None:
    good = result.passed and not result.refused
    console.print(f"[bold {'green' if good else 'red'}]{escape(result.sentence())}[/]", soft_wrap=True)
    misfits = [str(f["message"]) for p in result.points.values() for f in p.findings if f["kind"] == MISFIT]
    for text in dict.fromkeys(misfits):
        console.print(escape(text), soft_wrap=True, highlight=False)
    console.print(_table(result), "")
    for v in result.verdicts:
        if said := v.of_base_critical():
            console.print(f"X_L = {v.X_L:g} pu: {escape(said)}", soft_wrap=True, highlight=False)
    if result.stored:
        console.print(f"{result.stored} of {len(result.points)} points were there already")
    console.print(escape(f"Report in {folder}: {', '.join(f.name for f in files)}"), soft_wrap=True)


def _request(options: argparse.Namespace, device: Device) -> CertificationRequest:
    study = {name: value for name, value in device.values.items() if name.split(".")[0] in STUDY}
    own = {name: value for name, value in device.values.items() if name not in study}
    request = CertificationRequest(
        as_device(device.file, device.binding),
        device.binding,
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
