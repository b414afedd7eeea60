"""Which components are federates at HELICS: options of ``gfor run``."""

import argparse

from orchestrator.core.asked import read_whole
from orchestrator.core.errors import InputError
from orchestrator.face.cli.arguments import add_options
from orchestrator.face.cli.terminal import make_errors
from orchestrator.simulation.engine import ENGINES
from orchestrator.simulation.federates import Federates
from orchestrator.simulation.waiting_times import PATIENCE, TO_JOIN


def add_arguments(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("federates over HELICS (extra `federation`)")
    add_options(
        group,
        "federates",
        engines=("local", *ENGINES),
        names=names,
        none=(),
        port=read_whole(1, 65534, "a port"),
        PATIENCE=PATIENCE,
        TO_JOIN=TO_JOIN,
    )


def names(text: str) -> tuple[str, ...]:
    found = tuple(dict.fromkeys(part.strip() for part in text.split(",")))
    if not all(found):
        raise ValueError(
            f"{text!r} is not a list of names with commas between them, such as gfor,sg1"
        )
    return found


def choice(options: argparse.Namespace, number_of_scenarios: int) -> Federates | None:
    given = {
        "names": options.federate,
        "external": options.external,
        "broker": options.broker,
        "port": options.broker_port,
        "patience": options.patience,
        "to_join": options.to_join,
    }
    given = {key: value for key, value in given.items() if value not in (None, ())}
    if options.engine == "local":
        if given:
            raise InputError(
                "--federate, --external, --broker, --broker-port, --patience and --to-join need "
                "--engine helics"
            )
        return None
    if options.like is not None:
        raise InputError(
            "--like emulates another master on this machine; leave out either --like or --engine "
            f"{options.engine}"
        )
    if options.resume is not None or options.require_checkpoint or options.checkpoint:
        raise InputError(
            f"a run with federates keeps no checkpoints; leave out --engine {options.engine}, or --resume, "
            "--checkpoint and --require-checkpoint"
        )
    if options.external and number_of_scenarios > 1:
        raise InputError(
            f"--external {','.join(options.external)}: a federate of others takes part in one run, and here are "
            f"{number_of_scenarios} scenarios; choose one with --scenario"
        )
    console = make_errors()
    if options.checkpoint is None:
        console.print(
            "a run with federates keeps no checkpoints: if it is interrupted, it cannot be resumed"
        )
    return Federates(
        **given,
        announce=lambda text: console.print(text, markup=False),
        engine=options.engine,
    )
