"""``gfor certify``: the grid code's damping test, and other codes' tests, on any converter FMU."""

import argparse
from pathlib import Path

from orchestrator.cases.devices import devices_of
from orchestrator.certification.codes.all_codes import NTS631
from orchestrator.certification.details import TEMPLATE
from orchestrator.certification.request import PODS, REACTANCES
from orchestrator.cli.arguments import add_executor_arguments, option, reactances, repeatable, setting, switch
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
    parser.add_argument("fmu", nargs="*", metavar="FILE.fmu",
                        help="the converter; several, also as NAME=FILE.fmu, are compared in one matrix")  # fmt: skip
    parser.add_argument("--code", choices=CODE_NAMES, default=NTS631,
                        help="whose test: nts631 (Spain, 50 Hz: the damping test, the default), miso (central USA, "
                        "60), ercot and nogrr245 (Texas, 60), prc029 (North America, 60), aemo (Australia, 50), "
                        "fingrid (Finland, 50), tr331 (Denmark, 50), rte (France, 50), gb (Great Britain, 50: "
                        "figures), all",
                        metavar="CODE")  # fmt: skip
    repeatable(parser, "--binding", "vendor.toml", "maps the FMU's variables to our port; of one of several "
               "converters: NAME=vendor.toml (repeatable)")  # fmt: skip
    parser.add_argument(
        "--pod", choices=PODS,
        help="damping controllers that are to be active: set in the FMU where it has pod_p.enabled and pod_q.enabled, "
        "else declared by the applicant (default: as the FMU shows them)",
    )  # fmt: skip
    repeatable(parser, "--set", "VARIABLE=VALUE", "a value of the converter, such as pod_p.K=150, or of the study, "
               "such as sg1.governor.enabled=true, which makes it another test than the norm's; of one of several "
               "converters: NAME:VARIABLE=VALUE (repeatable)", read=setting)  # fmt: skip
    repeatable(parser, "--declare", "NAME=VALUE", "what is declared of the converter, for the codes that compare it "
               "with that: X_eff, D and H for rte (repeatable)", read=setting)  # fmt: skip
    option(parser, "--reactances", "X,X,…", "line reactances X_L [pu] (default: the norm's 13, 0.01 and 0.05 to 0.60; "
           "less is incomplete)", read=reactances, default=REACTANCES)  # fmt: skip
    switch(parser, "--black-box", "do not use the converter's states for the modes, even if it shows them")
    add_executor_arguments(parser)
    option(parser, "--out", "DIR", "folder for results (default: results/certify_<file>); points that are there are "
           "not computed again", read=Path)  # fmt: skip
    _add_document_arguments(parser)
    add_sensitivity_arguments(parser)
    parser.add_argument("--json", action="store_true", help="print all figures as JSON")


def _add_document_arguments(parser: argparse.ArgumentParser) -> None:
    option(parser, "--details", "FILE.toml", "number, applicant, operator, tester, place, date", read=Path)
    parser.add_argument("--details-template", action="store_true", help="print such a file to be filled in, and end")
    checks = parser.add_mutually_exclusive_group()
    checks.add_argument("--check", type=Path, metavar="report.json",
                        help="the FMU's acceptance tests by `gfor fmu check --json` (default: run now)")  # fmt: skip
    checks.add_argument("--no-check", action="store_true", help="leave out the acceptance tests; the report says so")
    option(parser, "--into", "OUT.fmu", "write the FMU with its certificate in it, and with experiments that any tool "
           "can repeat; certificates by other codes that OUT.fmu holds stay", read=Path)  # fmt: skip
    switch(parser, "--pdf", "print the report to certificate.pdf with an installed browser")


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
