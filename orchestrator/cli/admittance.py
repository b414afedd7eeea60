"""``gfor fmu admittance``: a device known only through FMI, measured at its port."""

import argparse
import math
from pathlib import Path
from typing import Any

from rich.console import Group
from rich.markup import escape

from orchestrator.analysis.modes import damping_percent
from orchestrator.api.admittance import admittance
from orchestrator.cli.arguments import add_options, switch
from orchestrator.cli.case_arguments import add_excitation_arguments, excitation_of
from orchestrator.cli.terminal import make_console, print_json, said_stages
from orchestrator.errors import InputError
from orchestrator.immittance.measured import as_scan
from orchestrator.immittance.scan_files import write_ztool
from orchestrator.report.tables import make_table
from orchestrator.safe_files import made_folder


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_options(parser, "admittance")
    add_excitation_arguments(parser)
    switch(parser, "--json", "print JSON")


def run(options: argparse.Namespace) -> int:
    if options.scan and not options.voltage:
        raise InputError("--scan: a scan is in siemens; give the rated voltage as well, as in --voltage '230 kV'")
    console, how = make_console(stderr=options.json), excitation_of(options)
    with said_stages() as report:
        found = admittance(
            options.fmu, binding=options.binding, values=dict(options.set), step=options.step, method=how.method,
            amplitude=how.amplitude, frequencies=(how.lowest_hz, how.highest_hz), use_state=not options.no_state,
            report=report,
        )  # fmt: skip
    folder = made_folder(options.out or Path("results") / f"admittance_{options.fmu.stem}", "--out")
    files = found.save(folder)
    if options.scan:
        scan = as_scan(options.scan.stem, found.response, found.rest, options.voltage)
        write_ztool(scan.in_siemens(options.voltage), options.scan)
    content, passive = found.as_json(), found.passivity
    if options.json:
        print_json(content)
        return 0
    console.print(_summary(content))
    active = ", ".join(f"{low:g}–{high:g} Hz" for low, high in passive.ranges()) or "nowhere in the measured range"
    console.print(f"Not passive: {active}; least relative index {passive.relative.min():.3f}", highlight=False)
    console.print(escape(f"Results in {folder}: {', '.join(f.name for f in files)}"), soft_wrap=True, highlight=False)
    return 0


def _summary(content: dict[str, Any]) -> Group:
    heading = (f"Admittance by {content['method']}: {content['lines']} lines from {content['range_hz'][0]:g} to "
             f"{content['range_hz'][1]:g} Hz, largest bound {content['largest_relative_bound']:.1e}; model of order "
             f"{content['model']['order']}, error {content['model']['error']:.1e}")  # fmt: skip
    rows = []
    for pole in content["model"]["poles"]:
        eigenvalue = complex(pole["real"], pole["imag"])
        value = f"{pole['real']:.4g}" + (f" ± j{pole['imag']:.4g}" if pole["imag"] else "")
        damping = f"{damping_percent(eigenvalue):.2f}" if eigenvalue else "–"
        rows.append((value, f"{pole['imag'] / (2 * math.pi):.4g}", damping))
    columns = ("Pole [rad/s]", "f [Hz]", "Damping [%]")
    table = make_table("Poles of the fitted model", *columns, left=0, rows=rows)
    return Group(heading, table)
