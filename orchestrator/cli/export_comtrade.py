"""``gfor export comtrade``: recorded signals as a COMTRADE recording for other tools."""

import argparse

from orchestrator.api.comtrade import export_comtrade
from orchestrator.asked import read_positive
from orchestrator.cli.arguments import add_options, option
from orchestrator.cli.terminal import saying_warnings


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_options(parser, "export_comtrade")
    option(parser, "--form", "FORM",
           "ASCII, BINARY, BINARY32 or FLOAT32 (BINARY32)", read=str.upper, default="BINARY32")  # fmt: skip
    option(parser, "--frequency", "HZ", "rated frequency [Hz] (the run's)", read=read_positive)


def run(options: argparse.Namespace) -> int:
    with saying_warnings():
        files = export_comtrade(options.run, options.signal or (), options.out, options.form, options.frequency)
    for file in files:
        print(file)
    return 0
