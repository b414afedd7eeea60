"""``gfor site``: where a converter helps, from options to files and words."""

import argparse
from pathlib import Path

from rich.markup import escape

from orchestrator.analysis.modes import ELECTROMECHANICAL_HZ
from orchestrator.api.progress import shown_progress
from orchestrator.asked import read_range
from orchestrator.cases.case import load_case
from orchestrator.cli.arguments import Joined
from orchestrator.cli.case_arguments import add_case_arguments, parameters, values_set
from orchestrator.cli.terminal import make_console, print_json, print_questions, warn
from orchestrator.cli.verdict import NOT_MET
from orchestrator.errors import InputError
from orchestrator.safe_files import made_folder
from orchestrator.siting.study import SiteRequest, find_sites
from orchestrator.siting.view import Siting, ranking_table


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_case_arguments(parser)
    default, add = SiteRequest("pod_p"), parser.add_argument
    add("--device", default=default.device, metavar="DEVICE", help="pod_p (default), pod_q, droop, or a vendor's .fmu")
    add("--binding", type=Path, metavar="FILE", help="binding of the vendor's FMU")
    add("--range", type=read_range, default=ELECTROMECHANICAL_HZ, metavar="LO:HI", help="frequencies [Hz] (0.1:2)")
    add("--outages", action=Joined, metavar="WHICH", help="rank for these as well: n-1, lines, units, or names")
    for name, kind, metavar, text in (
        ("below", float, "PERCENT", "damping of poorly damped modes"),
        ("confirm", int, "N", "confirm the best N by coupled FMUs"),
        ("rating", float, "MVA", "of the converter that confirms"),
        ("gain", float, "K", "largest of its POD [pu of its rating]"),
    ):
        value = getattr(default, name)
        add(f"--{name}", type=kind, default=value, metavar=metavar, help=f"{text} (default: {value:g})")
    add("--out", type=Path, metavar="DIR", help="write site.json, buses.csv and site.html with a map")
    add("--json", action="store_true", help="print JSON")


def run(options: argparse.Namespace) -> int:
    """Compute, print and write; returns 3 where coupled FMUs do not confirm what was predicted."""
    if len(options.scenario) > 1:
        raise InputError("--scenario: places are of one scenario; start one for each")
    request = SiteRequest(
        options.device, options.binding, options.scenario[0] if options.scenario else None, options.below,
        options.range, options.outages, options.confirm, options.rating, options.gain, values_set(options),
        parameters(options), options.step,
    )  # fmt: skip
    folder = made_folder(options.out, "--out") if options.out else None
    with shown_progress("Places", shown=not options.json) as report:
        found = Siting(find_sites(load_case(options.case, trust_fmus=options.trust_fmus), request, report))
    prepared = found.result.prepared
    print_questions([prepared], as_json=options.json)
    written = found.save(folder) if folder else []
    if options.json:
        print_json(found.as_json())
        return 0 if found.agrees else NOT_MET
    console = make_console()
    for text in (found.answer, *found.remarks):
        console.print(escape(text), soft_wrap=True, highlight=False)
    console.print("", ranking_table(found.result), "")
    warn(prepared.name, found.result.intact.found.warnings)
    if written:
        console.print(escape(f"Written: {', '.join(map(str, written))}"), soft_wrap=True)
    return 0 if found.agrees else NOT_MET
