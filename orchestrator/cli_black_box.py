"""``gfor admittance`` and ``gfor black-box``: a device known only through FMI, alone and in a system."""

import argparse
import cmath
import json
import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console, Group
from rich.markup import escape
from rich.table import Table

from orchestrator.analysis.modes import Mode, find_spectrum
from orchestrator.black_box.bench import Bench
from orchestrator.black_box.coupled_modes import (
    BoxedSystem,
    component_participation,
    is_black_box,
    linearize_with_box,
)
from orchestrator.black_box.files import identification_json, save_identification
from orchestrator.black_box.fitting import fit
from orchestrator.black_box.frequency_response import METHODS, Excitation, measure
from orchestrator.black_box.passivity import passivity
from orchestrator.cases.prepare import PreparedScenario
from orchestrator.cases.values import convert
from orchestrator.errors import InputError
from orchestrator.fmi.description import FmuDescription
from orchestrator.study.modes import modes_of, running
from orchestrator.vendor.binding import bound_fmu

_DEFAULTS = Excitation()


def add_excitation(parser: argparse.ArgumentParser, seconds: Callable[[str], float]) -> None:
    """How the device is excited; for both commands."""
    parser.add_argument("--method", choices=METHODS, default=_DEFAULTS.method, help="excitation (default: multisine)")
    parser.add_argument("--amplitude", type=_positive, default=_DEFAULTS.amplitude, metavar="A",
                        help=f"largest deviation of the voltage [pu] ({_DEFAULTS.amplitude:g})")  # fmt: skip
    parser.add_argument("--from-hz", type=_positive, default=_DEFAULTS.lowest_hz, metavar="F",
                        help=f"lowest frequency [Hz] ({_DEFAULTS.lowest_hz:g})")  # fmt: skip
    parser.add_argument("--to-hz", type=_positive, default=_DEFAULTS.highest_hz, metavar="F",
                        help=f"highest frequency [Hz] ({_DEFAULTS.highest_hz:g})")  # fmt: skip
    parser.add_argument("--no-state", action="store_true", help="never save or restore the FMU's state")
    parser.add_argument("--json", action="store_true", help="print JSON")


def add_admittance(parser: argparse.ArgumentParser, seconds: Callable[[str], float], assignment: Any) -> None:
    """Arguments of ``gfor admittance``."""
    parser.add_argument("fmu", type=Path, metavar="FILE.fmu", help="a device")
    parser.add_argument("--binding", type=Path, metavar="vendor.toml", help="maps the FMU's variables to our port")
    parser.add_argument("--set", action="append", default=[], type=assignment, metavar="VARIABLE=VALUE",
                        help="a value of the FMU, such as P_0=0.9 or pod_p.enabled=true (repeatable)")  # fmt: skip
    parser.add_argument("--step", type=seconds, default=1e-4, metavar="H", help="communication step [s] (100 us)")
    parser.add_argument("--out", type=Path, metavar="DIR", help="folder (default: results/admittance_<file>)")
    add_excitation(parser, seconds)


