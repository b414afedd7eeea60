"""``gfor signal identify``: the modes in a recorded signal."""

import argparse
from pathlib import Path

from rich.markup import escape

from orchestrator.api.identification import identify
from orchestrator.cli.arguments import add_kept_argument, option, seconds, seconds_or_none, switch
from orchestrator.cli.terminal import keep_json, make_console, make_errors, print_json, saying_warnings
from orchestrator.report.tables import eigenvalue_text, make_table


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.epilog = (
        "Amplitudes are those at the start; an oscillation's is half of its peak, as it is one of two conjugate "
        "exponentials. '?' marks a mode in doubt, with the reasons below the table."
    )
    parser.add_argument("run", type=Path, metavar="RUN",
                        help="folder of a scenario's results, its trajectory.nc, COMTRADE, CSV or Excel")  # fmt: skip
    parser.add_argument("signal", metavar="SIGNAL", help="'a.b' or 'a.b - c.d'")
    option(parser, "--start", "T", "beginning of the free response [s] (2)", read=seconds_or_none, default=2.0)
    option(parser, "--stop", "T", "its end [s] (default: the run's)", read=seconds)
    switch(parser, "--json", "print JSON")
    add_kept_argument(parser, "ringing")


def run(options: argparse.Namespace) -> int:
    with saying_warnings():
        found = identify(options.run, options.signal, options.start, options.stop)
    keep_json(found.as_json(), options.out, "ringing")
    if options.json:
        print_json(found.as_json())
        for text in found.remarks:
            make_errors().print(text, soft_wrap=True, highlight=False)
        return 0
    title = f"{found.signal} from {found.start:g} to {found.stop:g} s (matrix pencil), strongest first"
    columns, rows = ("λ [rad/s]", "f [Hz]", "Damping [%]", "Amplitude"), []
    for m in found:
        figures = (f"{m.frequency_hz:.4f}{' ?' if m.doubts else ''}", f"{m.damping_percent:.2f}")
        shown = ("trend", "-") if found.is_trend(m) else figures
        rows.append((eigenvalue_text(m.eigenvalue), *shown, f"{m.amplitude:.3g}"))
    table = make_table(title, *columns, left=0, rows=rows)
    console = make_console()
    console.print(table)
    for text in found.remarks:
        console.print(escape(text), soft_wrap=True, highlight=False)
    return 0
