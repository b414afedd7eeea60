"""``gfor master federate``: one component of a case as a federate, for a run that goes on elsewhere."""

import argparse
import os
import sys

from orchestrator.core.errors import CosimError, InputError
from orchestrator.face.cli.arguments import add_options
from orchestrator.face.cli.case_arguments import add_case_arguments, prepare
from orchestrator.simulation.federation.federate import OwnFederate
from orchestrator.simulation.federation.layout import require_broker
from orchestrator.simulation.waiting_times import TO_JOIN


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_case_arguments(parser)
    add_options(parser, "federate", TO_JOIN=TO_JOIN)


def run(options: argparse.Namespace) -> int:
    """Take part in one run; values come from there, the case says which FMU it is."""
    having = [p for p in prepare(options) if options.component in p.system.components]
    if not having:
        raise InputError(
            f"--component {options.component}: no scenario of {options.case} has such a component"
        )
    description = having[0].system.components[options.component].description
    require_broker(options.broker)
    print(f"federate {options.component!r} at {options.broker}, until the run ends", flush=True)
    try:
        OwnFederate(options.component, description, options.broker, options.to_join).run()
    except CosimError as error:
        print(f"error: {error}", file=sys.stderr, flush=True)
        os._exit(error.exit_code)
    sys.stdout.flush()
    os._exit(0)  # HELICS may wait for somebody who is gone
