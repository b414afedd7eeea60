"""``gfor fmu admittance``: a device known only through FMI, measured at its port."""

import argparse
import cmath
import math
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Group
from rich.markup import escape

from orchestrator.analysis.modes import damping_percent
from orchestrator.binding.binding import bound_fmu
from orchestrator.black_box.bench import Bench
from orchestrator.black_box.files import identification_json, save_identification
from orchestrator.black_box.fitting import fit, require_fitting
from orchestrator.black_box.frequency_response import measure
from orchestrator.black_box.passivity import passivity
from orchestrator.black_box.port import check_port, start_of, values_for
from orchestrator.cli.arguments import option, quantity, repeatable, seconds, setting, switch
from orchestrator.cli.excitation import add_excitation_arguments, excitation_of
from orchestrator.cli.terminal import make_console, print_json, said_stages
from orchestrator.errors import InputError
from orchestrator.immittance.measured import as_scan
from orchestrator.immittance.ztool import write_ztool
from orchestrator.report.tables import make_table
from orchestrator.results.staging import new_run_id, staged
from orchestrator.safe_files import made_folder


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("fmu", type=Path, metavar="FILE.fmu", help="a device")
    option(parser, "--binding", "vendor.toml", "maps the FMU's variables to our port", read=Path)
    repeatable(parser, "--set", "VARIABLE=VALUE", "a value of the FMU, such as P_0=0.9 or pod_p.enabled=true "
               "(repeatable)", read=setting)  # fmt: skip
    option(parser, "--step", "H", "communication step [s] (100 us)", read=seconds, default=1e-4)
    option(parser, "--out", "DIR", "folder (default: results/admittance_<file>)", read=Path)
    option(parser, "--scan", "FILE.txt", "write Z-tool's form too, for `gfor fmu nyquist`", read=Path)
    option(parser, "--voltage", "V", "rated voltage for --scan", read=quantity("kV"))
    add_excitation_arguments(parser)
    switch(parser, "--json", "print JSON")


def run(options: argparse.Namespace) -> int:
    """Measure, fit, write, and say what was found."""
    require_fitting()
    if options.scan and not options.voltage:
        raise InputError("--scan: a scan is in siemens; give the rated voltage as well, as in --voltage '230 kV'")
    console = make_console(stderr=options.json)
    description = bound_fmu(options.fmu, options.binding)
    values = values_for(description, dict(options.set))
    magnitude, angle = (float(values.get(name, start_of(description, name))) for name in ("v_0", "theta_0"))
    rest = cmath.rect(magnitude, angle)
    bench = Bench(
        description, values, np.array([rest.real, rest.imag]), step_size=options.step,
        restore=False if options.no_state else None,
    )  # fmt: skip
    check_port(description, bench)
    with said_stages() as report:
        response = measure(bench, excitation_of(options), report)
        model, passive = fit(response), passivity(response)
    folder = made_folder(options.out or Path("results") / f"admittance_{options.fmu.stem}", "--out")
    with staged(folder, new_run_id()) as staging:
        files = save_identification(response, model, passive, staging)
    if options.scan:
        scan = as_scan(options.scan.stem, response, rest, options.voltage)
        write_ztool(scan.in_siemens(options.voltage), options.scan)
    content = identification_json(response, model, passive)
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
