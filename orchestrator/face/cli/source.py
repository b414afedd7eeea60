"""``gfor signal source``: where the oscillations of a run or a recording come from."""

import argparse
from warnings import catch_warnings, simplefilter

from rich.console import RenderableType
from rich.markup import escape

from orchestrator.cases.networks.element_names import ElementNames
from orchestrator.core.errors import InputError
from orchestrator.core.safe_files import write_page
from orchestrator.face.api.case import load
from orchestrator.face.api.scenario import UnusualDataWarning
from orchestrator.face.api.source import contest_sources, source
from orchestrator.face.cli.arguments import add_json_argument, add_kept_argument, add_options
from orchestrator.face.cli.terminal import (
    keep_json,
    make_console,
    print_json,
    print_parts,
    print_questions,
    saying_warnings,
)
from orchestrator.face.cli.verdict import add_details_argument
from orchestrator.studies.oscillations.tables import opinions_table
from orchestrator.studies.oscillations.view import Sources, sources_table

_SHOWN = 5


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_options(parser, "source")
    add_json_argument(parser)
    add_kept_argument(parser, "source")
    add_details_argument(parser)


def run(options: argparse.Namespace) -> int:
    """Print the oscillations of one record, or of each case of a contest's folder."""
    if (options.run is None) == (options.contest is None):
        raise InputError("give a run or a recording, or --contest FOLDER; not both")
    if options.scenario and not options.case:
        raise InputError("--scenario: it is one of a case; give --case as well")
    with saying_warnings(), catch_warnings():
        simplefilter("ignore", UnusualDataWarning)  # they are printed
        scenario = None
        if options.contest is not None:
            found = contest_sources(options.contest)
        else:
            scenario = load(options.case).scenario(options.scenario) if options.case else None
            print_questions(
                [scenario.prepared] if scenario else [], as_json=options.json, whole=options.details
            )
            found = [source(options.run, options.start, options.stop, scenario)]
    records = [one.as_json() for one in found]
    keep_json(records, options.out, "source")
    if options.html:
        if options.contest:
            raise InputError(
                "--html: it is the page of one record; give RUN in the place of --contest"
            )
        write_page(options.html, found[0].html())
    if options.json:
        print_json(records if options.contest else records[0])
        return 0
    names = scenario.prepared.names if scenario is not None else None
    _print(found, names, details=options.details)
    return 0


def _print(found: list[Sources], names: ElementNames | None, *, details: bool) -> None:
    console = make_console(names=names)
    print_parts(
        console, (escape(f"{one.label}: {remark}") for one in found for remark in one.remarks)
    )
    console.print(sources_table(found))
    for one in found:
        for x in one:
            head = f"{one.label}, {x.found.frequency:.4g} Hz"
            said: list[RenderableType] = [escape(f"{head}: {x.reason}. Next: {x.advice}.")]
            if details:
                text = ", ".join(
                    f"{name} {value:.3g}"
                    for name, value in list(x.found.amplitudes.items())[:_SHOWN]
                )
                said += [opinions_table(head, x), escape(f"Amplitudes, the clearest first: {text}")]
            print_parts(console, said)
