"""``gfor export dll``: a converter's control part as IEEE/CIGRE DLL for EMT programs."""

import argparse

from orchestrator.core.errors import InputError
from orchestrator.core.units import read_value
from orchestrator.face.api.dll import export_dll
from orchestrator.face.cli.arguments import add_options
from orchestrator.face.cli.terminal import said_stages


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_options(parser, "export_dll")


def run(options: argparse.Namespace) -> int:
    with said_stages() as report:
        written = export_dll(
            options.name,
            options.dest,
            platforms=options.platform,
            sample_time=options.sample_time,
            values=dict(map(_value, options.set)),
            report=report,
        )
    for path in (*written.libraries.values(), written.sheet):
        print(path)
    return 0


def _value(entry: str) -> tuple[str, float]:
    name, _, text = entry.partition("=")
    value = read_value(text)
    if not name or isinstance(value, str):
        raise InputError(
            f"--set {entry}: give NAME=VALUE with a number, true or false, such as pod_p.enabled=true"
        )
    return name, float(value)
