"""``gfor report``: one self-contained page."""

import argparse

from orchestrator.face.cli.arguments import add_options
from orchestrator.face.cli.terminal import saying_warnings
from orchestrator.output.report.html.page import USED, write_report


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_options(parser, "report", USED=USED)


def run(options: argparse.Namespace) -> int:
    with saying_warnings():
        page = write_report(
            options.folder,
            options.others,
            options.out,
            options.against,
            options.title,
            short=options.short,
        )
    print(page)
    return 0
