"""``gfor certify``: the grid code's damping test, and other codes' tests, on any converter FMU."""

import argparse

from orchestrator.cases.form.devices import devices_of
from orchestrator.core.errors import INTERRUPTED, InputError
from orchestrator.face.cli.arguments import (
    add_executor_arguments,
    add_options,
    add_request_arguments,
)
from orchestrator.face.cli.certificate import (
    ALL,
    FREQUENCY,
    GB,
    LISTED,
    codes_of,
    read_code,
    run_one,
    run_stiffness,
)
from orchestrator.face.cli.certify_frequency import run_frequency
from orchestrator.face.cli.certify_matrix import run_matrix
from orchestrator.face.cli.certify_sensitivities import (
    add_sensitivity_arguments,
    check_sensitivity_options,
)
from orchestrator.studies.certification.codes.nts631 import NTS631
from orchestrator.studies.certification.details import TEMPLATE
from orchestrator.studies.certification.kinds import CertifyRequest


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_options(parser, "certify", code=read_code, listed=LISTED, INTERRUPTED=INTERRUPTED)
    add_options(parser.add_mutually_exclusive_group(), "certify checks")
    add_request_arguments(parser, CertifyRequest)
    add_executor_arguments(parser)
    add_sensitivity_arguments(parser)


def run(options: argparse.Namespace) -> int:
    """Run the tests, write their reports and print the verdicts; returns the exit code that the help tells."""
    if options.details_template:
        print(TEMPLATE, end="")
        return 0
    if not options.fmu:
        raise InputError("the converter is missing: gfor certify FILE.fmu")
    check_sensitivity_options(options, codes_of(options.code), NTS631)
    devices = devices_of(options.fmu, options.binding, options.set)
    if options.into and (len(devices) > 1 or options.code in (GB, FREQUENCY, ALL)):
        raise InputError(
            "--into: it takes one device's certificate by one code with a verdict; for another code "
            "repeat the command with the same --into"
        )
    if options.code == FREQUENCY and len(devices) == 1:
        return run_frequency(options, devices[0])
    if options.code == GB and len(devices) == 1:
        return run_stiffness(options, devices[0])
    several = len(devices) > 1 or options.code == ALL
    return run_matrix(options, devices) if several else run_one(options, devices[0])
