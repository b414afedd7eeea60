"""``gfor signal compare``: two recorded runs side by side."""

import argparse

from rich.markup import escape

from orchestrator.face.api.comparison import compare
from orchestrator.face.cli.arguments import add_kept_argument, add_options
from orchestrator.face.cli.terminal import (
    keep_json,
    make_console,
    make_errors,
    print_json,
    print_parts,
    saying_warnings,
)
from orchestrator.linear.signals.identification import IdentifiedMode
from orchestrator.output.report.terminal_tables import make_table


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_options(parser, "compare")
    add_kept_argument(parser, "comparison")


def run(options: argparse.Namespace) -> int:
    with saying_warnings():
        found = compare(options.first, options.second, options.signal or (), options.start)
    keep_json(found.as_json(), options.out, "comparison")
    if options.json:
        print_json(found.as_json())
        for text in found.remarks:
            make_errors().print(text, markup=False, soft_wrap=True, highlight=False)
        return 0
    columns = (
        "Signal",
        "Farthest from its start: A",
        "B",
        "Largest difference of A and B",
        "at [s]",
        "RMS of the difference",
        "Strongest oscillation in A",
        "in B",
    )
    rows = [
        (
            f"{c.expression} [{c.unit}]",
            f"{c.deviations[0]:.4g}",
            f"{c.deviations[1]:.4g}",
            f"{c.largest:.4g}",
            f"{c.at:.3f}",
            f"{c.rms:.4g}",
            *map(_mode_text, c.modes),
        )
        for c in found
    ]
    table = make_table(f"A: {options.first}\nB: {options.second}", *columns, rows=rows)
    print_parts(make_console(), [table, *map(escape, found.remarks)])
    return 0


def _mode_text(mode: IdentifiedMode | None) -> str:
    if mode is None:
        return "–"
    return f"{mode.frequency_hz:.3f} Hz, {mode.damping_percent:.2f} %{' ?' if mode.doubts else ''}"
