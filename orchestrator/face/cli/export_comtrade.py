"""``gfor export comtrade``: recorded signals as a COMTRADE recording for other tools."""

import argparse

from orchestrator.face.api.comtrade import export_comtrade
from orchestrator.face.cli.arguments import add_options
from orchestrator.face.cli.terminal import saying_warnings


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_options(parser, "export_comtrade", upper=str.upper)


def run(options: argparse.Namespace) -> int:
    with saying_warnings():
        files = export_comtrade(
            options.run, options.signal or (), options.out, options.form, options.frequency
        )
    for file in files:
        print(file)
    return 0
