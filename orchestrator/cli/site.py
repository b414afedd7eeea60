"""``gfor site``: where a converter helps, from options to files and words."""

import argparse
from pathlib import Path

from rich.markup import escape

from orchestrator.api.progress import shown_progress
from orchestrator.cli.arguments import add_json_argument, add_request_arguments, asked_by, option
from orchestrator.cli.case_arguments import add_case_arguments, case_of, of_one_scenario
from orchestrator.cli.study import present
from orchestrator.cli.terminal import print_questions, warn
from orchestrator.cli.verdict import NOT_MET
from orchestrator.safe_files import made_folder
from orchestrator.siting.study import SiteRequest, find_sites
from orchestrator.siting.view import Siting, ranking_table


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_case_arguments(parser, several=False)
    add_request_arguments(parser, SiteRequest)
    option(parser, "--out", "DIR", "write site.json, buses.csv and site.html with a map", read=Path)
    add_json_argument(parser)


def run(options: argparse.Namespace) -> int:
    """Compute, print and write; returns 3 where coupled FMUs do not confirm what was predicted."""
    of_case = of_one_scenario(options, "places are of one scenario")
    request = SiteRequest(**asked_by(options, SiteRequest), **of_case)
    folder = made_folder(options.out, "--out") if options.out else None
    with shown_progress("Places", shown=not options.json) as report:
        found = Siting(find_sites(case_of(options), request, report))
    prepared = found.result.prepared
    print_questions([prepared], as_json=options.json)
    written = found.save(folder) if folder else []
    end = f"Written: {', '.join(map(str, written))}" if written else ""
    if not options.json:
        warn(prepared.name, found.result.intact.found.warnings)
    texts = (escape(text) for text in (found.answer, *found.remarks))
    present(options, found.as_json, [*texts, "", ranking_table(found.result), ""], end=end)
    return 0 if found.agrees else NOT_MET
