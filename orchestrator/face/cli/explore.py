"""``gfor explore``: a case in the browser, with sliders."""

import argparse
import webbrowser
from collections.abc import Sequence
from pathlib import Path
from warnings import catch_warnings, simplefilter

from fmus.toolchain.temporary import own_folder, remove
from orchestrator.cases.form.names import no_scenario
from orchestrator.core.asked import read_whole
from orchestrator.core.errors import InputError
from orchestrator.core.safe_files import write_text
from orchestrator.face.api.case import Case
from orchestrator.face.api.progress import shown_progress
from orchestrator.face.api.scenario import UnusualDataWarning
from orchestrator.face.cli.arguments import add_options
from orchestrator.face.cli.case_arguments import add_trust_argument, values_set
from orchestrator.face.cli.progress_lines import both, progress_lines
from orchestrator.face.cli.terminal import make_console, saying_warnings
from orchestrator.face.explore.copies import begin_imports
from orchestrator.face.explore.opened import opened
from orchestrator.face.explore.saved import save_page
from orchestrator.face.explore.server import Explorer
from orchestrator.face.explore.worker import Desk
from orchestrator.linear.spectra.modes import ELECTROMECHANICAL_HZ
from orchestrator.output.results.trajectory import open_trajectory
from orchestrator.studies.sweep.axes import parse_vary


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_options(parser, "explore", port=read_whole(1, 65535, "a port"), parse_vary=parse_vary)
    add_trust_argument(parser)


def run(options: argparse.Namespace) -> int:
    word, case, kind = opened(options.case, trust_fmus=options.trust_fmus)
    if "study" in kind and (options.set or options.range != ELECTROMECHANICAL_HZ or options.save):
        raise InputError(
            f"{options.case}: a study has its own values and range, and is not saved as a page; --set, "
            "--range and --save go with a case"
        )
    names = options.scenario or [kind.get("scenario", first_shown(case))]
    unknown = [name for name in names if name not in case.scenarios]
    if unknown:
        raise InputError(f"--scenario: {no_scenario(unknown[0], case.scenarios)}")
    name, *further = dict.fromkeys(names)
    if further and options.save is None:
        raise InputError(
            "--scenario: the page has all scenarios to choose from; name the one that is shown first, or give --save "
            "FILE.html, whose page has those that are named"
        )
    values = kind.get("values", {}) | values_set(options)
    beginning = (
        {"case": case.name, "range": list(options.range)}
        | kind
        | {"scenario": name, "values": values}
    )
    if options.beside is not None:
        with saying_warnings():
            open_trajectory(options.beside)  # what cannot be read is refused here
        beginning["recorded"] = {"": str(options.beside)}
    if options.save is not None:
        desk = Desk(word, options.trust_fmus)
        with (
            progress_lines(make_console(), "explore", "points") as lines,
            shown_progress("Points", shown=True) as report,
            catch_warnings(),
        ):
            simplefilter("ignore", UnusualDataWarning)  # the page has them
            told = both(report, lines.report)
            save_page(options.save, case, desk, beginning, options.vary, told, further=further)
        print(f"Written: {options.save}{_not_on_the_page(case, [name, *further])}")
        return 0
    if options.vary:
        raise InputError(
            "--vary is for a page that is saved; give --save FILE.html as well, or drag the slider"
        )
    begin_imports()  # while the browser starts
    explorer = Explorer(word, beginning, port=options.port, trust_fmus=options.trust_fmus)
    print(
        f"{explorer.address}  ({_first_of(case, options, name)}ends by Ctrl-C, or a minute after its last page was "
        "closed)",
        flush=True,
    )
    if options.no_browser:
        explorer.serve()
        return 0
    folder = own_folder("explore")
    try:
        webbrowser.open(way_to(explorer.address, folder).as_uri())
        explorer.serve()
    finally:
        remove(folder)
    return 0


def _first_of(case: Case, options: argparse.Namespace, name: str) -> str:
    """Tell which scenario of several is shown first where none was asked for."""
    if options.scenario or len(case.scenarios) == 1:
        return ""
    return f"scenario {name} first, all can be chosen; "


def _not_on_the_page(case: Case, shown: Sequence[str]) -> str:
    others = [name for name in case.scenarios if name not in shown]
    if not others:
        return ""
    return f" with {', '.join(shown)}; without {', '.join(others)}: --vary, with --scenario once for each, adds them"


def first_shown(case: Case) -> str:
    """The last scenario that has the events of the case.

    A scenario with events of its own, such as the trip of a unit, is shown if it is asked for."""
    plain = [name for name, table in case.file.scenarios.items() if table.events is None]
    return plain[-1] if plain else case.scenarios[0]


def way_to(address: str, folder: Path) -> Path:
    """A page that leads to an address: others of this machine read a browser's command line, and not this file."""
    page = folder / "explore.html"
    silent = '<meta name="referrer" content="no-referrer">'
    write_text(page, f'{silent}<meta http-equiv="refresh" content="0; url={address}">')
    return page
