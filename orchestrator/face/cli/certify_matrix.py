"""``gfor certify`` with several devices or all codes: a certificate for each pair, and one matrix of them."""

import argparse
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.markup import escape

from orchestrator.cases.form.devices import Device
from orchestrator.core.errors import InputError
from orchestrator.core.safe_files import made_folder
from orchestrator.face.cli.certificate import (
    ALL,
    FREQUENCY,
    GB,
    certified,
    check_code_options,
    codes_of,
    measured_figures,
    show,
)
from orchestrator.face.cli.certify_frequency import measured_behaviour
from orchestrator.face.cli.certify_sensitivities import find_needs
from orchestrator.face.cli.terminal import make_console, make_errors, print_json
from orchestrator.output.report.terminal_tables import PlainTable, make_table
from orchestrator.output.results.lock import hold_folder
from orchestrator.studies.certification.acceptance import KEPT
from orchestrator.studies.certification.certificate import Certificate
from orchestrator.studies.certification.codes.known import codes_by_declaration
from orchestrator.studies.certification.codes.nts631 import NTS631
from orchestrator.studies.certification.codes.perturbation_plot import stiffness_in_words
from orchestrator.studies.certification.codes.row import checked
from orchestrator.studies.certification.matrix import (
    FIGURES,
    NOT_TESTED,
    READING,
    CertificateMatrix,
    MatrixCell,
    in_words,
    matrix_json,
    save_matrix,
)
from orchestrator.studies.points.failure import failure_kept


def run_matrix(options: argparse.Namespace, devices: Sequence[Device]) -> int:
    codes, left_out = codes_of(options.code), tuple[str, ...]()
    if options.code == ALL and not options.declare:
        left_out = tuple(codes_by_declaration())
        codes = tuple(key for key in codes if key not in left_out)
    codes += (GB, FREQUENCY) if options.code == ALL else ()
    several = len(devices) > 1
    for key in sorted({GB, FREQUENCY} & set(codes)):
        checked((), {} if options.code == ALL else dict(options.declare), key)
    if set(codes) - {NTS631}:
        check_code_options(options, devices)
    if several and options.check:
        raise InputError(
            f"--check {options.check}: a report of `gfor fmu check` is of one FMU, and there are "
            f"{len(devices)}; leave it out to have the tests run, or give --no-check"
        )
    folder = options.out or Path("results") / f"certify_{'matrix' if several else devices[0].name}"
    made_folder(folder, "--out")
    console = make_console(stderr=options.json)
    with hold_folder(folder):
        cells = {}
        for device in devices:
            own = argparse.Namespace(**vars(options))
            for key in codes:
                own.declare = (
                    options.declare if options.code != ALL or key in codes_by_declaration() else []
                )
                place = f"{device.name}/{key}" if several else key
                cells[device.name, key] = _tested(
                    own, device, key, folder, place, console, several=several
                )
        matrix = CertificateMatrix(tuple(d.name for d in devices), codes, cells, left_out)
        _check_any(matrix)
        files = save_matrix(matrix, devices, folder)
    for lost in (cell for cell in cells.values() if cell.failure is not None):
        make_errors().print(
            f"[yellow]not tested:[/] {escape(f'{lost.device}, {lost.code}: {lost.failure}')}"
        )
    if options.json:
        print_json(matrix_json(matrix, devices))
    else:
        console.print(matrix_table(matrix), "")
        console.print(READING, soft_wrap=True, highlight=False)
        colour = "green" if matrix.exit_code == 0 else "red"
        console.print(f"[bold {colour}]{escape(matrix.sentence())}[/]", soft_wrap=True)
        console.print(
            escape(f"Report in {folder}: {', '.join(f.name for f in files)}"), soft_wrap=True
        )
    return matrix.exit_code


def _tested(
    options: argparse.Namespace,
    device: Device,
    key: str,
    folder: Path,
    place: str,
    console: Console,
    *,
    several: bool,
) -> MatrixCell:
    """One device under one code; what cannot be tested says why, and the others go on.

    The acceptance tests of a device are run for its first certificate; ``options`` of the device remember them."""
    cell = MatrixCell(device.name, key, place)
    with failure_kept(cell):
        own = folder / place
        if key == GB:
            # it decides nothing, also where it cannot be measured
            cell.verdict, cell.figures = FIGURES, ()
            figures, _ = measured_figures(device, own)
            cell.figures = [*stiffness_in_words(figures), figures["phase_jump"]["sentence"]]
        elif key == FREQUENCY:
            figures, files = measured_behaviour(device, own)
            cell.take_behaviour(figures, files[0].name, files[-1].name)
        else:
            found, files = certified(options, device, key, own, console)
            cell.take(found)
            if not (options.json or several):
                show(found, files, own, console)
            if options.sensitivities and found.is_by_rows:
                _take_needs(options, found, cell, own, console)
        if not options.no_check and key not in (GB, FREQUENCY):
            options.check = own / KEPT
    if cell.failure is not None and cell.figures is not None:
        cell.verdict = NOT_TESTED
    if cell.failure is None and cell.figures is None and several and not options.json:
        console.print(
            escape(f"{device.name}, {key}: {cell.sentence}"), soft_wrap=True, highlight=False
        )
    return cell


def _take_needs(
    options: argparse.Namespace,
    found: Certificate,
    cell: MatrixCell,
    folder: Path,
    console: Console,
) -> None:
    """Find the needs of failed criteria; where that fails, the certificate stands."""
    if not options.json:
        console.print(escape(f"{cell.device}, {cell.code}:"), highlight=False)
    note = MatrixCell(cell.device, cell.code, cell.folder)
    with failure_kept(note):
        cell.has_needs = find_needs(options, found, folder, console) is not None
    if note.failure is not None:
        make_errors().print(
            f"[yellow]no sensitivities:[/] {escape(f'{cell.device}, {cell.code}: {note.failure}')}"
        )


def _check_any(matrix: CertificateMatrix) -> None:
    """Raise an error where no cell was tested; reasons that several cells share are told once."""
    if any(cell.failure is None for cell in matrix.cells.values()):
        return
    reasons: dict[str, list[str]] = {}
    for cell in matrix.cells.values():
        reasons.setdefault(str(cell.failure), []).append(f"{cell.device}, {cell.code}")
    if len(reasons) == 1:
        raise InputError(next(iter(reasons)))
    listed = "\n".join(f"  - {'; '.join(cells)}: {reason}" for reason, cells in reasons.items())
    raise InputError(f"nothing could be tested\n{listed}")


def matrix_table(matrix: CertificateMatrix) -> PlainTable:
    table = make_table(
        "Codes and devices: verdict, and narrowest margin", "", *matrix.devices, left=99
    )
    for code in matrix.codes:
        table.add_row(
            code, *("\n".join(in_words(matrix.cells[name, code])) for name in matrix.devices)
        )
    return table
