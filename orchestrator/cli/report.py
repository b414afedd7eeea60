"""``gfor report``: one self-contained page."""

import argparse
from pathlib import Path

from orchestrator.cli.terminal import saying_warnings
from orchestrator.report.html.page import USED, write_report


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("folder", type=Path, metavar="DIR", help="folder of results, or a file among them")
    parser.add_argument("others", type=Path, nargs="*", metavar="DIR", help=f"more of them: of {USED}")
    parser.add_argument("--out", type=Path, metavar="FILE.html", help="page (default: DIR/report.html)")
    parser.add_argument("--against", type=Path, metavar="OLD", help="an older page, or folder of results: say what "
                        "changed since")  # fmt: skip
    parser.add_argument("--title", metavar="TEXT", help="heading of the page (default: the case's title)")
    parser.add_argument("--short", action="store_true", help="the first page and the provenance alone")


def run(options: argparse.Namespace) -> int:
    with saying_warnings():
        page = write_report(options.folder, options.others, options.out, options.against, options.title,
                            short=options.short)  # fmt: skip
    print(page)
    return 0
