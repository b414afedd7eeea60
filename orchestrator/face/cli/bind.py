"""``gfor fmu bind``: a draft of what a foreign FMU's variables mean at our port."""

import argparse
from pathlib import Path

from orchestrator.core.errors import InputError
from orchestrator.devices.binding.tables import REQUIRED
from orchestrator.devices.fmi.description import read_declared
from orchestrator.devices.fmi.device_or_controller import NO_BUS, is_controller_alone
from orchestrator.face.api.binding import bind
from orchestrator.face.cli.arguments import add_options


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_options(parser, "bind")


def run(options: argparse.Namespace) -> int:
    description = read_declared(options.file)
    out = options.out or Path(f"{options.file.stem}.toml")
    if out.exists() and not options.force:
        raise InputError(
            f"{out}: the file is there already, perhaps filled in; choose another with --out, or --force"
        )
    text = bind(description, out)
    marked = [
        line.strip() for line in text.splitlines() if REQUIRED in line and not line.startswith("#")
    ]
    if is_controller_alone(description):
        print(
            f"{options.file}: {NO_BUS}; a binding makes a device of it only where its DLL is a whole converter"
        )
    print(f"{out}: confirm what is marked GUESS")
    for line in marked:
        print(f"  to be filled in: {line}")
    return 0
