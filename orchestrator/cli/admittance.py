"""``gfor admittance``: a device known only through FMI, measured at its port."""

import argparse
import cmath
import math
from collections.abc import Mapping
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
from orchestrator.cases.values import check_system_base, convert
from orchestrator.cli.arguments import option, repeatable, seconds, setting, switch
from orchestrator.cli.excitation import add_excitation_arguments, excitation_of
from orchestrator.cli.terminal import make_console, print_json, said_stages
from orchestrator.errors import InputError
from orchestrator.fmi.description import FmuDescription
from orchestrator.fmi.devices import NO_BUS, is_controller_alone
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
    add_excitation_arguments(parser)
    switch(parser, "--json", "print JSON")


def run(options: argparse.Namespace) -> int:
    """Measure, fit, write, and say what was found."""
    require_fitting()
    console = make_console(stderr=options.json)
    description = bound_fmu(options.fmu, options.binding)
    values = _values(description, dict(options.set))
    magnitude, angle = (float(values.get(name, _start(description, name))) for name in ("v_0", "theta_0"))
    rest = cmath.rect(magnitude, angle)
    bench = Bench(
        description, values, np.array([rest.real, rest.imag]), step_size=options.step,
        restore=False if options.no_state else None,
    )  # fmt: skip
    _check_port(description, bench)
    with said_stages() as report:
        response = measure(bench, excitation_of(options), report)
        model, passive = fit(response), passivity(response)
    folder = made_folder(options.out or Path("results") / f"admittance_{options.fmu.stem}", "--out")
    with staged(folder, new_run_id()) as staging:
        files = save_identification(response, model, passive, staging)
    content = identification_json(response, model, passive)
    if options.json:
        print_json(content)
        return 0
    console.print(_summary(content))
    active = ", ".join(f"{low:g}–{high:g} Hz" for low, high in passive.ranges()) or "nowhere in the measured range"
    console.print(f"Not passive: {active}; least relative index {passive.relative.min():.3f}", highlight=False)
    console.print(escape(f"Results in {folder}: {', '.join(f.name for f in files)}"), soft_wrap=True, highlight=False)
    return 0


def _values(description: FmuDescription, given: Mapping[str, Any]) -> dict[str, float | bool]:
    values = {}
    for name, value in given.items():
        info = description.variables.get(name)
        if info is None:
            raise InputError(f"--set {name}: {description.path.name} has no such variable; `gfor info` lists them")
        try:
            values[name] = convert(info, value)
            check_system_base(description, name, values[name])
        except ValueError as error:
            raise InputError(f"--set {name}: {error}") from error
    return values


def _start(description: FmuDescription, name: str) -> float:
    info = description.variables.get(name)
    return info.start_number if info is not None and info.start is not None else float(name == "v_0")


def _check_port(description: FmuDescription, bench: Bench) -> None:
    missing = [n for n in (*bench.inputs, *bench.outputs) if n not in description.variables]
    if missing and is_controller_alone(description):
        raise InputError(f"{description.path.name}: it has no {', '.join(missing)}: {NO_BUS}")
    if missing:
        raise InputError(
            f"{description.path.name}: it has no {', '.join(missing)}; an admittance is measured at our port, to which "
            "a vendor.toml maps another FMU's variables; give it with --binding"
        )


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
