"""``gfor report``: one self-contained page."""

import argparse
from pathlib import Path

from orchestrator.cli.arguments import option
from orchestrator.cli.terminal import saying_warnings
from orchestrator.report.html.page import write_report


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("folder", type=Path, metavar="DIR", help="folder of `gfor run`")
    parser.add_argument("others", type=Path, nargs="*", metavar="DIR", help="folders of sweeps and designs beside it")
    option(parser, "--out", "FILE.html", "page (default: DIR/report.html)", read=Path)


def run(options: argparse.Namespace) -> int:
    """Write the page and print its path."""
    with saying_warnings():
        page = write_report(options.folder, options.others, options.out)
    print(page)
    return 0
