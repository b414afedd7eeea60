"""``gfor compare``: two recorded runs side by side."""

import argparse
import json
from dataclasses import asdict
from pathlib import Path

from rich.table import Table

from orchestrator.analysis.identification import IdentifiedMode
from orchestrator.cli.identify import mode_json
from orchestrator.cli.terminal import make_console
from orchestrator.errors import InputError
from orchestrator.study.comparison import compare, most_different, open_trajectory


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``gfor compare``."""
    parser.add_argument("first", type=Path, metavar="A", help="folder of a scenario's results, or its trajectory.nc")
    parser.add_argument("second", type=Path, metavar="B", help="the other one")
    parser.add_argument("--signal", action="append", metavar="SIGNAL",
                        help="'a.b' or 'a.b - c.d' (repeatable; default: those that differ most)")  # fmt: skip
    parser.add_argument("--start", type=float, default=2.0, metavar="T", help="oscillations are read from here [s] (2)")
    parser.add_argument("--json", action="store_true", help="print JSON")


def run(options: argparse.Namespace) -> int:
    """Compare two runs signal by signal."""
    a, b = open_trajectory(options.first), open_trajectory(options.second)
    signals = options.signal or most_different(a, b)
    if not signals:
        raise InputError(f"{options.first} and {options.second} have no signal in common")
    found = [compare(a, b, s, options.start, (str(options.first), str(options.second))) for s in signals]
    if options.json:
        print(json.dumps([asdict(c) | {"modes": [mode_json(m) for m in c.modes]} for c in found], indent=1))
        return 0
    table = Table(title=f"A: {options.first}\nB: {options.second}", title_justify="left", header_style="bold")
    for column in ("Signal", "Deviation A", "Deviation B", "Largest difference", "at [s]", "RMS", "A rings", "B rings"):
        table.add_column(column, justify="left" if column == "Signal" else "right")
    for c in found:
        table.add_row(f"{c.expression} [{c.unit}]", f"{c.deviations[0]:.4g}", f"{c.deviations[1]:.4g}",
                      f"{c.largest:.4g}", f"{c.at:.3f}", f"{c.rms:.4g}", *map(_mode_text, c.modes))  # fmt: skip
    make_console().print(table)
    return 0


def _mode_text(mode: IdentifiedMode | None) -> str:
    return f"{mode.frequency_hz:.3f} Hz, {mode.damping_percent:.2f} %" if mode else "–"
