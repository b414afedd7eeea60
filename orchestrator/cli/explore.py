"""``gfor explore``: a case in the browser, with sliders."""

import argparse
import webbrowser

from orchestrator.analysis.modes import ELECTROMECHANICAL_HZ
from orchestrator.api.case import load
from orchestrator.asked import read_range
from orchestrator.cli.arguments import assignment, option, repeatable, switch
from orchestrator.cli.case_arguments import add_trust_argument, values_set
from orchestrator.errors import InputError
from orchestrator.explore.server import Explorer


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "case", metavar="CASE", help="a built-in case (two_area), or the path of a case file or an .ssp"
    )
    option(parser, "--scenario", "NAME", "the one that is shown first (default: the case's last one)")
    repeatable(parser, "--set", "COMPONENT.PARAMETER=VALUE", "a value to begin with (repeatable)", read=assignment)
    option(parser, "--range", "LO:HI", "frequencies shown first [Hz] (default: 0.1:2)", read=read_range,
           default=ELECTROMECHANICAL_HZ)  # fmt: skip
    option(
        parser, "--port", "N", "of the server, on this machine alone (default: any that is free)", read=_port, default=0
    )
    switch(parser, "--no-browser", "print the address, and open no browser")
    add_trust_argument(parser)


def run(options: argparse.Namespace) -> int:
    """Serve the page until it was closed for a minute, or Ctrl-C."""
    case = load(options.case, trust_fmus=options.trust_fmus)
    name = options.scenario or case.scenarios[-1]
    if name not in case.scenarios:
        raise InputError(f"--scenario: there is no scenario {name!r}; the case has: {', '.join(case.scenarios)}")
    beginning = {"case": case.name, "scenario": name, "values": values_set(options), "range": list(options.range)}
    explorer = Explorer(options.case, beginning, port=options.port, trust_fmus=options.trust_fmus)
    print(f"{explorer.address}  (ends by Ctrl-C, or a minute after its last page was closed)", flush=True)
    if not options.no_browser:
        webbrowser.open(explorer.address)
    explorer.serve()
    return 0


def _port(text: str) -> int:
    if not text.isdecimal() or not 0 < int(text) < 2**16:
        raise ValueError(f"{text!r} is no port; give a whole number from 1 to 65535")
    return int(text)
