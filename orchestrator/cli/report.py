"""``gfor report``: one self-contained page."""

import argparse
from pathlib import Path

from orchestrator.cli.terminal import saying_warnings
from orchestrator.report.html.page import write_report


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("folder", type=Path, metavar="DIR", help="folder of results, or a file among them")
    parser.add_argument("others", type=Path, nargs="*", metavar="DIR", help="more of them: of run, modes, screen, "
                        "sweep, site, design, certify, check, interactions; JSON of `gfor signal`")  # fmt: skip
    parser.add_argument("--out", type=Path, metavar="FILE.html", help="page (default: DIR/report.html)")
    parser.add_argument("--against", type=Path, metavar="OLD.html", help="an older page: say what changed since")


def run(options: argparse.Namespace) -> int:
    with saying_warnings():
        page = write_report(options.folder, options.others, options.out, options.against)
    print(page)
    return 0
