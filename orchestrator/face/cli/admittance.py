"""``gfor fmu admittance``: a device known only through FMI, measured at its port."""

import argparse
import math
from pathlib import Path
from typing import Any

from rich.console import Group
from rich.markup import escape

from orchestrator.core.errors import InputError
from orchestrator.core.safe_files import made_folder
from orchestrator.face.api.admittance import Admittance, admittance
from orchestrator.face.cli.arguments import add_options, switch
from orchestrator.face.cli.by_point import by_point
from orchestrator.face.cli.case_arguments import add_excitation_arguments, excitation_of
from orchestrator.face.cli.terminal import make_console, print_json, said_stages, say
from orchestrator.linear.spectra.modes import damping_percent
from orchestrator.output.report.terminal_tables import make_table
from orchestrator.output.results.file_writers import save_table
from orchestrator.studies.immittance.forms import FORMS, rows_in
from orchestrator.studies.immittance.measured import as_scan
from orchestrator.studies.immittance.scan import Scan
from orchestrator.studies.immittance.scan_files import ENDINGS, read_scan, write_imtb, write_ztool


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_options(parser, "admittance", forms=FORMS)
    add_excitation_arguments(parser)
    switch(parser, "--json", "print JSON")


def run(options: argparse.Namespace) -> int:
    folder = made_folder(options.out or Path("results") / f"admittance_{options.fmu.stem}", "--out")
    console = make_console(stderr=options.json)
    if options.fmu.suffix.lower() in ENDINGS:
        if not options.form or options.points or options.scan:
            raise InputError(
                f"{options.fmu}: a scan is no FMU that could be measured; give --form alone"
            )
        rated = options.frequency or 50.0
        files = _save_form(read_scan(options.fmu, rated), options, rated, folder)
    elif options.scan and not options.voltage:
        raise InputError(
            "--scan: a scan is in siemens; give the rated voltage as well, as in --voltage '230 kV'"
        )
    elif options.points:
        by_point(
            options, folder, lambda values, place: _row(_measured(options, values, place)[0]), {}
        )
        return 0
    else:
        found, files = _measured(options, {}, folder)
        say("warning", found.response.warnings)
        if options.json:
            print_json(found.as_json())
            return 0
        active = ", ".join(f"{low:g}–{high:g} Hz" for low, high in found.passivity.ranges())
        console.print(_summary(found.as_json()))
        console.print(
            f"Not passive: {active or 'nowhere in the measured range'}; least relative index "
            f"{found.passivity.relative.min():.3f}",
            highlight=False,
        )
    console.print(
        escape(f"Results in {folder}: {', '.join(f.name for f in files)}"),
        soft_wrap=True,
        highlight=False,
    )
    return 0


def _measured(
    options: argparse.Namespace, values: dict[str, Any], folder: Path
) -> tuple[Admittance, list[Path]]:
    """Measure, and write all that is asked for; a scan beside its point's folder bears the point's name."""
    how = excitation_of(options)
    with said_stages() as report:
        found = admittance(
            options.fmu,
            binding=options.binding,
            values=dict(options.set) | values,
            step=options.step,
            method=how.method,
            amplitude=how.amplitude,
            frequencies=(how.lowest_hz, how.highest_hz),
            use_state=not options.no_state,
            report=report,
        )
    files = found.save(folder)
    if options.scan or options.form:
        scan = as_scan(options.fmu.stem, found.response, found.rest, options.voltage or 1.0)
        scan = scan.in_siemens(options.voltage) if options.voltage else scan
        files += _save_form(scan, options, options.frequency or found.rated_hz, folder)
    if options.scan:
        to = (
            options.scan.with_stem(f"{options.scan.stem}_{folder.name}")
            if options.points
            else options.scan
        )
        write_imtb(scan, to) if to.suffix.lower() == ".csv" else write_ztool(scan, to)
    return found, files


def _save_form(
    scan: Scan, options: argparse.Namespace, rated_hz: float, folder: Path
) -> list[Path]:
    path = folder / f"{options.form}.csv"
    if options.form:
        save_table(rows_in(scan, options.form, rated_hz), path)
    return [path] if options.form else []


def _row(found: Admittance) -> dict[str, Any]:
    worst = min((p for p in found.model.poles.tolist() if p.imag >= 0 and p), key=damping_percent)
    bands = "; ".join(f"{low:g}–{high:g} Hz" for low, high in found.passivity.ranges())
    return {
        "least_damped_pole_hz": worst.imag / (2 * math.pi),
        "damping_percent": damping_percent(worst),
        "not_passive": bands,
        "least_index": float(found.passivity.relative.min()),
        "remark": "; ".join(found.response.warnings),
    }


def _summary(content: dict[str, Any]) -> Group:
    heading = (
        f"Admittance by {content['method']}: {content['lines']} lines from {content['range_hz'][0]:g} to "
        f"{content['range_hz'][1]:g} Hz, largest bound {content['largest_relative_bound']:.1e}; model of order "
        f"{content['model']['order']}, error {content['model']['error']:.1e}"
    )
    rows = []
    for pole in content["model"]["poles"]:
        eigenvalue = complex(pole["real"], pole["imag"])
        value = f"{pole['real']:.4g}" + (f" ± j{pole['imag']:.4g}" if pole["imag"] else "")
        damping = f"{damping_percent(eigenvalue):.2f}" if eigenvalue else "–"
        rows.append((value, f"{pole['imag'] / (2 * math.pi):.4g}", damping))
    columns = ("Pole [rad/s]", "f [Hz]", "Damping [%]")
    table = make_table("Poles of the fitted model", *columns, left=0, rows=rows)
    return Group(heading, table)
