"""``gfor compare`` and ``gfor identify``: what recorded runs say."""

import argparse
import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from orchestrator.analysis.identification import IdentifiedMode
from orchestrator.errors import InputError
from orchestrator.study.comparison import compare, most_different, open_trajectory, recorded, strongest_modes


def add_compare(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``gfor compare``."""
    parser.add_argument("first", type=Path, metavar="A", help="folder of a scenario's results, or its trajectory.nc")
    parser.add_argument("second", type=Path, metavar="B", help="the other one")
    parser.add_argument("--signal", action="append", metavar="SIGNAL",
                        help="'a.b' or 'a.b - c.d' (repeatable; default: those that differ most)")  # fmt: skip
    parser.add_argument("--start", type=float, default=2.0, metavar="T", help="oscillations are read from here [s] (2)")
    parser.add_argument("--json", action="store_true", help="print JSON")


def add_identify(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``gfor identify``."""
    parser.add_argument("run", type=Path, metavar="RUN", help="folder of a scenario's results, or its trajectory.nc")
    parser.add_argument("signal", metavar="SIGNAL", help="'a.b' or 'a.b - c.d'")
    parser.add_argument("--start", type=float, default=2.0, metavar="T", help="beginning of the free response [s] (2)")
    parser.add_argument("--stop", type=float, metavar="T", help="its end [s] (default: the run's)")
    parser.add_argument("--json", action="store_true", help="print JSON")


def run_compare(options: argparse.Namespace, console: Console) -> int:
    """Compare two runs signal by signal."""
    a, b = open_trajectory(options.first), open_trajectory(options.second)
    signals = options.signal or most_different(a, b)
    if not signals:
        raise InputError(f"{options.first} and {options.second} have no signal in common")
    found = [compare(a, b, s, options.start, (str(options.first), str(options.second))) for s in signals]
    if options.json:
        print(json.dumps([asdict(c) | {"modes": [_mode_json(m) for m in c.modes]} for c in found], indent=1))
        return 0
    table = Table(title=f"A: {options.first}\nB: {options.second}", title_justify="left", header_style="bold")
    for column in ("Signal", "Deviation A", "Deviation B", "Largest difference", "at [s]", "RMS", "A rings", "B rings"):
        table.add_column(column, justify="left" if column == "Signal" else "right")
    for c in found:
        table.add_row(f"{c.expression} [{c.unit}]", f"{c.deviations[0]:.4g}", f"{c.deviations[1]:.4g}",
                      f"{c.largest:.4g}", f"{c.at:.3f}", f"{c.rms:.4g}", *map(_mode_text, c.modes))  # fmt: skip
    console.print(table)
    return 0


def run_identify(options: argparse.Namespace, console: Console) -> int:
    """Write a recorded signal as a sum of modes."""
    curve = recorded(open_trajectory(options.run), options.signal, str(options.run))
    modes = strongest_modes(curve, options.start, options.stop)
    if options.json:
        print(json.dumps([_mode_json(m) for m in modes], indent=1))
        return 0
    end = options.stop if options.stop is not None else float(curve["time"][-1])
    title = f"{options.signal} from {options.start:g} to {end:g} s (matrix pencil), strongest first"
    table = Table(title=title, title_justify="left", header_style="bold")
    for column in ("λ [rad/s]", "f [Hz]", "Damping [%]", "Amplitude"):
        table.add_column(column, justify="right")
    for m in modes:
        value = f"{m.eigenvalue.real:+.4f} ± j{abs(m.eigenvalue.imag):.4f}"
        table.add_row(value, f"{m.frequency_hz:.4f}", f"{m.damping_percent:.2f}", f"{m.amplitude:.3g}")
    console.print(table)
    return 0


def _mode_text(mode: IdentifiedMode | None) -> str:
    return f"{mode.frequency_hz:.3f} Hz, {mode.damping_percent:.2f} %" if mode else "–"


def _mode_json(mode: IdentifiedMode | None) -> dict[str, Any] | None:
    if mode is None:
        return None
    return {"real": mode.eigenvalue.real, "imag": mode.eigenvalue.imag, "frequency_hz": mode.frequency_hz,
            "damping_percent": mode.damping_percent, "amplitude": mode.amplitude}  # fmt: skip