def add_black_box(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``gfor black-box`` beyond those of every command on a case."""
    parser.add_argument("--component", required=True, metavar="NAME", help="the component to take for a black box")
    parser.add_argument("--out", type=Path, metavar="DIR", help="folder (default: results/<case>_black_box)")
    add_excitation(parser, float)


def run_admittance(options: argparse.Namespace, console: Console) -> int:
    """Measure, fit, write, and say what was found."""
    description = bound_fmu(options.fmu, options.binding)
    values = _values(description, dict(options.set))
    magnitude, angle = (float(values.get(name, _start(description, name))) for name in ("v_0", "theta_0"))
    rest = cmath.rect(magnitude, angle)
    bench = Bench(
        description, values, np.array([rest.real, rest.imag]), step_size=options.step,
        restore=False if options.no_state else None,
    )  # fmt: skip
    _check_port(description, bench)
    with console.status("measuring"):
        response = measure(bench, _excitation(options))
        model, passive = fit(response), passivity(response)
    folder = _folder(options.out or Path("results") / f"admittance_{options.fmu.stem}")
    files = save_identification(response, model, passive, folder)
    content = identification_json(response, model, passive)
    if options.json:
        print(json.dumps(content, indent=1))
        return 0
    console.print(_summary(content))
    active = ", ".join(f"{low:g}–{high:g} Hz" for low, high in passive.ranges()) or "nowhere in the measured range"
    console.print(f"Not passive: {active}; least relative index {passive.relative.min():.3f}", highlight=False)
    console.print(f"Results in {folder}: {', '.join(f.name for f in files)}", soft_wrap=True, highlight=False)
    return 0


def run_black_box(options: argparse.Namespace, console: Console, scenarios: list[PreparedScenario], case: Any) -> int:
    """Modes of a case's scenarios with one component identified, beside those from its states where it shows them."""
    folder = _folder(options.out or Path("results") / f"{case.name}_black_box")
    output = []
    for prepared in scenarios:
        with running(prepared) as master, console.status(f"{prepared.name}: measuring {options.component}"):
            if options.component not in master.components:
                known = ", ".join(master.components)
                raise InputError(
                    f"--component: scenario {prepared.name!r} has no {options.component!r}; it has: {known}"
                )
            restore = False if options.no_state else None
            system = linearize_with_box(master, options.component, _excitation(options), restore=restore)
            box = is_black_box(master.components[options.component])
            white = [] if box else modes_of(case, prepared, master, (0.1, 2.0)).modes
        passive = passivity(system.response)
        save_identification(system.response, system.identified, passive, folder / prepared.name)
        if options.json:
            output.append(_system_json(prepared.name, system, passive, white))
        else:
            console.print(_modes_table(prepared.title, system, white), "")
    if options.json:
        print(json.dumps(output, indent=1))
    else:
        console.print(f"Admittances and models in {folder}", soft_wrap=True, highlight=False)
    return 0


def _excitation(options: argparse.Namespace) -> Excitation:
    if not options.from_hz < options.to_hz:
        raise InputError(f"--from-hz {options.from_hz:g} must be below --to-hz {options.to_hz:g}")
    return Excitation(options.method, options.from_hz, options.to_hz, amplitude=options.amplitude)


def _values(description: FmuDescription, given: Mapping[str, Any]) -> dict[str, float | bool]:
    values = {}
    for name, value in given.items():
        info = description.variables.get(name)
        if info is None:
            raise InputError(f"--set {name}: {description.path.name} has no such variable; `gfor info` lists them")
        try:
            values[name] = convert(info, value)
        except ValueError as error:
            raise InputError(f"--set {name}: {error}") from error
    return values


def _start(description: FmuDescription, name: str) -> float:
    info = description.variables.get(name)
    return float(info.start) if info is not None and info.start else (1.0 if name == "v_0" else 0.0)


def _check_port(description: FmuDescription, bench: Bench) -> None:
    missing = [n for n in (*bench.inputs, *bench.outputs) if n not in description.variables]
    if missing:
        raise InputError(
            f"{description.path.name}: it has no {', '.join(missing)}; an admittance is measured at our port, to which "
            "a vendor.toml maps another FMU's variables; give it with --binding"
        )


def _summary(content: dict[str, Any]) -> Group:
    heading = (f"Admittance by {content['method']}: {content['lines']} lines from {content['range_hz'][0]:g} to "
             f"{content['range_hz'][1]:g} Hz, largest bound {content['largest_relative_bound']:.1e}; model of order "
             f"{content['model']['order']}, error {content['model']['error']:.1e}")  # fmt: skip
    table = Table(title="Poles of the fitted model", title_justify="left", header_style="bold")
    for column in ("Pole [rad/s]", "f [Hz]", "Damping [%]"):
        table.add_column(column, justify="right")
    for pole in content["model"]["poles"]:
        size = math.hypot(pole["real"], pole["imag"])
        value = f"{pole['real']:.4g}" + (f" ± j{pole['imag']:.4g}" if pole["imag"] else "")
        damping = f"{-100 * pole['real'] / size:.2f}" if size else "–"
        table.add_row(value, f"{pole['imag'] / (2 * math.pi):.4g}", damping)
    return Group(heading, table)


def _nearest(mode: Mode, others: list[Mode]) -> Mode | None:
    return min(others, key=lambda m: abs(m.eigenvalue - mode.eigenvalue), default=None)


def _modes_table(title: str, system: BoxedSystem, white: list[Mode]) -> Table:
    fitted = f"order {len(system.identified.A)}, fit {system.identified.error:.1e}"
    name = f"{title}: {system.component} as a black box, {fitted}"
    table = Table(title=name, title_justify="left", header_style="bold")
    columns = ["f [Hz]", "Damping [%]", "the box takes part [%]"]
    columns += ["with its states: f [Hz]", "Damping [%]", "takes part [%]"] if white else []
    for column in columns:
        table.add_column(escape(column), justify="right")
    for mode in system.modes():
        row = [f"{mode.frequency_hz:.4f}", f"{mode.damping_percent:.3f}", f"{100 * system.participation(mode):.2f}"]
        other = _nearest(mode, white)
        if other is not None:
            share = component_participation(other, system.component)
            row += [f"{other.frequency_hz:.4f}", f"{other.damping_percent:.3f}", f"{100 * share:.2f}"]
        table.add_row(*row)
    return table


def _system_json(name: str, system: BoxedSystem, passive: Any, white: list[Mode]) -> dict[str, Any]:
    def figures(mode: Mode) -> dict[str, float]:
        return {"real": mode.eigenvalue.real, "imag": mode.eigenvalue.imag, "frequency_hz": mode.frequency_hz,
                "damping_percent": mode.damping_percent,
                "participation": component_participation(mode, system.component)}  # fmt: skip

    growth = find_spectrum(system.model, 0.1, 2.0).growth_rate
    return {"scenario": name, "component": system.component, "residual": system.residual, "growth": growth,
            "identification": identification_json(system.response, system.identified, passive),
            "modes": [figures(m) for m in system.modes()], "white_box_modes": [figures(m) for m in white]}  # fmt: skip


def _folder(path: Path) -> Path:
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"--out {path}: results cannot be written there: {error.strerror}") from error
    return path


def _positive(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not (value > 0 and math.isfinite(value)):
        raise argparse.ArgumentTypeError(f"{text!r} must be a number above 0")
    return value
