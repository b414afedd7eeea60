"""``gfor signal source``: where the oscillations of a run or a recording come from."""

import argparse
from pathlib import Path

from rich.markup import escape

from orchestrator.api.source import source
from orchestrator.api.sources import Sources, contest_sources
from orchestrator.cli.arguments import seconds, seconds_or_none
from orchestrator.cli.terminal import make_console, print_json, saying_warnings
from orchestrator.cli.verdict import add_details_argument
from orchestrator.errors import InputError
from orchestrator.oscillations.verdict import Located
from orchestrator.report.tables import PlainTable

_SHOWN = 5


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.epilog = "A source is named only where the methods that apply agree; else it is said what each of them says."
    parser.add_argument("run", type=Path, nargs="?", metavar="RUN",
                        help="folder of a scenario's results, its trajectory.nc, COMTRADE or CSV with columns NAME.vm, "
                        "NAME.va, NAME.p, NAME.q")  # fmt: skip
    parser.add_argument("--contest", type=Path, metavar="FOLDER",
                        help="cases in the form of the 2021 IEEE-NASPI contest (BusVolMag.txt and so on)")  # fmt: skip
    parser.add_argument("--start", type=seconds_or_none, metavar="T", help="begin of the part that is used [s]")
    parser.add_argument("--stop", type=seconds, metavar="T", help="its end [s]")
    parser.add_argument("--json", action="store_true", help="print JSON")
    add_details_argument(parser)


def run(options: argparse.Namespace) -> int:
    """Print the oscillations of one record, or of each case of a contest's folder."""
    if (options.run is None) == (options.contest is None):
        raise InputError("give a run or a recording, or --contest FOLDER; not both")
    with saying_warnings():
        if options.contest is not None:
            found = contest_sources(options.contest)
        else:
            found = [source(options.run, options.start, options.stop)]
    if options.json:
        records = [one.as_json() for one in found]
        print_json(records if options.contest else records[0])
        return 0
    _print(found, details=options.details)
    return 0


def _print(found: list[Sources], *, details: bool) -> None:
    console = make_console()
    table = PlainTable(header_style="bold")
    for column in ("Record", "f [Hz]", "Kind", "Source", "Begins [s]", "Multiples"):
        table.add_column(column, justify="left" if column in ("Record", "Kind", "Source") else "right")
    for one in found:
        for x in one:
            begin = "before" if x.found.begin is None else f"{x.found.begin:.1f}"
            multiples = ", ".join(str(order) for order in x.found.harmonics)
            frequency = f"{x.found.frequency:.4f}"
            table.add_row(
                escape(one.label), frequency, x.evidence.kind, escape(x.source or "not known"), begin, multiples
            )
        if not len(one):
            table.add_row(escape(one.label), "-", "no oscillation", "-", "-", "")
    console.print(table)
    for one in found:
        for x in one:
            head = f"{one.label}, {x.found.frequency:.4g} Hz"
            console.print(escape(f"{head}: {x.reason}. Next: {x.advice}."), soft_wrap=True, highlight=False)
            if details:
                _print_details(head, x)
        for remark in one.remarks:
            console.print(escape(f"{one.label}: {remark}"), soft_wrap=True, highlight=False)


def _print_details(head: str, one: Located) -> None:
    console = make_console()
    table = PlainTable(title=escape(head), title_justify="left", header_style="bold")
    for column in ("Method", "Applies", "Names", "Places, the largest part first"):
        table.add_column(column)
    for o in one.opinions:
        places = ", ".join(f"{name} {100 * share:.0f} %" for name, share in o.ranking[:_SHOWN])
        table.add_row(o.method, "yes" if o.applies else "no", escape(o.place or "-"), escape(places))
    console.print(table)
    text = ", ".join(f"{name} {value:.3g}" for name, value in list(one.found.amplitudes.items())[:_SHOWN])
    console.print(escape(f"Amplitudes, the clearest first: {text}"), soft_wrap=True, highlight=False)
