"""``gfor certify``: the grid code's damping test, and other codes' tests, on any converter FMU."""

import argparse

from orchestrator.cases.devices import devices_of
from orchestrator.certification.codes.all_codes import NTS631
from orchestrator.certification.details import TEMPLATE
from orchestrator.certification.request import PODS, REACTANCES
from orchestrator.cli.arguments import add_executor_arguments, add_options, option, reactances, switch
from orchestrator.cli.certificate import ALL, CODE_NAMES, GB, codes_of, run_one, run_stiffness
from orchestrator.cli.certify_matrix import run_matrix
from orchestrator.cli.certify_sensitivities import add_sensitivity_arguments, check_sensitivity_options
from orchestrator.errors import INTERRUPTED, InputError


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.epilog = (
        "Exit codes: 0 the converter passes; 1 it fails; 2 an input cannot be used; 3 the test is incomplete, as with "
        f"fewer than 13 reactances; 4 it passes, and an acceptance test of the FMU failed; {INTERRUPTED} interrupted. "
        "Of several certificates, with --code all or several files, the first of 1, 2, 3, 4 that one of them has."
    )
    add_options(parser, "certify")
    parser.add_argument("--code", choices=CODE_NAMES, default=NTS631,
                        help="whose test: nts631 (Spain, 50 Hz: the damping test, the default), miso (central USA, "
                        "60), ercot and nogrr245 (Texas, 60), prc029 (North America, 60), aemo (Australia, 50), "
                        "fingrid (Finland, 50), tr331 (Denmark, 50), rte (France, 50), gb (Great Britain, 50: "
                        "figures), all",
                        metavar="CODE")  # fmt: skip
    add_options(parser, "certify 2")
    parser.add_argument(
        "--pod", choices=PODS,
        help="damping controllers that are to be active: set in the FMU where it has pod_p.enabled and pod_q.enabled, "
        "else declared by the applicant (default: as the FMU shows them)",
    )  # fmt: skip
    add_options(parser, "certify 3")
    option(parser, "--reactances", "X,X,…", "line reactances X_L [pu] (default: the norm's 13, 0.01 and 0.05 to 0.60; "
           "less is incomplete)", read=reactances, default=REACTANCES)  # fmt: skip
    switch(parser, "--black-box", "do not use the converter's states for the modes, even if it shows them")
    add_executor_arguments(parser)
    add_options(parser, "certify 4")
    _add_document_arguments(parser)
    add_sensitivity_arguments(parser)
    parser.add_argument("--json", action="store_true", help="print all figures as JSON")


def _add_document_arguments(parser: argparse.ArgumentParser) -> None:
    add_options(parser, "document")
    checks = parser.add_mutually_exclusive_group()
    add_options(checks, "document 2")
    add_options(parser, "document 3")


def run(options: argparse.Namespace) -> int:
    """Run the tests, write their reports and print the verdicts.

    Returns
    -------
    0 where the converter passes, 1 where it fails, 3 where the test is incomplete, 4 where it passes and an acceptance
    test of the FMU failed; of several certificates as `CertificateMatrix.exit_code`.
    """
    if options.details_template:
        print(TEMPLATE, end="")
        return 0
    if not options.fmu:
        raise InputError("the converter is missing: gfor certify FILE.fmu")
    check_sensitivity_options(options, codes_of(options.code), NTS631)
    devices = devices_of(options.fmu, options.binding, options.set)
    if options.into and (len(devices) > 1 or options.code in (GB, ALL)):
        raise InputError("--into: it takes one device's certificate by one code with a verdict; for another code "
                         "repeat the command with the same --into")  # fmt: skip
    if options.code == GB and len(devices) == 1:
        return run_stiffness(options, devices[0])
    if len(devices) > 1 or options.code == ALL:
        return run_matrix(options, devices)
    return run_one(options, devices[0])
